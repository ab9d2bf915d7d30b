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

    I(p) = (1 + g d / 10) (b + a E(d1, s1) E(d2, s2)),  d = p - c

with d1 and d2 the distances of a pixel p from two lines through the corner c, which lenses bend by
known curvatures, and E the profile of an edge, a Gaussian lens, s, before pixels 1 px wide:

    E(d, s) = G(d + 1/2, s) - G(d - 1/2, s),  G(x, s) = x erf(x / sqrt(2) s) + 2 s^2 N(x; s).

Without the width of the pixels an edge along them would move by up to .03 px. The model is
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
SHARPEST, BLUNTEST = math.log(0.1), math.log(8.0)  # px, of the blur
FLAT, LAG = 2, 5       # px; noise of mosaics is related so far; the last distance that counts
FAR = 6.0              # blurs; beyond, an edge is over to 2e-9
ROOT_2 = math.sqrt(2.0)
SLOPE = math.sqrt(2.0 / math.pi)


@part()
def profile(away, blur):
    """Return an edge from -1 to 1 at a distance, its slope, and its derivative by log blur."""
    if abs(away) > FAR * blur + 0.5:
        return math.copysign(1.0, away), 0.0, 0.0
    above, below = away + 0.5, away - 0.5
    step_above = math.erf(above / (ROOT_2 * blur))
    step_below = math.erf(below / (ROOT_2 * blur))
    bell = SLOPE * blur * (math.exp(-0.5 * (above / blur) ** 2)
                           - math.exp(-0.5 * (below / blur) ** 2))
    return above * step_above - below * step_below + bell, step_above - step_below, bell


