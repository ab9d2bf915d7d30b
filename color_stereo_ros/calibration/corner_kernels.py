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
Inner loops of the corner fit: two edges that cross, blurred.

    I(p) = (1 + g d / 10) (b + a erf(d1 / sqrt(2) s1) erf(d2 / sqrt(2) s2)),  d = p - c

with d1 and d2 the distances of a pixel p from two lines through the corner c. The model is
symmetric about c. Therefore errors of blur, angles, levels and of the response curve do not move
the corner.

"""

import math

import numpy as np

from ..core.compiled import parallel, part, prange

CENTER_X, CENTER_Y, ANGLE_1, ANGLE_2, BLUR_1, BLUR_2, HEIGHT, LEVEL, SHADE_X, SHADE_Y = range(10)
COUNT = 10             # of the parameters; blurs are logarithms
ROUNDS = 40            # at most; a dozen are usual
STEP = 1e-4            # px; the fit ends when the corner moves less
SHARPEST, BLUNTEST = math.log(0.25), math.log(8.0)  # px, of the blur
LAG = 5                # px; the tent reaches over three periods of a mosaic, where it is blind
ROOT_2 = math.sqrt(2.0)
SLOPE = math.sqrt(2.0 / math.pi)


@part()
def evaluate(values, x, y, seen, residual, jacobian):
    """
    Compare the model with pixels, and differentiate it.

    Parameters
    ----------
    values : numpy.ndarray, float64, shape (10,)
        The parameters; blurs are logarithms of px, angles radians.
    x, y, seen : numpy.ndarray, float64, shape (n,)
        Column, row (px) and gray value of each pixel.
    residual : numpy.ndarray, float64, shape (n,)
        Written: seen - model.
    jacobian : numpy.ndarray, float64, shape (n, 10)
        Written: derivatives of the model.

    Returns
    -------
    cost : float
        Sum of the squares of the residuals.

    """
    sine_1, cosine_1 = math.sin(values[ANGLE_1]), math.cos(values[ANGLE_1])
    sine_2, cosine_2 = math.sin(values[ANGLE_2]), math.cos(values[ANGLE_2])
    blur_1, blur_2 = math.exp(values[BLUR_1]), math.exp(values[BLUR_2])
    height, level = values[HEIGHT], values[LEVEL]
    cost = 0.0
    for i in range(x.size):
        dx, dy = x[i] - values[CENTER_X], y[i] - values[CENTER_Y]
        away_1, away_2 = cosine_1 * dy - sine_1 * dx, cosine_2 * dy - sine_2 * dx
        along_1, along_2 = cosine_1 * dx + sine_1 * dy, cosine_2 * dx + sine_2 * dy
        edge_1 = math.erf(away_1 / (ROOT_2 * blur_1))
        edge_2 = math.erf(away_2 / (ROOT_2 * blur_2))
        slope_1 = SLOPE / blur_1 * math.exp(-0.5 * (away_1 / blur_1) ** 2)
        slope_2 = SLOPE / blur_2 * math.exp(-0.5 * (away_2 / blur_2) ** 2)
        shade = 1.0 + 0.1 * (values[SHADE_X] * dx + values[SHADE_Y] * dy)
        bare = level + height * edge_1 * edge_2
        by_1, by_2 = shade * height * slope_1 * edge_2, shade * height * edge_1 * slope_2
        residual[i] = seen[i] - shade * bare
        cost += residual[i] * residual[i]
        jacobian[i, CENTER_X] = by_1 * sine_1 + by_2 * sine_2 - 0.1 * values[SHADE_X] * bare
        jacobian[i, CENTER_Y] = -by_1 * cosine_1 - by_2 * cosine_2 - 0.1 * values[SHADE_Y] * bare
        jacobian[i, ANGLE_1] = -by_1 * along_1
        jacobian[i, ANGLE_2] = -by_2 * along_2
        jacobian[i, BLUR_1] = -by_1 * away_1
        jacobian[i, BLUR_2] = -by_2 * away_2
        jacobian[i, HEIGHT] = shade * edge_1 * edge_2
        jacobian[i, LEVEL] = shade
        jacobian[i, SHADE_X] = 0.1 * dx * bare
        jacobian[i, SHADE_Y] = 0.1 * dy * bare
    return cost


@part()
def normal_equations(residual, jacobian, matrix, vector):
    """Write J^T J into matrix (10, 10) and J^T r into vector (10,)."""
    for j in range(COUNT):
        vector[j] = 0.0
        for k in range(COUNT):
            matrix[j, k] = 0.0
    for i in range(residual.size):
        for j in range(COUNT):
            vector[j] += jacobian[i, j] * residual[i]
            for k in range(j + 1):
                matrix[j, k] += jacobian[i, j] * jacobian[i, k]
    for j in range(COUNT):
        for k in range(j):
            matrix[k, j] = matrix[j, k]


@part()
def solve(matrix, damping, vector, factor, solution):
    """
    Solve (M + damping diag M) x = v by Cholesky's decomposition.

    Returns
    -------
    solved : bool
        False where the matrix is not positive definite.

    """
    for j in range(COUNT):
        for k in range(j + 1):
            total = matrix[j, k]
            if j == k:
                total += damping * matrix[j, j]
            for m in range(k):
                total -= factor[j, m] * factor[k, m]
            if j == k:
                if not total > 1e-12 * matrix[j, j] + 1e-30:
                    return False
                factor[j, j] = math.sqrt(total)
            else:
                factor[j, k] = total / factor[k, k]
    for j in range(COUNT):
        total = vector[j]
        for m in range(j):
            total -= factor[j, m] * solution[m]
        solution[j] = total / factor[j, j]
    for j in range(COUNT - 1, -1, -1):
        total = solution[j]
        for m in range(j + 1, COUNT):
            total -= factor[m, j] * solution[m]
        solution[j] = total / factor[j, j]
    return True


@part()
def fit(values, x, y, seen, residual, jacobian, matrix, factor, rows):
    """
    Fit the model by the method of Levenberg and Marquardt; values (10,) are changed.

    `rows`, float64 (5, 10), is room to work in.

    Returns
    -------
    cost : float
        Sum of the squares of the residuals; NaN = the fit failed.

    """
    vector, change, trial = rows[0], rows[1], rows[2]
    cost = evaluate(values, x, y, seen, residual, jacobian)
    damping = 1e-2
    for _ in range(ROUNDS):
        normal_equations(residual, jacobian, matrix, vector)
        better = False
        for _ in range(8):
            if not solve(matrix, damping, vector, factor, change):
                damping *= 10.0
                continue
            for j in range(COUNT):
                trial[j] = values[j] + change[j]
            for j in (BLUR_1, BLUR_2):
                trial[j] = min(max(trial[j], SHARPEST), BLUNTEST)
            new = evaluate(trial, x, y, seen, residual, jacobian)
            if new < cost:
                better = True
                break
            damping *= 10.0
        if not better:
            break
        moved = max(abs(trial[0] - values[0]), abs(trial[1] - values[1]))
        ended = moved < STEP and cost - new < 1e-6 * cost
        for j in range(COUNT):
            values[j] = trial[j]
        cost = new
        damping = max(damping * 0.1, 1e-9)
        if ended:
            break
    cost = evaluate(values, x, y, seen, residual, jacobian)
    normal_equations(residual, jacobian, matrix, vector)
    return cost


@part()
def fold(grid, twice_x, twice_y):
    """Add to each value of a grid (h, w, 2) the one opposite to (twice_x, twice_y) / 2."""
    height, width = grid.shape[0], grid.shape[1]
    for v in range(height):
        for u in range(width):
            j, i = twice_y - v, twice_x - u
            if (v, u) > (j, i) or not (0 <= j < height and 0 <= i < width):
                continue
            for axis in range(2):
                both = grid[v, u, axis] + grid[j, i, axis]
                grid[v, u, axis] = both
                grid[j, i, axis] = both


@part()
def spread(values, x, y, residual, jacobian, matrix, factor, rows, grid):
    """
    Return the variance of the corner, px^2, the mean of both coordinates; NaN = unknown.

    The influence of each pixel on the corner, times its residual, is summed with that of its
    neighbors: noise of demosaiced images is not independent (W. K. Newey and K. D. West, 1987).
    Each pixel counts together with the one opposite to it: where the true profile of the edges
    differs from the model, both push the corner by the same, in opposite directions.

    Parameters
    ----------
    values : numpy.ndarray, float64, shape (COUNT,)
        The fitted model of the corner.
    x, y, residual : numpy.ndarray, float64, shape (n,)
        Of the pixels in the window: column, row, seen less expected.
    jacobian : numpy.ndarray, float64, shape (n, COUNT)
        Of the model.
    matrix : numpy.ndarray, float64, shape (COUNT, COUNT)
        Of the normal equations.
    factor, rows : numpy.ndarray, float64
        Room for the solution.
    grid : numpy.ndarray, float64, shape (h + 2 LAG, w + 2 LAG, 2)
        Zero; written.

    """
    unit, row = rows[0], rows[1:3]
    for axis in range(2):
        for j in range(COUNT):
            unit[j] = 0.0
        unit[axis] = 1.0
        if not solve(matrix, 0.0, unit, factor, row[axis]):
            return np.nan
    left, top = x[0], y[0]
    for i in range(x.size):
        left, top = min(left, x[i]), min(top, y[i])
    for i in range(x.size):
        for axis in range(2):
            influence = 0.0
            for j in range(COUNT):
                influence += row[axis, j] * jacobian[i, j]
            grid[LAG + int(y[i] - top), LAG + int(x[i] - left), axis] = influence * residual[i]
    twice_x = int(math.floor(2.0 * (values[CENTER_X] - left) + 0.5)) + 2 * LAG
    twice_y = int(math.floor(2.0 * (values[CENTER_Y] - top) + 0.5)) + 2 * LAG
    fold(grid, twice_x, twice_y)
    total = 0.0
    for v in range(LAG, grid.shape[0] - LAG):
        for u in range(LAG, grid.shape[1] - LAG):
            for axis in range(2):
                if grid[v, u, axis] == 0.0:
                    continue
                near = 0.0
                for j in range(-LAG, LAG + 1):
                    for i in range(-LAG, LAG + 1):
                        weight = (1 - abs(i) / (LAG + 1)) * (1 - abs(j) / (LAG + 1))
                        near += weight * grid[v + j, u + i, axis]
                total += grid[v, u, axis] * near
    freedom = x.size - COUNT
    return 0.25 * total * x.size / freedom if freedom > 0 else np.nan


@part()
def inside(dx, dy, inverse, reach, gap, guard, black):
    """
    Return whether a pixel belongs to the window of a corner.

    Parameters
    ----------
    dx, dy : float
        Pixel less corner, px.
    inverse : numpy.ndarray, float64, shape (2, 2)
        Squares per px.
    reach : float
        Half width of the window, squares.
    gap : float
        Distance from the edge of a white square to its marker, squares; large = no markers.
    guard : float
        px; nearer to a marker no pixel is used.
    black : float
        1 where the square at larger x and larger y is black, -1 where it is white.

    """
    qx, qy = inverse[0, 0] * dx + inverse[0, 1] * dy, inverse[1, 0] * dx + inverse[1, 1] * dy
    if abs(qx) > reach or abs(qy) > reach:
        return False
    if qx * qy * black > 0:
        return True
    near_x = gap - guard * math.hypot(inverse[0, 0], inverse[0, 1])
    near_y = gap - guard * math.hypot(inverse[1, 0], inverse[1, 1])
    return abs(qx) < near_x or abs(qy) < near_y


@part()
def window(gray, middle, inverse, black, reach, gap, guard, box, x, y, seen, levels):
    """
    Collect the pixels of a corner's window.

    Parameters
    ----------
    gray : numpy.ndarray, shape (H, W)
        The image.
    middle : numpy.ndarray, float64, shape (2,)
        px.
    inverse, black, reach, gap, guard
        See `inside`.
    box : (int, int, int, int)
        First and last column + 1, first and last row + 1.
    x, y, seen : numpy.ndarray, float64
        Written: column, row and gray value of each pixel.
    levels : numpy.ndarray, float64, shape (2,)
        Written: mean of the pixels that should be black, and white; NaN = there are none.

    Returns
    -------
    count : int

    """
    count, blacks, whites = 0, 0, 0
    levels[0] = levels[1] = 0.0
    for row in range(box[2], box[3]):
        for column in range(box[0], box[1]):
            dx, dy = column - middle[0], row - middle[1]
            if not inside(dx, dy, inverse, reach, gap, guard, black):
                continue
            x[count], y[count], seen[count] = column, row, gray[row, column]
            side = (inverse[0, 0] * dx + inverse[0, 1] * dy) * (
                inverse[1, 0] * dx + inverse[1, 1] * dy)
            if side * black > 0:
                levels[0] += seen[count]
                blacks += 1
            else:
                levels[1] += seen[count]
                whites += 1
            count += 1
    levels[0] = levels[0] / blacks if blacks else np.nan
    levels[1] = levels[1] / whites if whites else np.nan
    return count


@part()
def begin(values, middle, inverse, black, levels):
    """Write the parameters (10,) at which a fit begins."""
    for j in range(COUNT):
        values[j] = 0.0
    values[CENTER_X], values[CENTER_Y] = middle[0], middle[1]
    # Along the first edge the y of the board does not change, along the second one its x.
    values[ANGLE_1] = math.atan2(-inverse[1, 0], inverse[1, 1])
    values[ANGLE_2] = math.atan2(inverse[0, 0], -inverse[0, 1])
    # d1 grows with y and d2 falls with x: d1 d2 < 0 in the squares that `black` is about.
    values[HEIGHT] = 0.5 * (levels[1] - levels[0]) * black
    values[LEVEL] = 0.5 * (levels[1] + levels[0])


@part()
def fit_corner(gray, middle, inverse, black, reach, gap, guard, largest, pixels, table, squares,
               rows, grid, found):
    """
    Fit one corner; `found` (12,) is a row of that of `fit_corners`, NaN before.

    The other arrays are room to work in: float64 (4, p) and (p, 10) for the p pixels of the
    largest window, (2, 10, 10), (5, 10), and `grid`, which is zero.

    """
    left, top = max(0, int(middle[0]) - largest), max(0, int(middle[1]) - largest)
    right = min(gray.shape[1], int(middle[0]) + largest + 2)
    bottom = min(gray.shape[0], int(middle[1]) + largest + 2)
    levels = rows[4, :2]
    count = window(gray, middle, inverse, black, reach, gap, guard, (left, right, top, bottom),
                   pixels[0], pixels[1], pixels[2], levels)
    if count < 2 * COUNT or math.isnan(levels[0] + levels[1]):
        return
    x, y, seen = pixels[0, :count], pixels[1, :count], pixels[2, :count]
    residual, jacobian = pixels[3, :count], table[:count]
    begin(found, middle, inverse, black, levels)
    cost = fit(found[:COUNT], x, y, seen, residual, jacobian, squares[0], squares[1], rows)
    found[COUNT] = spread(found[:COUNT], x, y, residual, jacobian, squares[0], squares[1], rows,
                          grid)
    found[COUNT + 1] = math.sqrt(cost / (count - COUNT))


@parallel(error_model='python')
def fit_corners(gray, start, inverse, black, reach, gap, guard, largest, found):
    """
    Fit all corners of a board.

    Parameters
    ----------
    gray : numpy.ndarray, uint8, shape (H, W)
        The image, gray.
    start : numpy.ndarray, float64, shape (n, 2)
        px.
    inverse : numpy.ndarray, float64, shape (n, 2, 2)
        Squares per px at each corner.
    black : numpy.ndarray, float64, shape (n,)
        Of each corner, see `inside`.
    reach, gap, guard
        See `inside`.
    largest : int
        Half width of the window, px, at most.
    found : numpy.ndarray, float64, shape (n, 12)
        Written: the parameters, the variance of the corner (px^2), and the standard deviation of
        the residuals (DN). NaN = no fit.

    """
    side = 2 * largest + 2
    for corner in prange(start.shape[0]):
        found[corner] = np.nan
        pixels, table = np.empty((4, side * side)), np.empty((side * side, COUNT))
        squares, rows = np.zeros((2, COUNT, COUNT)), np.zeros((5, COUNT))
        grid = np.zeros((side + 2 * LAG, side + 2 * LAG, 2))
        fit_corner(gray, start[corner], inverse[corner], black[corner], reach, gap, guard,
                   largest, pixels, table, squares, rows, grid, found[corner])
