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

from .search_beside import SearchBeside


class ProjectorSearch(SearchBeside):
    """Searches a pair that does not show the projector where it is expected."""

    NAME = 'projector search'

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
        if result.projector is None or not result.projector.due or self.busy:
            return
        self.begin(_search, stereo, result)


def _search(stereo, result):
    found = stereo.search_projector(result)
    if not stereo.projector.agreeing:  # else it was dark for a moment, and is where it was
        stereo.adopt_projector(found)
