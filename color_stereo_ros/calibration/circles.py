# SPDX-License-Identifier: Apache-2.0
"""The asymmetric grid of circles."""

import cv2
import numpy as np

from ..errors import CalibrationError
from .board_kind import BoardKind, Detection, Drawing

SIGMA = 0.1  # px, of OpenCV's centers; chosen until they are fitted


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
        found, centers = cv2.findCirclesGrid(gray, (board.columns, board.rows),
                                             flags=cv2.CALIB_CB_ASYMMETRIC_GRID)
        if not found:
            return None
        centers = centers.reshape(-1, 2).astype(np.float64)
        return Detection(np.arange(len(centers)), centers, np.full(len(centers), SIGMA))
