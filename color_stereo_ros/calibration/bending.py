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
"""Lenses bend the edges of a board; the lines of its corners show by how much."""

import numpy as np

from ..core.constants import ROBUST_STD

LEAST = 20   # curvatures of lines that a smooth field is fitted to; twice its 6 terms and more
ROUNDS = 5   # of robust weights; chosen: three suffice
OUTLIER = 2.5  # times the scatter: where a curvature has half of its weight (Cauchy)


def bends(shape, ids, pixels):
    """
    Return the curvatures of the edges at corners.

    Inner corners of one row of a board are on a straight line in the world, also under
    perspective. In the image they tell how the lens bends it.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the corners of the board.
    ids : numpy.ndarray, int64, shape (n,)
        Which corners were found; row by row.
    pixels : numpy.ndarray, float64, shape (n, 2)
        Where, px.

    Returns
    -------
    bends : numpy.ndarray, float64, shape (n, 2)
        Of the edges along x and along y, 1 / px, see `curvatures`; zero where too few neighbors
        were found.

    """
    grid = np.full((*shape, 2), np.nan)
    grid.reshape(-1, 2)[ids] = pixels
    both = np.stack([curvatures(grid), curvatures(grid.transpose(1, 0, 2)).T], axis=2)
    return both.reshape(-1, 2)[ids]


def curvatures(lines):
    """
    Return the curvature along lines of corners, 1 / px, float64 (R, C).

    Parameters
    ----------
    lines : numpy.ndarray, float64, shape (R, C, 2)
        px; NaN = not found.

    Returns
    -------
    curvature : numpy.ndarray, float64, shape (R, C)
        Positive where a line bends to (-uy, ux), with u its direction; 0 = unknown.

    """
    before, after = lines[:, 1:-1] - lines[:, :-2], lines[:, 2:] - lines[:, 1:-1]
    chord = before + after
    # Twice the area of a triangle over its sides: the curvature of the circle through it.
    area = before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]
    sides = [np.linalg.norm(each, axis=2) for each in (before, after, chord)]
    return _smooth(np.pad(2 * area / np.prod(sides, axis=0), ((0, 0), (1, 1)),
                          constant_values=np.nan))


def _smooth(values):
    """
    Return a quadratic of row and column near some values (R, C), of which some are NaN.

    A lens bends the lines at the edges of a board more than those beside them: a mean or median
    of neighbors would be wrong there, and the corners with it.

    """
    known = np.isfinite(values)
    row, column = (2 * index / max(count - 1, 1) - 1
                   for index, count in zip(np.indices(values.shape), values.shape))
    terms = np.stack([row ** 0, row, column, row * row, row * column, column * column], axis=2)
    if known.sum() < LEAST:
        return np.full(values.shape, np.median(values[known]) if known.any() else 0.0)
    there, seen = terms[known], values[known]
    weight = np.ones(len(seen))
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        found = np.linalg.lstsq(there * root[:, None], seen * root, rcond=None)[0]
        apart = np.abs(seen - there @ found)
        scatter = max(ROBUST_STD * np.median(apart), np.finfo(float).tiny)
        weight = 1 / (1 + np.square(apart / (OUTLIER * scatter)))
    return terms @ found
