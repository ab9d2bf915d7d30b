# SPDX-License-Identifier: Apache-2.0
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
        # images of a message may be written again
        self.begin(_search, stereo, np.copy(left), np.copy(right))


def _search(stereo, left, right):
    found = stereo.search_rows(left, right)
    if not stereo.alignment.agreeing:  # else a pair has found out by itself
        stereo.adopt(found)
