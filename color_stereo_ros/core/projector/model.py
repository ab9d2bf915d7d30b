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
"""
The geometry of the projector as a value.

A projector is a camera whose image is the pattern. A point X of the rectified left camera, m, is
lit by the pixel (u, v) of the pattern:

    Y = R X + t                                    the point in the frame of the projector
    x = Y0 / Y2,  y = Y1 / Y2
    q = 1 + k1 (x x + y y)                         radial distortion
    u = fx q x + s q y + cu
    v = fy q y + cv

Pixel (0, 0) is the center of the top-left pixel of the pattern.

"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Doubles
from ..frozen import constant_array

PARAMETERS = ('focal_x', 'focal_y', 'skew', 'center_u', 'center_v', 'k1',
              'rotation_x', 'rotation_y', 'rotation_z',
              'translation_x', 'translation_y', 'translation_z')
COUNT = len(PARAMETERS)


@dataclass(frozen=True, eq=False)
class ProjectorModel:
    """Where the projector stands and how it projects the pattern; immutable."""

    camera_matrix: np.ndarray
    """float64 (3, 3), px of the pattern image: [[fx, s, cu], [0, fy, cv], [0, 0, 1]]."""
    distortion: float
    """k1, 1 per squared tangent of the angle; 0 = none."""
    rotation: np.ndarray
    """float64 (3, 3), from the rectified left camera frame to the projector frame."""
    translation: np.ndarray
    """float64 (3,), m: Y = R X + t."""
    size: tuple
    """Width and height of the pattern image, px."""
    covariance: np.ndarray
    """
    float64 (12, 12), of the parameters `PARAMETERS`.

    Focal lengths, skew and center in px, k1 without unit, the rotation in rad (a small turn w
    makes exp([w]x) R of R), the translation in m. Rows of what was held fixed are 0.
    """
    residual: float = float('nan')
    """Median distance of the matches from their predicted places, px of the pattern."""
    matches: int = 0
    """Number of the matches that agree with the geometry."""
    color_map: np.ndarray = field(default_factory=lambda: np.full((3, 4), np.nan))
    """
    float64 (3, 4): color in the left image = A p + b of the pattern's color p, [A | b].

    Chromaticities: shares of R, G and B in their sum. NaN = unknown.
    """
    color_quality: float = float('nan')
    """Share of the variance of the image's colors that `color_map` explains, 0..1."""

    def __post_init__(self):
        """Keep the arrays from being written."""
        for name in ('camera_matrix', 'rotation', 'translation', 'covariance', 'color_map'):
            object.__setattr__(self, name, constant_array(getattr(self, name)))
        object.__setattr__(self, 'size', (int(self.size[0]), int(self.size[1])))

    def project(self, points):
        """
        Return the pattern pixels that light some points.

        Parameters
        ----------
        points : numpy.ndarray, float, shape (..., 3)
            m, rectified left camera; NaN = unknown.

        Returns
        -------
        u, v : numpy.ndarray, float64, shape (...)
            Column and row of the pattern, px; NaN where the point is unknown or behind the
            projector. They may lie outside the pattern.

        """
        local = np.asarray(points, np.float64) @ self.rotation.T + self.translation
        depth = np.where(local[..., 2] > 0, local[..., 2], np.nan)
        x, y = local[..., 0] / depth, local[..., 1] / depth
        stretch = 1 + self.distortion * (x * x + y * y)
        (fx, skew, cu), (_, fy, cv), _ = self.camera_matrix
        return stretch * (fx * x + skew * y) + cu, stretch * fy * y + cv

    @property
    def center(self) -> Doubles:
        """Return the optical center in the rectified left camera, float64 (3,), m."""
        return -self.rotation.T @ self.translation

    @property
    def center_std(self) -> Doubles:
        """Return the standard deviations of `center`, float64 (3,), m."""
        # c = -R^T t and R' = exp([w]x) R give dc = -R^T (dt + [t]x dw)
        tx, ty, tz = self.translation
        cross = np.array([[0, -tz, ty], [tz, 0, -tx], [-ty, tx, 0]])
        jacobian = -self.rotation.T @ np.hstack([cross, np.eye(3)])
        return np.sqrt(np.diag(jacobian @ self.covariance[6:, 6:] @ jacobian.T))

    @property
    def field_of_view(self) -> tuple[float, float]:
        """Return the angles that the pattern spans, horizontal and vertical, degrees."""
        width, height = self.size
        (fx, _, cu), (_, fy, cv), _ = self.camera_matrix
        return (_angle((-0.5 - cu) / fx, (width - 0.5 - cu) / fx),
                _angle((-0.5 - cv) / fy, (height - 0.5 - cv) / fy))

    @property
    def std(self) -> Doubles:
        """Return the standard deviations of the parameters `PARAMETERS`, float64 (12,)."""
        return np.sqrt(np.diag(self.covariance))

    def sentence(self) -> str:
        """Return field of view, place and residual of the projector as one sentence."""
        wide, high = self.field_of_view
        text = (f'projector found: {wide:.0f} x {high:.0f} degrees, {place(self.center)} the '
                'left camera')
        known = np.isfinite(self.residual)
        return text + (f', residual {short(self.residual, 1)} px' if known else '')

    def but(self, **changes: Any) -> 'ProjectorModel':
        """Return this model with some fields replaced."""
        return replace(self, **changes)


def _angle(first, last):
    return abs(float(np.degrees(np.arctan(last) - np.arctan(first))))


def place(center):
    """Return where a point lies as seen from the left camera: '.21 m above'."""
    names = (('left of', 'right of'), ('above', 'below'), ('behind', 'in front of'))
    axis = int(np.argmax(np.abs(center)))
    return f'{short(abs(center[axis]), 2)} m {names[axis][int(center[axis] > 0)]}'


def short(value, digits):
    """Return a number with some digits after the point and no zero before it."""
    text = f'{value:.{digits}f}'
    return text[1:] if text.startswith('0.') else text
