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
"""What a method measures, and the result that users get."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from .arrays import Bytes, Floats
from .cameras.geometry import RectifiedGeometry
from .health.health import Health
from .normals import normals_of
from .projector.tracking import Track
from .rows.alignment import Alignment
from .status_codes import VALID
from .triangulation import points_from_depth

NORMALS = 'normal_x', 'normal_y', 'normal_z'
"""The components of `RangeResult.normals`, as fields of points are named."""
POINT_FIELDS = *NORMALS, 'confidence', 'depth_std'
"""What a result knows of each point beside place and color."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a matching method makes of one pair, in pixels of the rectified left image."""

    disparity: Floats
    """float32 (H, W), x_left - x_right in px, NaN = unknown."""
    depth: Floats
    """float32 (H, W), meters along Z of the rectified left camera, NaN = unknown."""
    confidence: Floats
    """float32 (H, W), 0..1: the probability of being right within 1 px; 0 = unknown."""
    status: Bytes
    """uint8 (H, W), a `Status` code; 0 exactly where depth is finite."""
    disparity_std: Floats
    """float32 (H, W), standard deviation of the disparity in px, NaN = unknown."""
    views: Bytes | None = field(default=None, kw_only=True)
    """
    uint8 (H, W), who saw the place, bits: 1 right camera, 2 projector; 0 without a range.

    None: the method knows two cameras only; a RangeResult then has 1 at every range.
    """
    alignment: Alignment | None = field(default=None, kw_only=True)
    """By how much the rows of the two views disagree; None: the method does not measure it."""
    projector: Track | None = field(default=None, kw_only=True)
    """
    What is known of the projector, and its `sentence()`.

    None: `matching.third_view` is off, or pattern or method do not allow a third view.
    """
    rival_share: float = field(default=0.0, kw_only=True)
    """
    Share of the lit surface that matches at several places, 0..1, where a pattern whose colors
    never come again does not explain the images; 0 where it does, or such colors may come again.
    """


@dataclass(frozen=True, eq=False)
class RangeResult(Measurement):
    """What one pair of images gives, in the frame and pixels of the rectified left camera."""

    image_source: Bytes | Callable[[], Bytes]
    """The rectified left image, uint8 (H, W, 3), RGB, or a function that makes it when asked."""
    geometry: RectifiedGeometry
    disparity_limits: tuple[float, float]
    """(smallest, largest) disparity searched, px, from range.min_depth and range.max_depth."""
    seconds: dict[str, float] = field(default_factory=dict)
    """Duration of each stage, s."""
    planar: bool = field(default=False, kw_only=True)
    """The disparities of 2 x 2 pixels lie on a plane that was fitted to the images."""
    normals_source: Callable[[], Floats] | None = field(default=None, kw_only=True)
    """A function that returns the normals, where they are a part of others; None: computed."""
    health: Health | None = field(default=None, kw_only=True)
    """
    By how much the cameras have moved since they were calibrated, and its `sentence()`.

    None: `matching.row_alignment` is off, or the method does not measure the rows.
    """

    @cached_property
    def image(self) -> Bytes:
        """Return the rectified left image, uint8 (H, W, 3), RGB."""
        return self.image_source() if callable(self.image_source) else self.image_source

    @cached_property
    def depth_std(self) -> Floats:
        """Return the standard deviation of the depth, float32 (H, W), m, NaN = unknown."""
        # Z = f B / (d - d0)  =>  dZ = Z^2 / (f B) dd
        return self.depth * self.depth * self.disparity_std / np.float32(
            self.geometry.focal_baseline)

    @property
    def density(self) -> float:
        """Return the share of all pixels that have a range, 0..1."""
        return float(np.count_nonzero(self.status == VALID)) / self.status.size

    def points(self) -> Floats:
        """
        Return the points in the rectified left camera.

        Returns
        -------
        points : numpy.ndarray, float32, shape (H, W, 3)
            x right, y down, z forward, m; NaN = unknown.

        """
        return points_from_depth(self.depth, self.geometry)

    def normals(self) -> Floats:
        """
        Return the unit normals of the surface, which is computed when first asked.

        Returns
        -------
        normals : numpy.ndarray, float32, shape (H, W, 3)
            Rectified left camera, x right, y down, z forward, from the surface towards the
            camera's side; NaN = unknown. Do not write into it.

        """
        return self._normals

    @cached_property
    def _normals(self) -> Floats:
        if self.normals_source is not None:
            return self.normals_source()
        return normals_of(self.disparity, self.geometry, self.planar)
