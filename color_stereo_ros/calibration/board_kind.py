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
"""What every kind of board knows of itself, and what it gives back."""

from dataclasses import dataclass, field

import numpy as np

LEAST_CORNERS = 6  # of a detection; chosen: four fix a homography, two more show a wrong one


@dataclass(frozen=True, eq=False)
class Detection:
    """The corners of a board that an image shows."""

    ids: np.ndarray
    """int64 (n,), rows of `Board.corners`, increasing."""
    pixels: np.ndarray
    """float64 (n, 2), column and row, px; (0, 0) is the center of the top left pixel."""
    sigma: np.ndarray
    """float64 (n,), standard deviation of either coordinate, px."""

    def __len__(self):
        """Return the number of corners."""
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class Drawing:
    """
    What is black on a board: fields of an uneven grid, and disks.

    Field (i, j) reaches from x[j] to x[j + 1] and from y[i] to y[i + 1].

    """

    x: np.ndarray
    """float64 (C + 1,), m, increasing."""
    y: np.ndarray
    """float64 (R + 1,), m, increasing."""
    dark: np.ndarray
    """bool (R, C)."""
    disks: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    """float64 (N, 3): center x, y and radius, m."""

    def rectangles(self):
        """
        Return the black rectangles: x, y, width, height, m, float64 (N, 4).

        Neighbors in a row are joined, so that a printer leaves no hairline between them.

        """
        found = []
        for row, (top, bottom) in zip(self.dark, zip(self.y[:-1], self.y[1:])):
            steps = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
            for first, end in zip(steps[::2], steps[1::2]):
                found.append((self.x[first], top, self.x[end] - self.x[first], bottom - top))
        return np.array(found, np.float64).reshape(-1, 4)


class BoardKind:
    """Base of the kinds of board; an entry of `boards.BOARDS` is an instance of a subclass."""

    summary = ''
    """One line for lists."""
    usual = 11, 8, 0.02
    """Columns, rows and `square_m` (m) of a board that fits A4."""
    marker_share = 1.0
    """Default of `Board.marker_m`, as a share of `Board.square_m`."""

    def check(self, board):
        """Raise CalibrationError where such a board is of no use."""

    def corners(self, board):
        """Return the points that an image can show, float64 (N, 2), m."""
        return inner_corners(board)

    def size(self, board):
        """Return width and height, m."""
        return board.columns * board.square_m, board.rows * board.square_m

    def drawing(self, board):
        """Return the Drawing."""
        raise NotImplementedError

    def describe(self, board):
        """Return one line for people."""
        raise NotImplementedError

    def detect(self, board, gray):
        """Return the Detection in a uint8 image (H, W), or None."""
        raise NotImplementedError


def inner_corners(board):
    """Return the inner corners of the squares, float64 (N, 2), m, row by row."""
    row, column = np.indices((board.rows - 1, board.columns - 1)) + 1.0
    return np.column_stack([column.ravel(), row.ravel()]) * board.square_m


def squares(board):
    """Return which squares are black, bool (rows, columns); the top left one is."""
    return np.indices((board.rows, board.columns)).sum(axis=0) % 2 == 0
