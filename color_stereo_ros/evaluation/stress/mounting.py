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
A right camera that is not where its calibration says, or has another lens.

The camera turns about its own center, so that what it sees is the calibrated view resampled. No
surface appears or vanishes behind another one, and the truth stays exact.

"""

from dataclasses import dataclass, fields

import cv2
import numpy as np

from .warp_kernels import bicubic
from ...core.cameras.lenses import LENSES


@dataclass(frozen=True)
class Mounting:
    """How the true right camera differs from the calibrated one."""

    rows: float = 0.0
    """How much lower the image lies, px of the raw image."""
    columns: float = 0.0
    """How much farther to the right the image lies, px of the raw image."""
    roll: float = 0.0
    """Turn about the optical axis, degrees, right-handed: from x (right) to y (down)."""
    pitch: float = 0.0
    """Turn about x, degrees."""
    yaw: float = 0.0
    """Turn about y, degrees."""
    focal: float = 0.0
    """Focal length, relative change."""
    k1: float = 0.0
    """First radial coefficient, added."""

    @property
    def exact(self):
        """Tell whether the camera is as calibrated."""
        return not any(getattr(self, spec.name) for spec in fields(self))

    @property
    def rotation(self):
        """Return true-from-calibrated camera coordinates, float64 (3, 3)."""
        return cv2.Rodrigues(np.radians([self.pitch, self.yaw, self.roll]))[0]

    def lens_of(self, camera):
        """Return K (3, 3) and D of the true camera, px."""
        K = camera.K.copy()
        K[:2, :2] *= 1 + self.focal
        K[:2, 2] += self.columns, self.rows
        lengths = LENSES[camera.distortion_model].lengths
        D = np.zeros(min(n for n in lengths if n >= max(1, len(camera.D))))
        D[:len(camera.D)] = camera.D
        D[0] += self.k1
        return K, D

    def true_pixels(self, points, camera):
        """
        Return where the true camera sees what lies behind rectified pixels.

        Parameters
        ----------
        points : numpy.ndarray, float64, shape (N, 2)
            Columns and rows of the rectified calibrated camera, px.
        camera : color_stereo_ros.core.CameraModel
            As calibrated.

        Returns
        -------
        raw : numpy.ndarray, float64, shape (N, 2)
            Pixels of the true raw image.
        rectified : numpy.ndarray, float64, shape (N, 2)
            Where the given calibration puts these pixels.

        """
        rays = _mapped(points, np.linalg.inv(camera.P[:, :3] @ camera.R))
        lens = LENSES[camera.distortion_model]
        raw = _projected(_mapped(rays, self.rotation), *self.lens_of(camera), lens)
        if self.exact:
            return raw, points
        back = lens.undistort(raw, camera.K, camera.D)
        return raw, _mapped(back, camera.P[:, :3] @ camera.R)

    def calibrated_pixels(self, raw, camera):
        """
        Return where the calibrated camera would see what the true one sees at raw pixels.

        Parameters
        ----------
        raw : numpy.ndarray, float64, shape (N, 2)
            Column and row in the raw image.
        camera : color_stereo_ros.core.CameraModel
            One camera of the pair.

        Returns
        -------
        pixels : numpy.ndarray, float64, shape (N, 2)
            Raw pixels of the calibrated camera.

        """
        lens = LENSES[camera.distortion_model]
        rays = lens.undistort(np.ascontiguousarray(raw), *self.lens_of(camera))
        return _projected(_mapped(rays, self.rotation.T), camera.K, camera.D, lens)

    def view(self, light, camera, scale, margin):
        """
        Return what the true camera sees.

        Parameters
        ----------
        light : numpy.ndarray, float32, shape (scale (H + 2 margin), scale (W + 2 margin), 3)
            What the calibrated camera sees, finer and beyond its border.
        camera : color_stereo_ros.core.CameraModel
            One camera of the pair.
        scale : int
            Fine pixels in each pixel along either axis.
        margin : int
            Pixels beyond the border.

        Returns
        -------
        view : numpy.ndarray, float32, shape (H, W, 3)
            Each pixel is the mean of its fine pixels; 0 beyond the margin.

        """
        height, width = camera.height * scale, camera.width * scale
        start = scale * margin
        fine = light[start:start + height, start:start + width]
        if not self.exact:
            row, column = np.indices((height, width), np.float64)
            raw = np.column_stack([column.ravel(), row.ravel()])
            raw = (raw + 0.5) / scale - 0.5
            places = (self.calibrated_pixels(raw, camera) + margin + 0.5) * scale - 0.5
            fine = bicubic(np.ascontiguousarray(light), places[:, 0].copy(), places[:, 1].copy(),
                           np.empty((len(places), 3), np.float32)).reshape(height, width, 3)
        return cv2.resize(fine, (camera.width, camera.height), interpolation=cv2.INTER_AREA)


def _mapped(points, matrix):
    """Return homogeneous points (N, 2) after a 3 x 3 map."""
    mapped = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return mapped[:, :2] / mapped[:, 2:]


def _projected(rays, K, D, lens):
    return lens.distort(rays, D) @ K[:2, :2].T + K[:2, 2]
