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

from .bending import shifts
from .board_kind import Detection, LEAST_CORNERS
from .corner_kernels import ANGLE_1, ANGLE_2, BLUR_1, BLUR_2, COUNT, fit_corners, HEIGHT

REACH = 0.5          # squares, half width of the window; the next edges are a square away
LARGEST = 14         # px, half width of the window; beyond, lenses bend edges
GUARD = 1.5          # px between the window and a marker: what the blur reaches
NO_MARKERS = 10.0    # squares; larger than any window
SMALLEST_SQUARE = 6.0  # px, along the shorter side; below, the next edges blur into the corner
LEAST_HEIGHT = 6.0   # DN, half of the difference between white and black
WORST_FIT = 0.25     # residuals as a share of the height; seen on good corners: up to .1
MOST_BLUR = 0.25     # of a square; a corner that is blurred more is none
FARTHEST = 0.3       # squares between the start and the corner
ALIAS = 0.0085       # px, error of an edge along the pixels; evaluation.corners --limits
SHARING = 6          # corners of a line with the same error; chosen: lines have 7 and 10
LEAST_SIGMA = 0.002  # px, what a turned board shows without noise; evaluation.corners --limits


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
    good, pixels, sigma = refined(gray, start, scale, (row + column) % 2 == 0, gap)
    if good.sum() < LEAST_CORNERS:
        return None
    found, scale = pixels[good], scale[good]
    bent = shifts((board.rows - 1, board.columns - 1), ids[good], found, scale, _lengths(scale))
    return Detection(ids[good], found - bent, sigma[good])


def refined(gray, start, scale, black, gap=None):
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
    found = np.empty((len(start), COUNT + 2))
    for _ in range(2):  # the window of the second round lies around the corner
        fit_corners(gray, start, inverse, sign, REACH, NO_MARKERS if gap is None else gap, GUARD,
                    LARGEST, found)
        good = _good(found, start, scale, sign)
        start = np.where(good[:, None], found[:, :2], start)
    pixels = np.where(good[:, None], found[:, :2], np.nan)
    variance = np.abs(found[:, COUNT]) + _aliasing(found, scale) + LEAST_SIGMA ** 2
    return good, pixels, np.where(good, np.sqrt(variance), np.nan)


def _lengths(scale):
    """Return half of what a window shows of the edges along x and y, px, float64 (n, 2)."""
    return np.minimum(REACH * np.linalg.norm(scale, axis=1), LARGEST / np.abs(
        scale / np.linalg.norm(scale, axis=1, keepdims=True)).max(axis=1))


def _aliasing(found, scale):
    """
    Return the variance of edges that meet the pixels in one phase only, px^2, float64 (n,).

    An edge along a row or a column is sampled at one place of its profile, so that an error of the
    profile moves it. Within a window that it crosses in more than one row, the error averages
    out. Corners along the edge share it. An adjustment that counts corners as independent would
    average it, so that their number is a factor here.

    """
    turned = (found[:, [ANGLE_1, ANGLE_2]] + np.pi / 4) % (np.pi / 2) - np.pi / 4
    phases = 2 * _lengths(scale) * np.tan(np.abs(turned))
    return 0.5 * SHARING * ALIAS ** 2 * (np.sinc(np.minimum(phases, 1.0)) ** 2).sum(axis=1)


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
                & (found[:, COUNT + 1] <= WORST_FIT * height) & (blur <= MOST_BLUR * across)
                & (moved <= FARTHEST * across) & (found[:, COUNT] > 0))
