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
The drift of a calibration as a value: what may change between two cameras in the field.

Six numbers, in this order. Rotations are those of the right camera about its own center, in the
axes of the physical right camera: a point X of the calibrated right camera is W X in the true one,
with W = exp([w]x) and w = (pitch, yaw, roll).

    pitch, yaw, roll      rad, turn about x, y and z
    focal                 relative change of the focal length of the right against the left camera
    baseline y, z         rad, direction of the baseline in the rectified frame: (1, y, z)

The length of the baseline is not among them: no pair of images shows it. Nor is there a turn of
the left camera: only the motion between the cameras shows.

"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from .tuning import TUNING
from ..cameras.calibration import StereoCalibration
from ..cameras.lenses import LENSES

NAMES = 'pitch', 'yaw', 'roll', 'focal', 'baseline y', 'baseline z'
COUNT = len(NAMES)
PERCENT = 100
UNITS = 'degrees', 'degrees', 'degrees', '%', 'degrees', 'degrees'
SHOWN = np.array([np.degrees(1.0)] * 3 + [PERCENT] + [np.degrees(1.0)] * 2)
"""Factors from the numbers of a drift to `UNITS`."""


@dataclass(frozen=True, eq=False)
class PhysicalRight:
    """The right camera as rays need it; rectified images have the lens of their P."""

    K: np.ndarray
    """float64 (3, 3), px."""
    D: np.ndarray
    """float64 (n,)."""
    R: np.ndarray
    """float64 (3, 3), from physical to rectified coordinates."""
    lens: object
    """One of `LENSES`."""

    @classmethod
    def of(cls, calibration, rectified_input=False):
        """Return that of a StereoCalibration; rectified_input: its images have no other lens."""
        camera = calibration.right
        if rectified_input:
            return cls(camera.P[:, :3], np.zeros(0), np.eye(3), LENSES['plumb_bob'])
        return cls(camera.K, camera.D, camera.R, LENSES[camera.distortion_model])

    def raw(self, rays):
        """Return the raw pixels of rectified rays (N, 2), X/Z and Y/Z, float64 (N, 2)."""
        physical = np.column_stack([rays, np.ones(len(rays))]) @ self.R
        normal = self.lens.distort(physical[:, :2] / physical[:, 2:], self.D)
        return normal @ self.K[:2, :2].T + self.K[:2, 2]

    def rays(self, raw, focal=0.0):
        """Return X, Y and 1 of raw pixels after a change of the focal length, float64 (N, 3)."""
        K = self.K.copy()
        K[:2, :2] *= 1 + focal
        return np.column_stack([self.lens.undistort(raw, K, self.D), np.ones(len(raw))])


def turn(drift):
    """Return W of the module's text, float64 (3, 3), of a drift (6,)."""
    return cv2.Rodrigues(np.asarray(drift, np.float64)[:3])[0]


def seen(drift, camera, raw):
    """
    Return where a right camera that has drifted sees raw pixels, and the derivatives.

    Parameters
    ----------
    drift : numpy.ndarray, float64, shape (6,)
        See `drift.NAMES`.
    camera : PhysicalRight
        As calibrated.
    raw : numpy.ndarray, float64, shape (N, 2)
        px.

    Returns
    -------
    rays : numpy.ndarray, float64, shape (N, 2)
        X/Z and Y/Z in the rectified right camera of the calibration.
    by_drift : numpy.ndarray, float64, shape (N, 2, 4)
        By pitch, yaw, roll and focal.

    """
    step = TUNING.estimate.focal_step
    to_rectified = camera.R @ turn(drift).T
    rays = camera.rays(raw, drift[3])
    other = camera.rays(raw, drift[3] + step)
    moved = np.empty((len(raw), 3, 4))
    # W' = exp([a]x) W turns W^T q by -W^T (a x q) = W^T (q x a)
    for axis in range(3):
        moved[:, :, axis] = np.cross(rays, np.eye(3)[axis])
    moved[:, :, 3] = (other - rays) / step
    points = rays @ to_rectified.T
    moved = np.einsum('ij,njk->nik', to_rectified, moved)
    ahead = points[:, 2:]
    place = points[:, :2] / ahead
    by_drift = (moved[:, :2] - place[:, :, None] * moved[:, 2:]) / ahead[:, :, None]
    return place, by_drift


