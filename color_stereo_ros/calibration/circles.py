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
"""The asymmetric grid of circles."""

import cv2
import numpy as np

from .board_kind import BoardKind, Detection, Drawing
from ..errors import CalibrationError

SIGMA = 0.01   # px, of OpenCV's centers; evaluation.corners
SMALLEST = 20  # px^2, of a disk; chosen
FIT = 0.25     # of the distance of neighbors, from one homography; leaves room for distortion


class Circles(BoardKind):
    """Black disks; every second row is shifted. An image must show all of them."""

    summary = 'black disks, every second row shifted; both cameras must see the whole board'
    usual = 5, 11, 0.015
    marker_share = 0.8

    def check(self, board):
        """Refuse a grid that looks the same upside down, and disks that touch."""
        if board.rows % 2 == 0:
            raise CalibrationError(f'a grid of circles with {board.rows} rows looks the same '
                                   'upside down; take an odd number of rows')
        if not 0.3 * board.square_m <= board.marker_m <= 1.1 * board.square_m:
            raise CalibrationError(
                f'circles of {1e3 * board.marker_m:g} mm in rows that are '
                f'{1e3 * board.square_m:g} mm apart, expected {300 * board.square_m:g} .. '
                f'{1100 * board.square_m:g} mm')

    def corners(self, board):
        """Return the centers, float64 (N, 2), m."""
        row, column = np.indices((board.rows, board.columns))
        return np.column_stack([(1 + 2 * column + row % 2).ravel(),
                                (1 + row).ravel()]) * board.square_m

    def size(self, board):
        """Return width and height, m."""
        return (2 * board.columns + 1) * board.square_m, (board.rows + 1) * board.square_m

    def drawing(self, board):
        """Return the Drawing."""
        width, height = self.size(board)
        centers = self.corners(board)
        disks = np.column_stack([centers, np.full(len(centers), board.marker_m / 2)])
        return Drawing(np.array([0.0, width]), np.array([0.0, height]), np.zeros((1, 1), bool),
                       disks)

    def describe(self, board):
        """Return one line for people."""
        return (f'asymmetric circles, {board.columns} x {board.rows}, rows '
                f'{1e3 * board.square_m:g} mm apart, diameter {1e3 * board.marker_m:g} mm')

    def detect(self, board, gray):
        """Return the Detection in a uint8 image (H, W), or None."""
        found, centers = cv2.findCirclesGrid(
            gray, (board.columns, board.rows), flags=cv2.CALIB_CB_ASYMMETRIC_GRID,
            blobDetector=_blobs(gray, board))
        if not found:
            return None
        seen = centers.reshape(-1, 2).astype(np.float64)
        order, homography = _order(board.corners[:, :2], seen)
        if homography is None:
            return None
        seen = seen[order] - eccentricity(homography, board.corners[:, :2], board.marker_m / 2)
        return Detection(np.arange(len(seen)), seen, np.full(len(seen), SIGMA))


def _blobs(gray, board):
    """Return OpenCV's detector of disks that are as large as the grid allows."""
    parameters = cv2.SimpleBlobDetector_Params()
    parameters.minArea = SMALLEST
    parameters.maxArea = gray.size / (board.columns * board.rows)
    parameters.minDistBetweenBlobs = 4
    return cv2.SimpleBlobDetector_create(parameters)


def _order(points, seen):
    """
    Return the order that makes a grid of circles fit, and its homography from m to px.

    OpenCV may begin at either end. A mirrored grid fits no order; then the homography is None.

    """
    best = None
    for order in (np.arange(len(seen)), np.arange(len(seen))[::-1]):
        homography = cv2.findHomography(points, seen[order])[0]
        if homography is None or np.linalg.det(homography) < 0:
            continue
        error = np.abs(cv2.perspectiveTransform(points[None], homography)[0] - seen[order]).max()
        if best is None or error < best[0]:
            best = error, order, homography
    return best[1:] if best and best[0] < FIT * _spacing(seen) else (None, None)


def _spacing(seen):
    """Return the distance of the first two circles, px."""
    return np.linalg.norm(seen[1] - seen[0])


def eccentricity(homography, centers, radius):
    """
    Return how far the center of each ellipse lies from the image of the center of its circle.

    Parameters
    ----------
    homography : numpy.ndarray, float64, shape (3, 3)
        From m to px.
    centers : numpy.ndarray, float64, shape (n, 2)
        m.
    radius : float
        m.

    Returns
    -------
    shift : numpy.ndarray, float64, shape (n, 2)
        px (J. Heikkila and O. Silven, 1997, section 3).

    """
    back = np.linalg.inv(homography)
    shifts = []
    for x, y in centers:
        circle = np.array([[1, 0, -x], [0, 1, -y], [-x, -y, x * x + y * y - radius * radius]])
        ellipse = back.T @ circle @ back
        middle = np.linalg.solve(ellipse[:2, :2], -ellipse[:2, 2])
        place = homography @ (x, y, 1.0)
        shifts.append(middle - place[:2] / place[2])
    return np.array(shifts)
