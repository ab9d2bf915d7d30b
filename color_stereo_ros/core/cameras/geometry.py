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
"""The geometry of a rectified pair, and the pair itself."""

from dataclasses import dataclass

from ..arrays import Bytes, Mask


@dataclass(frozen=True)
class RectifiedGeometry:
    """
    The geometry of a rectified pair: x_left - x_right = focal_x * baseline / Z + principal_offset.

    Pixel (0, 0) is the center of the top-left pixel.

    """

    width: int
    """Columns, px."""
    height: int
    """Rows, px."""
    focal_x: float
    """P[0, 0] of both cameras, px."""
    focal_y: float
    """P[1, 1] of both cameras, px."""
    center_x_left: float
    """P[0, 2] of the left camera, px."""
    center_x_right: float
    """P[0, 2] of the right camera, px."""
    center_y: float
    """P[1, 2] of both cameras, px."""
    baseline: float
    """Distance of the optical centers, m, > 0."""

    @property
    def principal_offset(self) -> float:
        """Return cx_left - cx_right, px: the disparity of a point at infinity."""
        return self.center_x_left - self.center_x_right

    @property
    def focal_baseline(self) -> float:
        """Return focal length times baseline, px m."""
        return self.focal_x * self.baseline


@dataclass(frozen=True, eq=False)
class RectifiedPair:
    """Two color images whose epipolar lines are the image rows."""

    left: Bytes
    """uint8 (H, W, 3), RGB; 0 outside the raw image."""
    right: Bytes
    """uint8 (H, W, 3), RGB; 0 outside the raw image."""
    left_inside: Mask
    """bool (H, W): the rectified pixel lies inside the raw left image."""
    right_inside: Mask
    """bool (H, W): the rectified pixel lies inside the raw right image."""
    geometry: RectifiedGeometry