@part()
def evaluate(values, bends, x, y, seen, residual, jacobian):
    """
    Compare the model with pixels, and differentiate it.

    Parameters
    ----------
    values : numpy.ndarray, float64, shape (10,)
        The parameters; blurs are logarithms of px, angles radians.
    bends : numpy.ndarray, float64, shape (2,)
        Curvatures of both lines, 1 / px; positive toward the side of positive distances.
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
        away_1 -= 0.5 * bends[0] * along_1 * along_1
        away_2 -= 0.5 * bends[1] * along_2 * along_2
        edge_1, slope_1, wider_1 = profile(away_1, blur_1)
        edge_2, slope_2, wider_2 = profile(away_2, blur_2)
        shade = 1.0 + 0.1 * (values[SHADE_X] * dx + values[SHADE_Y] * dy)
        bare = level + height * edge_1 * edge_2
        by_1, by_2 = shade * height * slope_1 * edge_2, shade * height * edge_1 * slope_2
        residual[i] = seen[i] - shade * bare
        cost += residual[i] * residual[i]
        jacobian[i, CENTER_X] = by_1 * sine_1 + by_2 * sine_2 - 0.1 * values[SHADE_X] * bare
        jacobian[i, CENTER_Y] = -by_1 * cosine_1 - by_2 * cosine_2 - 0.1 * values[SHADE_Y] * bare
        jacobian[i, ANGLE_1] = -by_1 * along_1
        jacobian[i, ANGLE_2] = -by_2 * along_2
        jacobian[i, BLUR_1] = shade * height * wider_1 * edge_2
        jacobian[i, BLUR_2] = shade * height * edge_1 * wider_2
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
def fit(values, bends, x, y, seen, residual, jacobian, matrix, factor, rows):
    """
    Fit the model by the method of Levenberg and Marquardt; values (10,) are changed.

    `rows`, float64 (5, 10), is room to work in.

    Returns
    -------
    cost : float
        Sum of the squares of the residuals; NaN = the fit failed.

    """
    vector, change, trial = rows[0], rows[1], rows[2]
    cost = evaluate(values, bends, x, y, seen, residual, jacobian)
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
            new = evaluate(trial, bends, x, y, seen, residual, jacobian)
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
    cost = evaluate(values, bends, x, y, seen, residual, jacobian)
    normal_equations(residual, jacobian, matrix, vector)
    return cost


@part()
def fold(grid, folded, twice_x, twice_y):
    """
    Write each value of a grid (h, w) plus the one opposite to (twice_x, twice_y) / 2.

    Values between pixels are interpolated: rounding would leave half of what is symmetric.

    """
    height, width = grid.shape[0], grid.shape[1]
    for v in range(height):
        for u in range(width):
            folded[v, u] = grid[v, u]
    left, top = int(math.floor(twice_x)), int(math.floor(twice_y))
    p, q = twice_x - left, twice_y - top
    for v in range(height):
        for u in range(width):
            if grid[v, u] == 0.0:
                continue
            for j in range(2):
                for i in range(2):
                    row, column = top + j - v, left + i - u
                    if 0 <= row < height and 0 <= column < width:
                        folded[row, column] += grid[v, u] * (
                            (p if i else 1.0 - p) * (q if j else 1.0 - q))


@part()
def related(distance):
    """Return how much two pixels count together, that are so far apart along one axis."""
    return min(1.0, max(0.0, (LAG + 1.0 - abs(distance)) / (LAG + 1.0 - FLAT)))


@part()
def place(grid, x, y, left, top, one, other):
    """Write the products of one (n,) and other (n,) into a grid (h, w) at columns and rows."""
    for v in range(grid.shape[0]):
        for u in range(grid.shape[1]):
            grid[v, u] = 0.0
    for i in range(x.size):
        grid[LAG + int(y[i] - top), LAG + int(x[i] - left)] = one[i] * other[i]


@part()
def together(grids, twice_x, twice_y):
    """Return a quarter of the sum of products of related values of grids[0], folded."""
    fold(grids[0], grids[1], twice_x, twice_y)
    grid, work = grids[1], grids[0]
    height, width = grid.shape[0], grid.shape[1]
    for v in range(height):
        for u in range(width):
            near = 0.0
            for j in range(max(-LAG, -v), min(LAG, height - 1 - v) + 1):
                near += related(j) * grid[v + j, u]
            work[v, u] = near
    total = 0.0
    for v in range(height):
        for u in range(width):
            if grid[v, u] == 0.0:
                continue
            near = 0.0
            for i in range(max(-LAG, -u), min(LAG, width - 1 - u) + 1):
                near += related(i) * work[v, u + i]
            total += grid[v, u] * near
    return 0.25 * total


@part()
def alone(influence, x, y, left, top, twice_x, twice_y):
    """Return what `together` would of influences times independent noise of variance 1."""
    total = 0.0
    for i in range(x.size):
        opposite = related(2 * (x[i] - left + LAG) - twice_x) * related(
            2 * (y[i] - top + LAG) - twice_y)
        total += influence[i] ** 2 * (1.0 + opposite)
    return 0.5 * total


@part()
def orthonormal(jacobian, factor, basis):
    """Write an orthonormal basis (COUNT, n) of the columns of a jacobian (n, COUNT)."""
    for i in range(jacobian.shape[0]):
        for j in range(COUNT):
            total = jacobian[i, j]
            for m in range(j):
                total -= factor[j, m] * basis[m, i]
            basis[j, i] = total / factor[j, j]


@part()
def spread(values, x, y, residual, jacobian, matrix, factor, rows, basis, grids, found):
    """
    Write what the variance of the corner is made of; NaN = unknown.

    The influence of each pixel on the corner, times its residual, is summed with that of its
    neighbors: noise of demosaiced images is not independent (W. K. Newey and K. D. West, 1987),
    with weights that are 1 nearby (D. N. Politis and J. P. Romano, 1995). Each pixel counts
    together with the one opposite to it: where the true profile of the edges differs from the
    model, both push the corner by the same, in opposite directions. The same sum is expected of
    noise of variance 1 that is independent, less what the fit takes away of it.

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
    basis : numpy.ndarray, float64, shape (COUNT + 1, n)
        Room.
    grids : numpy.ndarray, float64, shape (2, h + 2 LAG, w + 2 LAG)
        Room.
    found : numpy.ndarray, float64, shape (3,)
        Written, each the mean of both coordinates: the sum, px^2; the sum of noise of variance 1
        DN^2 that is independent; the variance that the corner has under such noise, px^2 / DN^2.

    """
    found[:] = np.nan
    unit, row, influence = rows[0], rows[1], basis[COUNT]
    left, top = x[0], y[0]
    for i in range(x.size):
        left, top = min(left, x[i]), min(top, y[i])
    twice_x = 2.0 * (values[CENTER_X] - left + LAG)
    twice_y = 2.0 * (values[CENTER_Y] - top + LAG)
    seen, expected, variance = 0.0, 0.0, 0.0
    for axis in range(2):
        for j in range(COUNT):
            unit[j] = 0.0
        unit[axis] = 1.0
        if not solve(matrix, 0.0, unit, factor, row):
            return
        if axis == 0:
            orthonormal(jacobian, factor, basis)
        for i in range(x.size):
            influence[i] = 0.0
            for j in range(COUNT):
                influence[i] += row[j] * jacobian[i, j]
        variance += row[axis]
        place(grids[0], x, y, left, top, influence, residual)
        seen += together(grids, twice_x, twice_y)
        expected += alone(influence, x, y, left, top, twice_x, twice_y)
        for j in range(COUNT):
            place(grids[0], x, y, left, top, influence, basis[j])
            expected -= together(grids, twice_x, twice_y)
    found[0], found[1], found[2] = seen / 2, expected / 2, variance / 2


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
def fit_corner(gray, middle, inverse, black, bends, reach, gap, guard, largest, pixels, table,
               squares, rows, basis, grids, spreads, found):
    """
    Fit one corner; `found` (14,) is a row of that of `fit_corners`, NaN before.

    The other arrays are room to work in: float64 (4, p) and (p, 10) for the p pixels of the
    largest window, (2, 10, 10), (5, 10), (11, p), and `grids`.

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
    cost = fit(found[:COUNT], bends, x, y, seen, residual, jacobian, squares[0], squares[1],
               rows)
    found[COUNT] = math.sqrt(cost / (count - COUNT))
    if spreads:
        spread(found[:COUNT], x, y, residual, jacobian, squares[0], squares[1], rows,
               basis[:, :count], grids, found[COUNT + 1:])


@parallel(error_model='python')
def fit_corners(gray, start, inverse, black, bends, reach, gap, guard, largest, spreads, found):
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
    bends : numpy.ndarray, float64, shape (n, 2)
        Of each corner, see `evaluate`.
    reach, gap, guard
        See `inside`.
    largest : int
        Half width of the window, px, at most.
    spreads : bool
        Whether variances are asked for.
    found : numpy.ndarray, float64, shape (n, 14)
        Written: the parameters, the standard deviation of the residuals (DN), and what `spread`
        writes. NaN = no fit, or not asked for.

    """
    side = 2 * largest + 2
    for corner in prange(start.shape[0]):
        found[corner] = np.nan
        pixels, table = np.empty((4, side * side)), np.empty((side * side, COUNT))
        squares, rows = np.zeros((2, COUNT, COUNT)), np.zeros((5, COUNT))
        basis = np.empty((COUNT + 1, side * side))
        grids = np.empty((2, side + 2 * LAG, side + 2 * LAG))
        fit_corner(gray, start[corner], inverse[corner], black[corner], bends[corner], reach, gap,
                   guard, largest, pixels, table, squares, rows, basis, grids, spreads,
                   found[corner])
