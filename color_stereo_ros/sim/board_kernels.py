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
"""Inner loop of exact board images: the mean of the drawing over every cell of a pixel."""

import numpy as np

from ..core.compiled import parallel, part, prange

SAMPLES = 64  # of a cell on an edge; the share of black is right within about 1 / 64
# Fractions of the plastic number: the steps of a sequence that fills a square evenly, along any
# edge (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018). Every
# point comes with the opposite one: else their mean is off by .002 px, and so are all corners.
STEP_X, STEP_Y = 0.7548776662466927, 0.5698402909980532


@part()
def interval(breaks, value):
    """Return i with breaks[i] <= value < breaks[i + 1], -1 = outside."""
    if not breaks[0] <= value < breaks[-1]:
        return -1
    low, high = 0, breaks.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if breaks[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@part()
def level_at(x, y, x_breaks, y_breaks, dark, disks, border, levels):
    """Return the radiance of one point of the plane of the board."""
    if (x < x_breaks[0] - border or x >= x_breaks[-1] + border
            or y < y_breaks[0] - border or y >= y_breaks[-1] + border):
        return levels[2]
    column, row = interval(x_breaks, x), interval(y_breaks, y)
    if column >= 0 and row >= 0 and dark[row, column]:
        return levels[0]
    for k in range(disks.shape[0]):
        if (x - disks[k, 0]) ** 2 + (y - disks[k, 1]) ** 2 < disks[k, 2] ** 2:
            return levels[0]
    return levels[1]


@part()
def is_uniform(x, y, reach, x_breaks, y_breaks, disks, border):
    """Return whether no edge of the drawing is nearer than `reach` to a point."""
    left, right = interval(x_breaks, x - reach), interval(x_breaks, x + reach)
    top, bottom = interval(y_breaks, y - reach), interval(y_breaks, y + reach)
    if left != right or top != bottom:
        return False
    if left < 0 or top < 0:
        for edge in (x_breaks[0] - border, x_breaks[0], x_breaks[-1], x_breaks[-1] + border):
            if abs(x - edge) <= reach:
                return False
        for edge in (y_breaks[0] - border, y_breaks[0], y_breaks[-1], y_breaks[-1] + border):
            if abs(y - edge) <= reach:
                return False
    for k in range(disks.shape[0]):
        distance = ((x - disks[k, 0]) ** 2 + (y - disks[k, 1]) ** 2) ** 0.5
        if abs(distance - disks[k, 2]) <= reach:
            return False
    return True


@part()
def cell_mean(cell, x_breaks, y_breaks, dark, disks, border, levels):
    """Return the mean radiance of a cell, of which `cell` (4, 2) are the corners."""
    x, y, reach_x, reach_y = 0.0, 0.0, 0.0, 0.0
    for k in range(4):
        x += cell[k, 0] / 4
        y += cell[k, 1] / 4
    for k in range(4):
        reach_x, reach_y = max(reach_x, abs(cell[k, 0] - x)), max(reach_y, abs(cell[k, 1] - y))
    if is_uniform(x, y, max(reach_x, reach_y) * 1.4143, x_breaks, y_breaks, disks, border):
        return level_at(x, y, x_breaks, y_breaks, dark, disks, border, levels)
    total, u, v = 0.0, 0.5, 0.5
    for number in range(SAMPLES):
        if number % 2 == 0:
            u = (u + STEP_X) % 1.0
            v = (v + STEP_Y) % 1.0
        p, q = (u, v) if number % 2 == 0 else (1.0 - u, 1.0 - v)
        a, b, c, d = (1 - p) * (1 - q), p * (1 - q), (1 - p) * q, p * q
        total += level_at(a * cell[0, 0] + b * cell[1, 0] + c * cell[2, 0] + d * cell[3, 0],
                          a * cell[0, 1] + b * cell[1, 1] + c * cell[2, 1] + d * cell[3, 1],
                          x_breaks, y_breaks, dark, disks, border, levels)
    return total / SAMPLES


@part()
def part_of(pixel, i, j, fine, cell):
    """Write the corners (4, 2) of the cell (row i, column j) of a pixel (4, 2)."""
    for k in range(4):
        p, q = (j + k % 2) / fine, (i + k // 2) / fine
        for axis in range(2):
            cell[k, axis] = ((1 - p) * (1 - q) * pixel[0, axis] + p * (1 - q) * pixel[1, axis]
                             + (1 - p) * q * pixel[2, axis] + p * q * pixel[3, axis])


@parallel(error_model='python')
def board_means(grid, x_breaks, y_breaks, dark, disks, border, levels, image):
    """
    Average the radiance of a board over every cell.

    Parameters
    ----------
    grid : numpy.ndarray, float64, shape (H + 1, W + 1, 2)
        Points of the board that the corners of the pixels see, m; NaN = not in front.
    x_breaks, y_breaks : numpy.ndarray, float64, shape (C + 1,) and (R + 1,)
        m.
    dark : numpy.ndarray, bool, shape (R, C)
        Which squares are dark.
    disks : numpy.ndarray, float64, shape (N, 3)
        Center and radius, m.
    border : float
        Width of the white paper around the outline, m.
    levels : numpy.ndarray, float64, shape (3,)
        Radiance of black, of white and of what is behind the board.
    image : numpy.ndarray, float32, shape (F H, F W)
        Written; every pixel has F x F cells.

    """
    fine = image.shape[0] // (grid.shape[0] - 1)
    for row in prange(grid.shape[0] - 1):
        pixel, cell = np.empty((4, 2)), np.empty((4, 2))
        for column in range(grid.shape[1] - 1):
            for k in range(4):
                pixel[k] = grid[row + k // 2, column + k % 2]
            x, y = pixel[:, 0].mean(), pixel[:, 1].mean()
            ahead = abs(x) + abs(y) < 1e6
            reach = 1.4143 * max(np.abs(pixel[:, 0] - x).max(), np.abs(pixel[:, 1] - y).max())
            alike = ahead and is_uniform(x, y, reach, x_breaks, y_breaks, disks, border)
            level = level_at(x, y, x_breaks, y_breaks, dark, disks, border, levels) if (
                alike) else levels[2]
            for i in range(fine):
                for j in range(fine):
                    if ahead and not alike:
                        part_of(pixel, i, j, fine, cell)
                        level = cell_mean(cell, x_breaks, y_breaks, dark, disks, border, levels)
                    image[fine * row + i, fine * column + j] = level
