# SPDX-License-Identifier: Apache-2.0
# Copyright 2026 color_stereo_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The search for the projector in a thread of its own, while two views measure."""

from .memory import give_back
from .search_beside import SearchBeside
from ...core.surface.third.following import allow_third_view
from ...core.trackers import is_makable, tracker_of


def expects_projector(settings):
    """Return whether the projector can be found under core Settings."""
    return (settings.matching.method == 'surface' and allow_third_view(settings)
            and is_makable(settings.pattern))


class ProjectorSearch(SearchBeside):
    """Searches a pair that does not show the projector where it is expected."""

    NAME = 'projector search'

    def __init__(self):
        super().__init__()
        self._chores = SearchBeside()  # no search waits until they are done
        self._prepared = None  # the model for which the pattern was blurred last

    def get_ready(self, settings, calibration):
        """
        Begin to compute the features of the pattern, so that the first search need not.

        Parameters
        ----------
        settings : Settings
            Name the pattern.
        calibration : StereoCalibration or None
            Of the pairs that will come.

        """
        if (calibration is not None and expects_projector(settings)
                and not self._chores.busy):
            self._chores.begin(_get_ready, settings.pattern, calibration.geometry)

    def look(self, stereo, result):
        """
        Begin a search if this pair calls for one and none is under way.

        Parameters
        ----------
        stereo : ColorStereo
            The sensor.
        result : RangeResult
            Holds images of its own.

        """
        track = result.projector
        if track is None or self.busy:
            return
        if track.due:
            if stereo.projector.due:  # else a search ended while this pair was measured
                self.begin(_search, stereo, result)
        elif track.prepared is not self._prepared and not self._chores.busy:
            self._prepared = track.prepared
            self._chores.begin(give_back)  # blurring the pattern has needed much


def _get_ready(pattern, geometry):
    tracker_of(pattern, geometry)
    give_back()


def _search(stereo, result):
    give_back()  # looking at the first pair has needed much
    found = stereo.search_projector(result)
    if not stereo.projector.agreeing:  # else it was dark for a moment, and is where it was
        stereo.adopt_projector(found)
    give_back()
