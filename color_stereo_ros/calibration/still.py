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
"""When a board that somebody holds before moving images stands still in a new place."""

from collections import deque

import numpy as np

STILL = 0.5   # px that corners move from pair to pair while the board counts as still
PAIRS = 3     # in a row that are still; chosen: a hand holds so long by intent
APART = 0.04  # of the diagonal of the image: so far corners must be from all taken views
COMMON = 6    # corners, to compare two views


class StillWatch:
    """Chooses views out of moving images."""

    def __init__(self):
        self._recent = deque(maxlen=PAIRS)
        self._taken = []

    def look(self, view):
        """
        Tell whether a view shows a board that stands still in a new place; if so, it is taken.

        Parameters
        ----------
        view : Shot
            Of the next pair.

        Returns
        -------
        taken : bool

        """
        self._recent.append(view)
        if view.problem is not None or len(self._recent) < PAIRS or not self._is_still():
            return False
        diagonal = np.hypot(*view.sizes[0])
        if any(moved(view, other) < APART * diagonal for other in self._taken):
            return False
        self._taken.append(view)
        return True

    def _is_still(self):
        recent = list(self._recent)
        return all(moved(first, second) < STILL for first, second in zip(recent, recent[1:]))


def moved(first, second):
    """
    Return how far the corners of a board are apart in two views.

    Parameters
    ----------
    first, second : Shot
        Two views of the board, one after the other.

    Returns
    -------
    distance : float
        px, the mean over the corners that both views have, in the camera where it is larger;
        infinite where no camera has enough of them.

    """
    distances = [_distance(*pair) for pair in zip(first.detections, second.detections)]
    known = [each for each in distances if each is not None]
    return max(known, default=np.inf)


def _distance(first, second):
    if first is None or second is None:
        return None
    _, one, other = np.intersect1d(first.ids, second.ids, return_indices=True)
    if len(one) < COMMON:
        return None
    return float(np.linalg.norm(first.pixels[one] - second.pixels[other], axis=1).mean())
