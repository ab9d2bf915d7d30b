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

NEAR = 3  # corners to each side along a line, whose median is the curvature; chosen


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
    bends = np.pad(2 * area / np.prod(sides, axis=0), ((0, 0), (NEAR + 1, NEAR + 1)),
                   constant_values=np.nan)
    near = np.lib.stride_tricks.sliding_window_view(bends, 2 * NEAR + 1, axis=1)
    known = np.isfinite(near).any(axis=2)
    return np.where(known, np.nanmedian(np.where(known[..., None], near, 0.0), axis=2), 0.0)
