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
"""Corners of squares to a few hundredths of a pixel, with their standard deviations."""

import numpy as np

from .bending import bends
from .board_kind import Detection, LEAST_CORNERS
from .corner_kernels import BLUR_1, BLUR_2, COUNT, fit_corners, HEIGHT

REACH = 0.5          # squares, half width of the window; the next edges are a square away
LARGEST = 14         # px, half width of the window; beyond, edges are no circles any more
GUARD = 1.8          # px between the window and a marker: what a usual blur reaches; chosen
NO_MARKERS = 10.0    # squares; larger than any window
SMALLEST_SQUARE = 6.0  # px, along the shorter side; below, the next edges blur into the corner
LEAST_HEIGHT = 6.0   # DN, half of the difference between white and black
WORST_FIT = 0.25     # residuals as a share of the height; seen on good corners: up to .1
MOST_BLUR = 0.25     # of a square; a corner that is blurred more is none
FARTHEST = 0.3       # squares between the start and the corner
LEAST_RELATION = 0.05  # of independent noise; chosen, images with gamma reach .12
LEAST_SIGMA = 0.0007  # px, what a turned board shows without noise; evaluation.corners --limits


def detection(board, gray, ids, start, scale, gap=None):
    """
    Return the Detection of a board of squares, or None where too few corners are good.

    Parameters
    ----------
    board : Board
        The calibration board.
    gray : numpy.ndarray, uint8, shape (H, W)
        The image, gray.
    ids : numpy.ndarray, int64, shape (n,)
        Of the corners on the board.
    start, scale, gap
        See `refined`.

    """
    row, column = np.divmod(ids, board.columns - 1)
    good, pixels, sigma = refined(
        gray, start, scale, (row + column) % 2 == 0, gap,
        lambda known, found: bends((board.rows - 1, board.columns - 1), ids[known], found))
    if good.sum() < LEAST_CORNERS:
        return None
    return Detection(ids[good], pixels[good], sigma[good])


def refined(gray, start, scale, black, gap=None, bends_of=None):
    """
    Fit two crossing edges to every corner.

    Parameters
    ----------
    gray : numpy.ndarray, uint8, shape (H, W)
        The image, gray.
    start : numpy.ndarray, float64, shape (n, 2)
        Rough places, px.
    scale : numpy.ndarray, float64, shape (n, 2, 2)
        px per square: the columns are the sides of a square at the corner along x and y.
    black : numpy.ndarray, bool, shape (n,)
        Whether the square at larger x and larger y is black.
    gap : float, optional
        Distance from the edge of a white square to its marker, squares; None = no markers.
    bends_of : callable, optional
        Returns the curvatures of the edges, float64 (m, 2), 1 / px, at the m corners that an
        array bool (n,) names and whose places, float64 (m, 2), px, are given.

    Returns
    -------
    good : numpy.ndarray, bool, shape (n,)
        Whether there is such a corner.
    pixels : numpy.ndarray, float64, shape (n, 2)
        px; NaN where there is none.
    sigma : numpy.ndarray, float64, shape (n,)
        Standard deviation of either coordinate, px; NaN where there is none.

    """
    start = np.ascontiguousarray(start, np.float64)
    inverse = np.linalg.inv(scale)
    sign = np.where(black, 1.0, -1.0)
    found, bent = np.empty((len(start), COUNT + 4)), np.zeros((len(start), 2))
    for again in (False, True):  # in the second round, window and curvatures are right
        fit_corners(gray, start, inverse, sign, bent, REACH, NO_MARKERS if gap is None else gap,
                    GUARD, LARGEST, again, found)
        good = _good(found, start, scale, sign)
        start = np.where(good[:, None], found[:, :2], start)
        if bends_of and not again and good.any():
            bent[good] = bends_of(good, start[good])
    residual, seen, expected, unit = found[:, COUNT:].T
    good &= expected > 0  # NaN: the fit was singular
    pixels = np.where(good[:, None], found[:, :2], np.nan)
    variance = _relation(seen[good], (residual ** 2 * expected)[good]) * residual ** 2 * unit
    return good, pixels, np.where(good, np.sqrt(variance + LEAST_SIGMA ** 2), np.nan)


def _relation(seen, expected):
    """
    Return how much more neighbors say together than independent noise would.

    The mosaic and its conversion are those of all corners of an image, of which each alone knows
    its own to a third only.

    """
    relation = seen / expected
    relation = relation[np.isfinite(relation)]
    return max(float(np.mean(relation)), LEAST_RELATION) if relation.size else 1.0


def _good(found, start, scale, sign):
    """Return which fits show a corner where one was expected, bool (n,)."""
    side = np.linalg.norm(scale, axis=1)  # of both sides, px
    area = np.abs(np.linalg.det(scale))
    across = area / side.max(axis=1)
    height = found[:, HEIGHT] * sign
    with np.errstate(invalid='ignore'):
        moved = np.linalg.norm(found[:, :2] - start, axis=1)
        blur = np.exp(found[:, [BLUR_1, BLUR_2]]).max(axis=1)
        return ((across >= SMALLEST_SQUARE) & (height >= LEAST_HEIGHT)
                & (found[:, COUNT] <= WORST_FIT * height) & (blur <= MOST_BLUR * across)
                & (moved <= FARTHEST * across))
