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
Calibration boards: their corners, their drawing, and where an image shows them.

The frame of a board: x right, y down, z away from the viewer, m; the origin is the top left
corner of the outline of its squares.

"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from . import charuco, chessboard, circles
from .board_kind import BoardKind, Detection, Drawing
from ..core.registry import Registry
from ..errors import CalibrationError, ImageError

__all__ = ['Board', 'BOARDS', 'BoardKind', 'Detection', 'Drawing', 'default_kind']

BOARDS = Registry('kind of board', BoardKind, {
    'charuco': charuco.Charuco(),
    'chessboard': chessboard.Chessboard(),
    'circles': circles.Circles(),
})
"""BoardKind by name; their order is that of all lists."""

LARGEST = 200  # squares along a side; chosen: more than any printed board has
SMALLEST_SQUARE, LARGEST_SQUARE = 1e-4, 1.0  # m; chosen, so that a size in mm is refused


def default_kind():
    """Return 'charuco' where OpenCV has `cv2.aruco`, otherwise 'chessboard'."""
    return 'charuco' if charuco.is_available() else 'chessboard'


@dataclass(frozen=True)
class Board:
    """
    A flat calibration board.

    Raises
    ------
    CalibrationError
        If the board cannot be made or cannot be told from its own image upside down.
    InstallationError
        If the kind is 'charuco' and OpenCV has no `cv2.aruco`.

    """

    kind: str = field(default_factory=default_kind)
    """Name in BOARDS."""
    columns: int = 11
    """Squares along x, inner corners plus one; circles in a row of a grid of circles."""
    rows: int = 8
    """Squares along y; rows of a grid of circles."""
    square_m: float = 0.02
    """
    Side of a square, m; in a grid of circles the distance from row to row. Neighbors in a row of
    circles are two of these apart.
    """
    marker_m: float = 0.0
    """Side of a ChArUco marker or diameter of a circle, m; 0 = the usual share of `square_m`."""
    dictionary: str = '4X4_250'
    """Of the ChArUco markers, OpenCV's name without DICT_."""

    def __post_init__(self):
        """Check the fields and fill in the size of the markers."""
        kind = BOARDS[self.kind]
        for name in ('columns', 'rows'):
            value = getattr(self, name)
            if not isinstance(value, (int, np.integer)) or not 2 <= value <= LARGEST:
                raise CalibrationError(f'{name} = {value!r} of a board, expected a whole number '
                                       f'2 .. {LARGEST}')
        if not SMALLEST_SQUARE <= self.square_m <= LARGEST_SQUARE:
            raise CalibrationError(f'square of a board = {self.square_m!r} m, expected '
                                   f'{SMALLEST_SQUARE} .. {LARGEST_SQUARE} m')
        if not self.marker_m:
            object.__setattr__(self, 'marker_m', kind.marker_share * self.square_m)
        kind.check(self)

    @cached_property
    def corners(self):
        """
        Return the points that `detect` finds, float64 (N, 3), m, z = 0; row i has id i.

        These are the inner corners of the squares, row by row, or the centers of the circles.

        """
        points = BOARDS[self.kind].corners(self)
        return np.column_stack([points, np.zeros(len(points))])

    @cached_property
    def ids(self):
        """Return the ids of all corners, int64 (N,)."""
        return np.arange(len(self.corners))

    @classmethod
    def usual(cls, kind=None):
        """Return the usual board of a kind, which fits A4; None = `default_kind()`."""
        kind = default_kind() if kind is None else kind
        return cls(kind, *BOARDS[kind].usual)

    @property
    def size_m(self):
        """Return width and height of the outline of the squares, m, without the white border."""
        return BOARDS[self.kind].size(self)

    @cached_property
    def drawing(self):
        """Return what is black, a Drawing."""
        return BOARDS[self.kind].drawing(self)

    def describe(self):
        """Return one line for people: kind, numbers and sizes in mm."""
        return BOARDS[self.kind].describe(self)

    def detect(self, gray):
        """
        Find the board.

        Parameters
        ----------
        gray : numpy.ndarray, uint8, shape (H, W)
            The image, gray.

        Returns
        -------
        detection : Detection or None
            None where the board is not found.

        Raises
        ------
        ImageError
            If the image has another type or shape.

        """
        if not isinstance(gray, np.ndarray) or gray.dtype != np.uint8 or gray.ndim != 2:
            raise ImageError('an image of a board is '
                             f'{getattr(gray, "dtype", type(gray).__name__)} of shape '
                             f'{getattr(gray, "shape", None)}, expected uint8 (H, W)')
        return BOARDS[self.kind].detect(self, np.ascontiguousarray(gray))
