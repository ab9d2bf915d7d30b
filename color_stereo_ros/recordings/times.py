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
"""At which times of a recording the outputs stand."""


class OutputTimes:
    """
    Gives each output the time of its stamp, where the stamps are usable.

    A stamp of zero or less comes from a clock that had not started. If the first one is such a
    stamp, no stamp of the recording is trusted: all outputs stand at the time at which the pair
    was recorded. A later one stands as far from the other outputs as its pair was recorded from
    theirs.

    """

    def __init__(self):
        self._trusted = None
        self._offset = 0

    def of(self, stamp, recorded):
        """
        Return the time of the outputs of a pair.

        Parameters
        ----------
        stamp : int
            Of the left image, ns.
        recorded : int
            When the pair was recorded, ns.

        Returns
        -------
        time_ns : int
            Not negative: recordings hold no other times.

        """
        if self._trusted is None:
            self._trusted = stamp > 0
        if self._trusted and stamp > 0:
            self._offset = stamp - recorded
            return stamp
        return max(recorded + self._offset, 0)
