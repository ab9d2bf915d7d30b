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
"""The chessboard, by OpenCV's detector of 2018 (`findChessboardCornersSB`)."""

import cv2
import numpy as np

from .board_kind import BoardKind, Drawing, squares
from .corners import detection
from ..errors import CalibrationError

# None of OpenCV's ways finds all boards; the quick ones come first. The fit checks every corner.
FINDERS = (
    (cv2.findChessboardCornersSB, 0),
    (cv2.findChessboardCorners, cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
     | cv2.CALIB_CB_FAST_CHECK),
    (cv2.findChessboardCornersSB, cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE))


class Chessboard(BoardKind):
    """Black and white squares; an image must show all of them."""

    summary = 'black and white squares; both cameras must see the whole board'

    def check(self, board):
        """Refuse a board that looks the same upside down."""
        if (board.columns + board.rows) % 2 == 0:
            raise CalibrationError(
                f'a chessboard of {board.columns} x {board.rows} squares looks the same upside '
                'down, so that its corners could be exchanged; take an even number of squares '
                f'along one side and an odd number along the other, for example '
                f'{board.columns} x {board.rows + 1}')
        if min(board.columns, board.rows) < 4:
            raise CalibrationError(f'a chessboard of {board.columns} x {board.rows} squares is '
                                   'not found reliably; take at least 4 along each side')

    def drawing(self, board):
        """Return the Drawing."""
        return Drawing(np.arange(board.columns + 1) * board.square_m,
                       np.arange(board.rows + 1) * board.square_m, squares(board))

    def describe(self, board):
        """Return one line for people."""
        return (f'chessboard, {board.columns} x {board.rows} squares of '
                f'{1e3 * board.square_m:g} mm ({board.columns - 1} x {board.rows - 1} inner '
                'corners)')

    def detect(self, board, gray):
        """Return the Detection in a uint8 image (H, W), or None."""
        pixels = locate(board, gray)
        if pixels is None:
            return None
        grid = pixels.reshape(board.rows - 1, board.columns - 1, 2)
        scale = np.stack([np.gradient(grid, axis=1).reshape(-1, 2),
                          np.gradient(grid, axis=0).reshape(-1, 2)], axis=2)
        return detection(board, gray, np.arange(len(pixels)), pixels, scale)


def locate(board, gray):
    """Return the pixels of all inner corners, float64 (N, 2), by id, or None."""
    shape = board.columns - 1, board.rows - 1
    for find, flags in FINDERS:
        found, pixels = find(gray, shape, flags=flags)
        if found:
            return oriented(pixels.reshape(shape[1], shape[0], 2).astype(np.float64), gray)
    return None


def oriented(grid, gray):
    """
    Put detected corners into the order of the ids.

    OpenCV begins at any of the four outer corners. The board is seen from the front, thus x to y
    turns clockwise in the image; and its top left square is black.

    Parameters
    ----------
    grid : numpy.ndarray, float64, shape (R, C, 2)
        Pixels of the inner corners.
    gray : numpy.ndarray, uint8, shape (H, W)
        The image, gray.

    Returns
    -------
    pixels : numpy.ndarray, float64, shape (R * C, 2)

    """
    along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * down[1] - along[1] * down[0] < 0:
        grid = grid[::-1]
    centers = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4
    column, row = np.round(centers).astype(int).reshape(-1, 2).T
    values = gray[np.clip(row, 0, gray.shape[0] - 1), np.clip(column, 0, gray.shape[1] - 1)]
    # The first square inside the corners is the second one along both axes: black as well.
    black = np.indices(centers.shape[:2]).sum(axis=0).ravel() % 2 == 0
    if values[black].mean() > values[~black].mean():
        grid = grid[::-1, ::-1]
    return grid.reshape(-1, 2)
