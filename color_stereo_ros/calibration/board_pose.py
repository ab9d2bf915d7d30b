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
"""The pose of a board before a calibrated pair, from corners in one camera or in both."""

from dataclasses import dataclass

import cv2
import numpy as np

from .rigid import moved
from ..core.cameras.lenses import LENSES
from ..errors import CalibrationError

LEAST = 4  # corners; derived: four points of a plane give its pose
ROUNDS = 30  # of Gauss and Newton, at most; chosen: five suffice from a good start
STEP = 1e-6  # rad and m; chosen: well above the rounding, well below the curvature
DONE = 1e-10  # rad and m


@dataclass(frozen=True, eq=False)
class Seen:
    """The corners of a board that one camera sees."""

    corners: np.ndarray
    """float64 (n, 3), m, places on the board."""
    pixels: np.ndarray
    """float64 (n, 2), px, places in the raw image."""
    sigma: np.ndarray
    """float64 (n,), px, standard deviation of each coordinate."""


@dataclass(frozen=True, eq=False)
class BoardPose:
    """Where a board is, in the frame of the physical left camera."""

    rotation: np.ndarray
    """float64 (3, 3): X_camera = rotation X_board + translation."""
    translation: np.ndarray
    """float64 (3,), m."""
    covariance: np.ndarray
    """float64 (6, 6) of (w, d): exp(w) rotation and translation + d; rad and m."""
    rms: float
    """Root mean square distance of the corners from their predicted places, px."""


def board_pose(calibration, left=None, right=None):
    """
    Return the pose of a board.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    left, right : Seen or None
        What each camera sees; one of them suffices.

    Returns
    -------
    pose : BoardPose

    Raises
    ------
    CalibrationError
        If no camera sees four corners, or the corners do not fit a plane that is seen from
        the front.

    """
    views = [(camera, seen, motion) for camera, seen, motion in (
        (calibration.left, left, (np.eye(3), np.zeros(3))),
        (calibration.right, right, calibration.right_from_left))
        if seen is not None and len(seen.corners) >= LEAST]
    if not views:
        raise CalibrationError(f'no camera sees {LEAST} corners of the board or more')
    solved = [_refined(views, start) for start in _starts(*views[0])]
    if not solved:
        raise CalibrationError('the corners do not fit a plane before the camera')
    return min(solved, key=lambda pose: pose.rms)


def project(camera, points):
    """Return the raw pixels (n, 2) of points (n, 3) in the frame of a camera."""
    rays = points[:, :2] / points[:, 2:]
    distorted = LENSES[camera.distortion_model].distort(rays, camera.D)
    return distorted @ camera.K[:2, :2].T + camera.K[:2, 2]


def _starts(camera, seen, motion):
    """Return the two poses of a plane that one view allows, in the left camera."""
    rays = LENSES[camera.distortion_model].undistort(seen.pixels, camera.K, camera.D)
    found = cv2.solvePnPGeneric(seen.corners, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    back = motion[0].T
    return [(back @ cv2.Rodrigues(turn)[0], back @ (shift.ravel() - motion[1]))
            for turn, shift in zip(found[1], found[2]) if np.isfinite(shift).all()]


def _refined(views, pose):
    """Return the BoardPose with the least weighted squares near a pose."""
    for _ in range(ROUNDS):
        residuals, jacobian = _linearized(views, pose)
        step = np.linalg.lstsq(jacobian, -residuals, rcond=None)[0]
        step *= min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))  # half a radian, half a meter
        pose = moved(pose, step)
        if np.abs(step).max() < DONE:
            break
    residuals, jacobian = _linearized(views, pose)
    covariance = np.linalg.pinv(jacobian.T @ jacobian)
    free = len(residuals) - 6
    if free > 0:  # corners that fit worse than they say are not as exact as they say
        covariance = covariance * max(1.0, residuals @ residuals / free)
    sigma = np.concatenate([seen.sigma for _, seen, _ in views])
    distances = residuals.reshape(-1, 2) * sigma[:, None]
    return BoardPose(*pose, covariance, float(np.sqrt(np.mean(np.sum(distances ** 2, axis=1)))))


def _linearized(views, pose):
    """Return residuals (2 n,) over their standard deviation, and their Jacobian (2 n, 6)."""
    steps = STEP * np.concatenate([np.zeros((1, 6)), np.eye(6), -np.eye(6)])
    found = _residuals(views, moved(pose, steps))
    return found[0], (found[1:7] - found[7:]).T / (2 * STEP)


def _residuals(views, poses):
    """Return the residuals (k, 2 n) of k poses."""
    found = []
    for camera, seen, (R, t) in views:
        points = np.einsum('kij,nj->kni', poses[0], seen.corners) + poses[1][:, None]
        points = points @ R.T + t
        points[..., 2] = np.maximum(points[..., 2], 1e-3)  # behind the camera nothing is seen
        pixels = project(camera, points.reshape(-1, 3)).reshape(*points.shape[:2], 2)
        found.append(((pixels - seen.pixels) / seen.sigma[:, None]).reshape(len(points), -1))
    return np.concatenate(found, axis=1)
