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
"""The search for the rows of the two views in a thread of its own, while pairs go on."""

import numpy as np

from .search_beside import SearchBeside


class RowSearch(SearchBeside):
    """Searches a pair whose views do not agree; what it finds holds from the next pair on."""

    NAME = 'row search'

    def look(self, stereo, left, right, result):
        """
        Begin a search if this pair calls for one and none is under way.

        Parameters
        ----------
        stereo : ColorStereo
            The sensor.
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        result : RangeResult
            Of the pair.

        """
        if result.alignment is None or not result.alignment.due or self.busy:
            return
        if not stereo.alignment.due:
            return  # a search ended while this pair was measured
        # images of a message may be written again
        self.begin(_search, stereo, np.copy(left), np.copy(right))


def _search(stereo, left, right):
    found = stereo.search_rows(left, right)
    if not stereo.alignment.agreeing:  # else a pair has found out by itself
        stereo.adopt(found)