def row_errors(drift, camera, raw, left, focal):
    """
    Return how far right pixels lie below their epipolar lines, and the derivatives.

    Parameters
    ----------
    drift : numpy.ndarray, float64, shape (6,)
        See `drift.NAMES`.
    camera : PhysicalRight
        The right camera as it is mounted.
    raw : numpy.ndarray, float64, shape (N, 2)
        Raw right pixels, px.
    left : numpy.ndarray, float64, shape (N, 2)
        X/Z and Y/Z of the same points in the rectified left camera.
    focal : float
        Of the rectified cameras along y, px.

    Returns
    -------
    error : numpy.ndarray, float64, shape (N,)
        px; 0 where the drift is the true one.
    by_drift : numpy.ndarray, float64, shape (N, 6)
        px per unit.

    """
    place, by = seen(drift, camera, raw)
    (x, y), (u, v) = place.T, left.T
    b, c = drift[4:]
    # (1, b, c) x (u, v, 1) . (x, y, 1), with its sign so that it grows with y
    error = (y - v) - b * (x - u) - c * (u * y - v * x)
    by_drift = np.empty((len(raw), COUNT))
    by_drift[:, :4] = (1 - c * u)[:, None] * by[:, 1] + (c * v - b)[:, None] * by[:, 0]
    by_drift[:, 4], by_drift[:, 5] = u - x, v * x - u * y
    return focal * error, focal * by_drift


def expected_fields(calibration, x, y, disparity, rectified_input=False):
    """
    Return what a small drift does to a pair that is rectified as calibrated.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    x, y : numpy.ndarray, float64, shape (N,)
        Column and row in the rectified left image, px.
    disparity : numpy.ndarray, float64, shape (N,)
        px.
    rectified_input : bool
        The images arrive rectified already.

    Returns
    -------
    rows, disparities : numpy.ndarray, float64, shape (N, 6)
        Row in the right image minus row in the left one, and disparity: px per unit of the drift.

    """
    geometry, camera = calibration.geometry, PhysicalRight.of(calibration, rectified_input)
    u = (x - geometry.center_x_left) / geometry.focal_x
    v = (y - geometry.center_y) / geometry.focal_y
    place = np.column_stack([(x - disparity - geometry.center_x_right) / geometry.focal_x, v])
    # what the true camera shows moves against what the correction does: the sign turns
    by = -seen(np.zeros(COUNT), camera, camera.raw(place))[1]
    shift = u - place[:, 0]
    rows = np.column_stack([by[:, 1], -shift, v * shift])
    columns = np.column_stack([by[:, 0], np.zeros_like(u), place[:, 0] * shift])
    return geometry.focal_y * rows, -geometry.focal_x * columns


def corrected(calibration, drift, baseline=True):
    """
    Return the calibration of a pair that has drifted.

    Both P, and so size and view of the rectified images, stay.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    drift : array-like, shape (6,)
        See `drift.NAMES`.
    baseline : bool
        Turn both rectified cameras so that x lies along the baseline. False: the rectified left
        camera, the frame of all results, stays as it is; the direction of the baseline is not
        corrected.

    Returns
    -------
    corrected : StereoCalibration
        With the same length of the baseline.

    Raises
    ------
    CalibrationError
        If raw images cannot be rectified with the calibration.

    """
    calibration.check_raw()
    drift = np.asarray(drift, np.float64)
    along = aligned_axes(drift) if baseline else np.eye(3)
    left, right = calibration.left, calibration.right
    K = right.K.copy()
    K[:2, :2] *= 1 + drift[3]
    return StereoCalibration(
        replace(left, R=along @ left.R),
        replace(right, K=K, R=along @ right.R @ turn(drift).T))


def aligned_axes(drift):
    """Return the rotation (3, 3) from the rectified frame to one with x along the baseline."""
    x = np.array([1.0, drift[4], drift[5]])
    x /= np.linalg.norm(x)
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])
