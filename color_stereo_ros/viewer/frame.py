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
"""A measured pair, and which pixels of its images belong together."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core.cameras.rectification import raw_coordinates
from ..core.false_color import automatic_limits
from ..core.health.drift import corrected
from ..core.rows.alignment import terms

NEAR = 1.5
"""px; chosen: so far may a match lie from the pixel of the right image that was clicked."""

STEP, MOST = 4, 95
"""px, percentile; chosen: every fourth pixel of every fourth row tells it within a percent."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A pair and what was measured from it."""

    name: str
    """For people: number and stamp, or the name of a file."""
    result: object
    """RangeResult."""
    calibration: object
    """StereoCalibration."""
    left: np.ndarray | None = None
    """uint8 (H, W, 3), raw, RGB; None: not known."""
    right: np.ndarray | None = None
    """As `left`."""
    rectified_input: bool = False
    """The images were rectified when they came."""

    @property
    def size(self):
        """Return width and height of all images, px."""
        return self.result.geometry.width, self.result.geometry.height

    @cached_property
    def points(self):
        """Return the points, float32 (H, W, 3), m; NaN = unknown."""
        return self.result.points()

    @cached_property
    def depth_limits(self):
        """Return between which depths nearly all points lie, m."""
        return automatic_limits(self.result.depth) or (0.0, 1.0)

    @cached_property
    def largest_std(self):
        """Return the standard deviation of the depth that hardly any pixel exceeds, m."""
        part = np.s_[::STEP, ::STEP]
        depth, shift = self.result.depth[part], self.result.disparity_std[part]
        # as RangeResult.depth_std, which would be made of all pixels
        std = depth * depth * shift / self.result.geometry.focal_baseline
        known = std[np.isfinite(std)]
        return float(np.percentile(known, MOST)) if known.size else 1e-3

    @cached_property
    def _maps(self):
        """Return where each rectified pixel lies in the raw images; None: at itself."""
        if self.rectified_input:
            return None
        calibration, health = self.calibration, self.result.health
        if health is not None and health.applied.any():
            calibration = corrected(calibration, health.applied, baseline=False)
        return [raw_coordinates(camera) for camera in (calibration.left, calibration.right)]

    def raw_place(self, side, x, y):
        """
        Return where a place of a rectified image lies in the raw one.

        Parameters
        ----------
        side : int
            0 = left, 1 = right.
        x, y : float
            px.

        Returns
        -------
        place : (float, float)
            px; the nearest one at the border of the image.

        """
        width, height = self.size
        if self._maps is None:
            return float(x), float(y)
        column, row = (int(np.clip(np.floor(at), 0, count - 2))
                       for at, count in ((x, width), (y, height)))
        across, down = x - column, y - row
        weights = np.outer([1 - down, down], [1 - across, across])
        return tuple(float((weights * part[row:row + 2, column:column + 2]).sum())
                     for part in self._maps[side])

    def rectified_pixel(self, side, x, y):
        """Return the rectified (column, row) that is nearest to a place of a raw image."""
        if self._maps is None:
            return round(x), round(y)
        map_x, map_y = self._maps[side]
        row, column = np.unravel_index(np.argmin((map_x - x)**2 + (map_y - y)**2), map_x.shape)
        return int(column), int(row)

    def row_error(self, x, y):
        """Return by how much the right view was read lower at a place of it, px."""
        alignment = self.result.alignment
        return 0.0 if alignment is None else float(terms(x, y, self.size) @ alignment.applied)

    def match(self, column, row):
        """
        Return where the right camera sees what the left one sees in a pixel.

        Returns
        -------
        place : (float, float) or None
            Column and row of the rectified right image; None: the pixel has no range.

        """
        disparity = float(self.result.disparity[row, column])
        if not np.isfinite(disparity):
            return None
        x = column - disparity
        return x, row + self.row_error(x, row)

    def left_pixel(self, column, row):
        """Return the left pixel whose match is at a rectified right one; None: there is none."""
        row = int(np.clip(round(row - self.row_error(column, row)), 0, self.size[1] - 1))
        places = np.arange(self.size[0]) - self.result.disparity[row]
        off = np.abs(places - column)
        if not np.isfinite(off).any():
            return None
        nearest = int(np.nanargmin(off))
        return (nearest, row) if off[nearest] <= NEAR else None
