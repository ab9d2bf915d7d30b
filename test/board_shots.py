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
"""A rig before a board, for the tests of `color_stereo calibrate`: calibration, poses, images."""

from functools import lru_cache

from color_stereo_ros.calibration.boards import Board
from color_stereo_ros.core import StereoCalibration
from color_stereo_ros.sim.boards import board_pair
from color_stereo_ros.sim.geometry import Pose

import cv2

import numpy as np

SIZE = WIDTH, HEIGHT = 640, 480
BASELINE = 0.2
BOARD = Board('chessboard', 9, 6, 0.025)
TILTS = ((40, 0), (-40, 0), (0, 40), (0, -40), (30, 30), (-30, 30), (30, -30), (-30, -30),
         (45, 10), (10, 45), (-10, -45), (-45, -10))
"""degrees, about the axes x and y of the image."""


def rig():
    """Return a pair that converges by 15 degrees, with distortion, as CALIBRATION.md has it."""
    camera = np.array([[640.0, 0, 319.5], [0, 640.0, 239.5], [0, 0, 1]])
    turn = cv2.Rodrigues(np.radians([0.0, 15.0, 0.0]))[0]
    center = np.array([BASELINE, 0.0, 0.0])
    return StereoCalibration.from_arrays(
        SIZE, camera, (-0.08, 0.02, 0.0005, -0.0003, 0.0), camera * [[1.01], [1.01], [1]],
        (-0.07, 0.015, -0.0004, 0.0004, 0.0), turn, -turn @ center)


def pose(index, distance=0.45, board=BOARD):
    """Return a pose before both cameras: camera frame of the left one from board frame."""
    rng = np.random.default_rng([7, index])
    tilt_x, tilt_y = np.radians(TILTS[index % len(TILTS)])
    rotation = (cv2.Rodrigues(np.array([0, tilt_y, 0.0]))[0]
                @ cv2.Rodrigues(np.array([tilt_x, 0, 0.0]))[0]
                @ cv2.Rodrigues(np.array([0, 0, rng.uniform(-0.3, 0.3)]))[0])
    middle = np.array([rng.uniform(-0.02, 0.1), rng.uniform(-0.08, 0.08),
                       distance + rng.uniform(-0.05, 0.05)])
    return Pose(rotation, middle - rotation @ np.append(np.divide(board.size_m, 2), 0))


@lru_cache(maxsize=64)
def images(index, distance=0.45, board=BOARD):
    """Return the pair of images of a pose, uint8 (H, W, 3)."""
    return tuple(view.image for view in board_pair(rig(), board, pose(index, distance, board),
                                                   seed=index))
