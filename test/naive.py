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
"""Loop-only twins of the compiled kernels, written from the paper's formulas."""

import math

import numpy as np

# What the kernels promise about themselves: costs are counted in half DN^2 and capped.
COST_UNIT = 2.0
COST_CAP = 16000.0
UNUSABLE_COST = 2000.0


def corrected_color(color, dark, gains, zero_weakest, target):
    """Return one corrected color (paper, sec. 2.2)."""
    equalized = [max(0.0, (float(c) - d) * g) for c, d, g in zip(color, dark, gains)]
    if zero_weakest:
        weakest = min(equalized)
        equalized = [0.0 if c == weakest else c for c in equalized]
    if target > 0:
        total = max(sum(equalized), 1e-6)
        equalized = [target * c / total for c in equalized]
    return equalized


def correct_colors(image, inside, dark, gains, min_signal, saturation, zero_weakest, target):
    """Return corrected colors (H, W, 4) and reasons (H, W)."""
    height, width = inside.shape
    colors = np.zeros((height, width, 4))
    reason = np.zeros((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            color = image[y, x]
            if not inside[y, x]:
                reason[y, x] = 1
            elif max(color) >= saturation:
                reason[y, x] = 3
            elif max(float(c) - d for c, d in zip(color, dark)) < min_signal:
                reason[y, x] = 2
            else:
                colors[y, x, :3] = corrected_color(color, dark, gains, zero_weakest, target)
                colors[y, x, 3] = 1
    return colors, reason


def average_spots(image, inside, dark, min_signal, saturation, step, size):
    """Return the mean color of each spot above the dark level, and whether all of it is lit."""
    rows, columns = (n // step for n in inside.shape)
    colors, lit = np.zeros((rows, columns, 3)), np.zeros((rows, columns), bool)
    for row in range(rows):
        for column in range(columns):
            spot = [(y, x) for y in range(row * step, row * step + size)
                    for x in range(column * step, column * step + size)]
            colors[row, column] = np.mean([image[p].astype(float) - dark for p in spot], axis=0)
            lit[row, column] = all(
                inside[p] and max(image[p]) < saturation
                and max(image[p].astype(float) - dark) >= min_signal for p in spot)
    return colors, lit


def color_distance(left, right):
    """
    Return the squared distance of two colors, scaled to each other (paper, sec. 2.2).

    The factor s comes from the largest component of the left color.

    """
    largest = max(range(3), key=lambda j: left[j])
    if right[largest] <= 0:
        return math.inf
    s = left[largest] / right[largest]
    return sum((left[j] - s * right[j]) ** 2 for j in range(3))


def pixel_cost(left, right, y, x_left, x_right):
    """Return the cost of one pair of pixels in the kernels' units."""
    if left[y, x_left, 3] == 0:
        return UNUSABLE_COST
    if not 0 <= x_right < right.shape[1] or right[y, x_right, 3] == 0:
        return COST_CAP
    return min(COST_CAP, COST_UNIT * color_distance(left[y, x_left, :3], right[y, x_right, :3]))


def window_cost(left, right, y, x, disparity, reach_x, reach_y):
    """Return Q of one left pixel and one disparity over the part of the window in the image."""
    height, width = left.shape[:2]
    return sum(pixel_cost(left, right, row, column, column - disparity)
               for row in range(max(0, y - reach_y), min(height, y + reach_y + 1))
               for column in range(max(0, x - reach_x), min(width, x + reach_x + 1)))


def search(left, right, first, count, reach_x, reach_y, low, high):
    """
    Return winner (H, W, 2), costs (H, W, 4) and all window costs (H, W, count).

    As the kernel: k of the winner and of the winner of its right pixel; costs before, at and
    after the winner and of the best other local minimum.

    """
    height, width = left.shape[:2]
    volume = np.array([[[window_cost(left, right, y, x, first + k, reach_x, reach_y)
                         for k in range(count)] for x in range(width)] for y in range(height)])
    winner, costs = np.full((height, width, 2), -1), np.zeros((height, width, 4))
    for y in range(height):
        for x in range(width):
            if left[y, x, 3] > 0:
                candidates = range(low[y, x], high[y, x])
                winner[y, x, 0] = min(candidates, key=lambda k: volume[y, x, k])
                costs[y, x] = _costs(volume[y, x], candidates, winner[y, x, 0])
        for x in range(width):
            if winner[y, x, 0] >= 0:
                winner[y, x, 1] = _right_winner(volume[y], left[y, :, 3], x - winner[y, x, 0],
                                                low[y], high[y])
    return winner, costs, volume


def _costs(volume, candidates, best):
    around = [math.inf, *volume, math.inf]
    others = [volume[k] for k in candidates if abs(k - best) > 1
              and around[k + 1] <= around[k] and around[k + 1] <= around[k + 2]]
    return around[best], around[best + 1], around[best + 2], min(others, default=math.inf)


def _right_winner(volume, usable, shifted, low, high):
    """Return the k of the cheapest left pixel whose candidate is the right pixel `shifted`."""
    bids = [(volume[x, x - shifted], x - shifted) for x in range(len(volume))
            if usable[x] > 0 and low[x] <= x - shifted < high[x]]
    return min(bids)[1]


def verdict(k, mirrored, column, right_row, low, high, count, costs, tolerance, uniqueness):
    """Return the status code of one winner."""
    if k in (0, count - 1):
        return 7
    if k in (low, high - 1) or not 0 <= column < len(right_row) or right_row[column, 3] == 0:
        return 4
    if tolerance > 0 and abs(mirrored - k) > tolerance:
        return 6
    if costs[0] - 2 * costs[1] + costs[2] <= 0:
        return 5
    if costs[3] <= costs[1] * (1 + uniqueness):
        return 5
    return 0


def subpixel_offset(before, best, after, mode):
    """Return the offset of the minimum, px: parabola, or the weighted neighbor of sec. 3."""
    if mode == 'parabola':
        a = (before + after) / 2 - best
        b = (after - before) / 2
        return -b / (2 * a)
    if mode == 'weighted':
        neighbor, side = (after, 1) if after < before else (before, -1)
        # the position of each, weighted with the cost of the other: the lower cost weighs more
        return side * best / (best + neighbor) if best + neighbor > 0 else 0.0
    return 0.0


def agreements(disparity, candidates, y, x, step_x, step_y):
    """
    Return how many pairs of neighboring windows agree, are known, would agree by chance.

    candidates: number of disparities that were compared, of pixel (y, x).

    """
    agreeing, known, expected = 0, 0, 0
    for i, j in ((step_x, 0), (0, step_y), (step_x, step_y), (step_x, -step_y)):
        reach = math.hypot(i, j) + 2
        for one, two in ((-1, 1), (1, 2), (-1, -2)):
            near = _at(disparity, y + one * j, x + one * i)
            far = _at(disparity, y + two * j, x + two * i)
            own = disparity[y, x]
            bend = near + far - 2 * own if one == -two else 2 * near - far - own
            if not math.isnan(bend):
                known += 1
                agreeing += abs(bend) <= 2 and abs(near - own) <= reach
                chance = min(1, 2 * reach / candidates) * min(1, 4 / candidates)
                expected += math.ceil(256 * chance - 1e-4)
    return agreeing, known, expected


def _at(image, y, x):
    height, width = image.shape
    return image[y, x] if 0 <= y < height and 0 <= x < width else math.nan


def evidence(share, chance):
    """Return the Chernoff bound of one trial, -log of the probability of such a share."""
    if share <= chance:
        return 0.0
    rest = (1 - share) * math.log((1 - share) / (1 - chance)) if share < 1 else 0.0
    return share * math.log(share / chance) + rest


def support_verdict(agreeing, known, expected, places, own_agreeing, own_known, deviation):
    """Return the confidence of a match, 0 if its surroundings agree by chance."""
    chance = min(max(expected / max(256 * known, 1), 1e-3), 1 - 1e-3)
    if known / places * evidence(agreeing / max(known, 1), chance) < 5:
        return 0.0
    odds = (0.45 - 0.78 * math.log(deviation + 0.02)
            + 1.18 * math.log((own_agreeing + 0.5) / (own_known - own_agreeing + 0.5)))
    return 1 / (1 + math.exp(-odds))


def chromaticity(color, dark):
    """Return r - g and b - (r + g) / 2 over the brightness of one color."""
    r, g, b = (float(each) for each in color)
    return np.array([r - g, b - (r + g) / 2]) / (r + g + b + dark)


def read_bilinear(colors, u, v):
    """Return a value between four pixels and its slopes along u and v."""
    x, y = int(u), int(v)
    fx, fy = u - x, v - y
    a, b = colors[y, x].astype(float), colors[y, x + 1].astype(float)
    c, d = colors[y + 1, x].astype(float), colors[y + 1, x + 1].astype(float)
    value = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d)
    return value, (1 - fy) * (b - a) + fy * (d - c), (1 - fx) * (c - a) + fx * (d - b)


def place_patch(image, pattern, pixel, place, affine, rounds, farthest, half, dark, settled):
    """Return the row of results that `place_patches` writes for one patch."""
    offsets = [(i, j) for j in range(-half, half + 1) for i in range(-half, half + 1)]
    own = np.array([chromaticity(image[pixel[1] + j, pixel[0] + i], dark) for i, j in offsets])
    own -= own.mean(axis=0)
    nothing, at = np.full(4, np.nan), np.array(place, float)
    last = np.array(pattern.shape[1::-1]) - 1
    for turn in range(rounds + 1):
        there = at + np.array(offsets) @ np.asarray(affine).T
        if not ((there >= 0) & (there < last)).all():
            return nothing
        colors, along_u, along_v = (np.array(each) for each in zip(
            *(read_bilinear(pattern, *each) for each in there)))
        colors, along_u, along_v = (each - each.mean(axis=0)
                                    for each in (colors, along_u, along_v))
        mixed = np.linalg.lstsq(colors, own, rcond=None)[0]
        error = (own - colors @ mixed).ravel()
        slopes = np.column_stack([(along_u @ mixed).ravel(), (along_v @ mixed).ravel()])
        normal = slopes.T @ slopes
        if turn == rounds:
            break
        step = np.linalg.solve(normal, slopes.T @ error)
        at = at + step
        if (np.abs(at - place) >= farthest).any():
            return nothing
        if np.abs(step).sum() < settled:
            break
    variance = error @ error / (2 * len(offsets) - 8)
    spread = math.sqrt(variance * np.trace(np.linalg.inv(normal)) / 2)
    return np.array([*at, spread, 1 - error @ error / np.sum(own ** 2)])


def fitted_slopes(disparity, lattice, limits, ridge):
    """
    Return the slopes of the disparity on nodes of 2 x 2 pixels, rows of (a, b), px per node.

    See `core.normal_kernels.fit_slopes`: a plane in the sense of least squares through the nodes
    around that go on into the plane here, and these into that.

    """
    rows, columns = disparity.shape[0] // 2, disparity.shape[1] // 2
    nodes = {(j, i): _node_plane(disparity[2 * j:2 * j + 2, 2 * i:2 * i + 2].astype(float))
             for j in range(rows) for i in range(columns)}
    reach, down, along, shift = lattice
    places = [(dj, di) for row, dj in enumerate(range(-reach, reach + 1, down))
              for di in range(-reach + shift * (row % 2), reach + 1, along)]
    return [[_slopes_at(nodes, j, i, places, limits, ridge) for i in range(columns)]
            for j in range(rows)]


def slopes_at_pixel(slopes, v, u):
    """Return (a, b) of a pixel, px per node: see `core.normal_kernels.write_normals`."""
    rows, columns = len(slopes), len(slopes[0])
    j, i = min(v // 2, rows - 1), min(u // 2, columns - 1)
    found = np.array(slopes[j][i])
    for off, dj, di in (((v - 2 * j - 0.5) / 2, 1, 0), ((u - 2 * i - 0.5) / 2, 0, 1)):
        around = [slopes[min(max(j + sign * dj, 0), rows - 1)]
                  [min(max(i + sign * di, 0), columns - 1)] for sign in (-1, 1)]
        for k in (0, 1):
            here = slopes[j][i][k]
            changes = [change for change in (here - around[0][k], around[1][k] - here)
                       if np.isfinite(change)]
            if not any(change < 0 for change in changes) or all(
                    change < 0 for change in changes):
                found[k] += off * min(changes, key=abs, default=0.0)
    return found


def _node_plane(block):
    """Return mean disparity and slopes of 2 x 2 pixels, NaN where they are unknown."""
    def mean(values):
        known = [value for value in values if np.isfinite(value)]
        return sum(known) / len(known) if known else np.nan

    a, b = 2 * mean(block[:, 1] - block[:, 0]), 2 * mean(block[1] - block[0])
    known = np.isfinite(a) and np.isfinite(b)
    return mean(block.ravel()), a if known else np.nan, b if known else np.nan


def _slopes_at(nodes, j, i, places, limits, ridge):
    """Return (a, b) of one node."""
    d, a, b = nodes[j, i]
    equations, values, slopes = [], [], []
    for dj, di in places:
        other, its_a, its_b = nodes.get((j + dj, i + di), (np.nan,) * 3)
        gate = limits[0] + limits[1] * (di ** 2 + dj ** 2) * (d - limits[2])
        if not abs(other - d - its_a * di - its_b * dj) <= gate:
            continue
        if np.isfinite(a) and not abs(other - d - a * di - b * dj) <= gate:
            continue
        equations.append([1.0, di, dj])
        values.append(other - d)
        slopes.append([its_a, its_b])
    if not equations:
        return np.nan, np.nan
    mean = np.mean(slopes, axis=0)
    equations += [[0, np.sqrt(ridge), 0], [0, 0, np.sqrt(ridge)]]
    values += [np.sqrt(ridge) * mean[0], np.sqrt(ridge) * mean[1]]
    return tuple(np.linalg.lstsq(np.array(equations), np.array(values), rcond=None)[0][1:])


def corrected_colors(image, light, gain, matrix, saturation, pedestal, ceiling, saturated):
    """Return what `color_kernels.correct_colors` writes, pixel by pixel in float64."""
    out = np.empty_like(image)
    for y, x in np.ndindex(image.shape[:2]):
        color = [light[c, image[y, x, c]] * gain[y, x, c] for c in range(3)]
        for c in range(3):
            level = pedestal + sum(matrix[c, i] * color[i] for i in range(3))
            out[y, x, c] = np.floor(min(max(level, 0), ceiling) + 0.5)
            if image[y, x, c] >= saturation:
                out[y, x, c] = saturated
    return out
