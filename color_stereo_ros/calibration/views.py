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
"""What the cameras saw of the board, as flat arrays that an adjustment works on."""

from dataclasses import dataclass

import numpy as np

SIDES = ('left', 'right')
LEAST_CORNERS = 6
"""Corners of a view in one camera; chosen: a pose takes 4, and some must be left to judge it."""


@dataclass(frozen=True, eq=False)
class View:
    """One pose of the board, seen by one camera or both."""

    name: str
    """For messages: the file name of the left image, or a number."""
    left: object = None
    """A Detection (ids int (n,), pixels float64 (n, 2), sigma float64 (n,), px), or None."""
    right: object = None
    """As `left`."""

    def seen(self, side):
        """Return whether a camera sees enough corners."""
        detection = getattr(self, side)
        return detection is not None and len(detection.ids) >= LEAST_CORNERS

    @property
    def is_pair(self):
        """Return whether both cameras see enough corners."""
        return all(map(self.seen, SIDES))


@dataclass(frozen=True, eq=False)
class Corners:
    """All corners that one camera saw, view by view."""

    view: np.ndarray
    """int (m,), index of the view, increasing."""
    ids: np.ndarray
    """int (m,), index into the corners of the board."""
    pixels: np.ndarray
    """float64 (m, 2), raw image."""
    sigma: np.ndarray
    """float64 (m,), px: standard deviation of each coordinate."""

    @classmethod
    def of(cls, views, side):
        """Return the corners of some views in one camera."""
        found = [(np.full(len(detection.ids), index), detection.ids, detection.pixels,
                  detection.sigma) for index, detection in enumerate(
                      getattr(view, side) for view in views) if views[index].seen(side)]
        if not found:
            return cls(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)), np.zeros(0))
        return cls(*map(np.concatenate, zip(*found)))

    def of_view(self, index):
        """Return the slice of the corners of one view."""
        return slice(*np.searchsorted(self.view, [index, index + 1]))
