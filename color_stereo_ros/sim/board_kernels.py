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
"""Inner loop of exact board images: the mean of the drawing over every pixel."""

from ..core.compiled import parallel, part, prange

SAMPLES = 256  # of a pixel on an edge; the share of black is right within about 1 / 256
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


@parallel(error_model='python')
def board_means(grid, x_breaks, y_breaks, dark, disks, border, levels, image):
    """
    Average the radiance of a board over every pixel.

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
    image : numpy.ndarray, float64, shape (H, W)
        Written.

    """
    for row in prange(image.shape[0]):
        for column in range(image.shape[1]):
            x0, y0 = grid[row, column, 0], grid[row, column, 1]
            x1, y1 = grid[row, column + 1, 0], grid[row, column + 1, 1]
            x2, y2 = grid[row + 1, column, 0], grid[row + 1, column, 1]
            x3, y3 = grid[row + 1, column + 1, 0], grid[row + 1, column + 1, 1]
            x, y = (x0 + x1 + x2 + x3) / 4, (y0 + y1 + y2 + y3) / 4
            if not abs(x) + abs(y) < 1e6:
                image[row, column] = levels[2]
                continue
            reach = max(max(abs(x0 - x), abs(x1 - x), abs(x2 - x), abs(x3 - x)),
                        max(abs(y0 - y), abs(y1 - y), abs(y2 - y), abs(y3 - y))) * 1.4143
            if is_uniform(x, y, reach, x_breaks, y_breaks, disks, border):
                image[row, column] = level_at(x, y, x_breaks, y_breaks, dark, disks, border,
                                              levels)
                continue
            total, u, v = 0.0, 0.5, 0.5
            for number in range(SAMPLES):
                if number % 2 == 0:
                    u = (u + STEP_X) % 1.0
                    v = (v + STEP_Y) % 1.0
                p, q = (u, v) if number % 2 == 0 else (1.0 - u, 1.0 - v)
                a, b, c, d = (1 - p) * (1 - q), p * (1 - q), (1 - p) * q, p * q
                total += level_at(a * x0 + b * x1 + c * x2 + d * x3,
                                  a * y0 + b * y1 + c * y2 + d * y3,
                                  x_breaks, y_breaks, dark, disks, border, levels)
            image[row, column] = total / SAMPLES
