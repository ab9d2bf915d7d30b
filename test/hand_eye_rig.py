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
"""A robot with a camera and a board: poses and corners with known truth and noise."""

from dataclasses import dataclass

from color_stereo_ros.calibration.board_pose import board_pose, project, Seen
from color_stereo_ros.calibration.hand_eye import IN_HAND, Poses
from color_stereo_ros.calibration.rigid import exp, inverse, product
from color_stereo_ros.core import StereoCalibration
import cv2
import numpy as np

SIZE = 640, 480
BAR_NOISE = 1e-4, np.radians(0.05)
"""Of the issue's bar: m, rad."""
CORNER = 0.05  # px


@dataclass(frozen=True, eq=False)
class Truth:
    """Where camera and board are."""

    camera: tuple
    board: tuple


def rig():
    """Return two converging cameras with distortion, 0.2 m apart."""
    K = [[640, 0, 321.0], [0, 642, 238.0], [0, 0, 1]]
    D = [-0.05, 0.02, 0.0005, -0.0003, 0.0]
    R = exp([0, np.radians(15), 0])
    return StereoCalibration.from_arrays(SIZE, K, D, K, D, R, [-0.2, 0.004, 0.026])


def corners(columns=9, rows=6, square=0.02):
    """Return the corners of a board about its middle, (n, 3), m."""
    y, x = np.mgrid[:rows, :columns]
    return np.stack([(x - (columns - 1) / 2) * square, (y - (rows - 1) / 2) * square,
                     0 * x], axis=-1).reshape(-1, 3).astype(float)


def views(count, rng, tilt=25.0):
    """Return poses of the board in the camera, (R, t): before it, tilted, turned."""
    turn = np.radians(rng.uniform(-tilt, tilt, (count, 3)) * [1, 1, 2])
    place = rng.uniform([-0.01, -0.05, 0.33], [0.07, 0.05, 0.45], (count, 3))
    return exp(turn), place


def session(seed, count=12, mounting=IN_HAND, noise=BAR_NOISE, corner=CORNER, tilt=25.0,
            scale=1.0, sides=2):
    """
    Return Poses with noise, and the Truth.

    The corners of every view are photographed by both cameras, with noise, and give the poses of
    the board.

    """
    rng = np.random.default_rng(seed)
    calibration, board = rig(), corners()
    camera = exp(rng.normal(0, 1, 3)), rng.uniform(-0.1, 0.1, 3)
    place = exp(rng.normal(0, 1, 3)), rng.uniform(-0.8, 0.8, 3)
    seen = views(count, rng, tilt)
    flange = product(place, inverse(product(camera, seen)))
    if mounting != IN_HAND:
        flange = inverse(flange)
    flange = (flange[0] @ exp(rng.normal(0, noise[1], (count, 3))),
              flange[1] + rng.normal(0, noise[0], (count, 3)))
    found = [photographed(calibration, board, (R, t), rng, corner, scale, sides)
             for R, t in zip(*seen)]
    return Poses(tuple(f'view_{k:02d}' for k in range(count)), flange,
                 (np.array([pose.rotation for pose in found]),
                  np.array([pose.translation for pose in found])),
                 np.array([pose.covariance for pose in found])), Truth(camera, place)


def photographed(calibration, board, pose, rng, corner=CORNER, scale=1.0, count=2):
    """Return the BoardPose of noisy corners; the board is larger by scale than it says."""
    points = scale * board @ pose[0].T + pose[1]
    R, t = calibration.right_from_left
    sides = [project(calibration.left, points),
             project(calibration.right, points @ R.T + t)][:count]
    return board_pose(calibration, *(
        Seen(board, pixels + rng.normal(0, max(corner, 1e-12), pixels.shape),
             np.full(len(board), max(corner, 1e-3))) for pixels in sides))


def straight_rig():
    """Return two parallel cameras without distortion, 0.1 m apart."""
    K = [[640, 0, 319.5], [0, 640, 239.5], [0, 0, 1]]
    return StereoCalibration.from_arrays(SIZE, K, [], K, [], np.eye(3), [-0.1, 0, 0])


def photographs(calibration, board, pose, fine=3, texel=4e-4):
    """Return both images, uint8 (H, W, 3), of a chessboard; cameras without distortion."""
    border = 2 * board.square_m
    width, height = np.rint((np.array(board.size_m) + 2 * border) / texel).astype(int)
    x, y = ((np.arange(count) + 0.5) * texel - border for count in (width, height))
    dark = (np.floor(y / board.square_m)[:, None] + np.floor(x / board.square_m)) % 2 == 0
    inside = (((y >= 0) & (y < board.size_m[1]))[:, None]
              & ((x >= 0) & (x < board.size_m[0])))
    drawn = np.where(dark & inside, 30, 220).astype(np.uint8)
    from_texel = np.array([[texel, 0, texel / 2 - border], [0, texel, texel / 2 - border],
                           [0, 0, 1]])
    finer = np.array([[fine, 0, (fine - 1) / 2], [0, fine, (fine - 1) / 2], [0, 0, 1]])
    images = []
    R_right, t_right = calibration.right_from_left
    for camera, (R, t) in ((calibration.left, pose),
                           (calibration.right, (R_right @ pose[0], R_right @ pose[1] + t_right))):
        homography = finer @ camera.K @ np.column_stack([R[:, 0], R[:, 1], t]) @ from_texel
        size = fine * camera.width, fine * camera.height
        seen = cv2.warpPerspective(drawn, homography, size, flags=cv2.INTER_LINEAR,
                                   borderValue=120)
        gray = cv2.resize(seen, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        images.append(np.repeat(gray[..., None], 3, axis=2))
    return images
