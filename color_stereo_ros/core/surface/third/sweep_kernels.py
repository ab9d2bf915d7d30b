# SPDX-License-Identifier: Apache-2.0
"""
Kernels of the third view: nodes of the left image against the pattern.

A node (column i, row j of the half grid) at a disparity d is lit by the place

    (U, V, W) = sweep (x, y, 1, d),  x = 2 i + 0.5,  y = 2 j + 0.5;   u = U / W,  v = V / W

of the pattern, px: the disparity of the two cameras stands for the distance. The right camera
takes no part. Pattern images are float32 (H, W, 3), linear light of the projector.

"""

import math

import numpy as np

from ...compiled import band, banded, part, serial
from ..grid_kernels import F4, FAST, I4, NAN, PAD, SILENT_VARIANCE, TILE_COLUMNS, TILE_ROWS, U4
from .tuning import TUNING

I2 = np.int16
ROOT3 = F4(math.sqrt(3.0))
MARGIN = F4(TUNING.color.margin)  # compiled into the kernels
LEAST_LIGHT = F4(TUNING.color.least_light)
LARGEST_COST = I2(32767)


@part(fastmath=FAST)
def place_of(sweep, x, y, d):
    """Return column and row of the pattern, px, and the slopes of both against d."""
    depth = sweep[2, 0] * x + sweep[2, 1] * y + sweep[2, 2] + sweep[2, 3] * d
    inverse = F4(1) / (depth if depth > F4(1e-6) else F4(1e-6))
    u = (sweep[0, 0] * x + sweep[0, 1] * y + sweep[0, 2] + sweep[0, 3] * d) * inverse
    v = (sweep[1, 0] * x + sweep[1, 1] * y + sweep[1, 2] + sweep[1, 3] * d) * inverse
    u = u if depth > F4(1e-6) else F4(-1e6)
    return u, v, (sweep[0, 3] - u * sweep[2, 3]) * inverse, (
        sweep[1, 3] - v * sweep[2, 3]) * inverse


@part(fastmath=FAST)
def within(image, u, v):
    """Return whether a place lies inside a pattern image and not at its border."""
    return ((u >= MARGIN) & (v >= MARGIN) & (u < F4(image.shape[1] - 1) - MARGIN)
            & (v < F4(image.shape[0] - 1) - MARGIN))


@part(fastmath=FAST)
def color_at(image, u, v, du, dv):
    """
    Return red, green and blue at a place inside, and their slopes along (du, dv).

    Linear interpolation: the image is blurred so far that this is off by 1 % of the contrast.

    """
    i, j = U4(u), U4(v)
    s, t = u - F4(i), v - F4(j)
    right, below = U4(i + U4(1)), U4(j + U4(1))
    a0, a1, a2 = image[j, i, 0], image[j, i, 1], image[j, i, 2]
    b0, b1, b2 = image[j, right, 0], image[j, right, 1], image[j, right, 2]
    c0, c1, c2 = image[below, i, 0], image[below, i, 1], image[below, i, 2]
    d0, d1, d2 = image[below, right, 0], image[below, right, 1], image[below, right, 2]
    x0, x1, x2 = b0 - a0, b1 - a1, b2 - a2  # steps along the upper row
    y0, y1, y2 = d0 - c0, d1 - c1, d2 - c2  # and along the lower one
    e0, e1, e2 = a0 + s * x0, a1 + s * x1, a2 + s * x2
    f0, f1, f2 = c0 + s * y0 - e0, c1 + s * y1 - e1, c2 + s * y2 - e2
    return (e0 + t * f0, e1 + t * f1, e2 + t * f2,
            du * (x0 + t * (y0 - x0)) + dv * f0, du * (x1 + t * (y1 - x1)) + dv * f1,
            du * (x2 + t * (y2 - x2)) + dv * f2)


@part(fastmath=FAST)
def seen_color(image, colors, light_r, light_b, gray, u, v, du, dv):
    """
    Return the chromaticity that the left camera should see, and its slopes along (du, dv).

    colors, float32 (3, 4), takes the light of the pattern to that of the camera.

    """
    p, q, t, dp, dq, dt = color_at(image, u, v, du, dv)
    r = light_r * (colors[0, 0] * p + colors[0, 1] * q + colors[0, 2] * t + colors[0, 3])
    g = colors[1, 0] * p + colors[1, 1] * q + colors[1, 2] * t + colors[1, 3]
    b = light_b * (colors[2, 0] * p + colors[2, 1] * q + colors[2, 2] * t + colors[2, 3])
    dr = light_r * (colors[0, 0] * dp + colors[0, 1] * dq + colors[0, 2] * dt)
    dg = colors[1, 0] * dp + colors[1, 1] * dq + colors[1, 2] * dt
    db = light_b * (colors[2, 0] * dp + colors[2, 1] * dq + colors[2, 2] * dt)
    inverse = F4(1) / max(r + g + b, LEAST_LIGHT)
    color_u = (F4(2) * r - g - b) * inverse
    color_v = ROOT3 * (g - b) * inverse
    change = dr + dg + db
    slope_u = (F4(2) * dr - dg - db - color_u * change) * inverse
    slope_v = (ROOT3 * (dg - db) - color_v * change) * inverse
    return gray * color_u, gray * color_v, gray * slope_u, gray * slope_v


@banded(fastmath=FAST)
def linearize_sweep(k, left_u, left_v, left_var, image, colors, light, unrest, sweep, d, tiles,
                    region, robust_misfit, scale, phase, reference, weight, moment, misfit):
    """
    Compare the nodes of some tiles with the pattern, and linearize there; only those in region.

    As `plane_kernels.linearize`; the pattern has no noise. The variance of a color is scale unrest
    left_var + phase g.g. light, float32 (3, framed): red and blue against green, and the share of
    the color that is left. A place outside the pattern: weight = moment = 0, misfit NaN.

    """
    one = F4(1)
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        for y in range(top, top + TILE_ROWS):
            for x in range(left, left + TILE_COLUMNS):
                weight[y, x] = F4(0)
                moment[y, x] = F4(0)
                misfit[y, x] = NAN
                if not region[y, x]:
                    continue
                here = d[y, x]
                u, v, du, dv = place_of(sweep, F4(2 * (x - PAD)) + F4(0.5),
                                        F4(2 * (y - PAD)) + F4(0.5), here)
                noise = left_var[y, x]
                if within(image, u, v) & (noise < SILENT_VARIANCE):
                    color_u, color_v, slope_u, slope_v = seen_color(
                        image, colors, light[0, y, x], light[1, y, x], light[2, y, x], u, v, du,
                        dv)
                    error_u = left_u[y, x] - color_u
                    error_v = left_v[y, x] - color_v
                    steep = slope_u * slope_u + slope_v * slope_v
                    w = one / (scale * unrest[y, x] * noise + phase * steep)
                    chi = w * (error_u * error_u + error_v * error_v)
                    w = w / (one + chi / robust_misfit)
                    strength = w * steep
                    weight[y, x] = strength
                    moment[y, x] = (strength * (here - reference)
                                    + w * (slope_u * error_u + slope_v * error_v))
                    misfit[y, x] = chi


@banded(fastmath=FAST)
def sweep_misfits(k, left_u, left_v, left_var, image, colors, light, unrest, sweep, d, a, b,
                  step_y, step_x, tiles, region, scale, phase, cap, out):
    """
    Write the misfit of every node of some tiles under the plane of the node (step_y, step_x) away.

    At most cap, which also stands for what is unknown or not in region.

    """
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        for y in range(top, top + TILE_ROWS):
            for x in range(left, left + TILE_COLUMNS):
                out[y, x] = cap
                if not region[y, x]:
                    continue
                there_y, there_x = y + step_y, x + step_x
                here = (d[there_y, there_x] - a[there_y, there_x] * F4(step_x)
                        - b[there_y, there_x] * F4(step_y))
                u, v, du, dv = place_of(sweep, F4(2 * (x - PAD)) + F4(0.5),
                                        F4(2 * (y - PAD)) + F4(0.5), here)
                noise = left_var[y, x]
                if within(image, u, v) & (noise < SILENT_VARIANCE):
                    color_u, color_v, slope_u, slope_v = seen_color(
                        image, colors, light[0, y, x], light[1, y, x], light[2, y, x], u, v, du,
                        dv)
                    error_u = left_u[y, x] - color_u
                    error_v = left_v[y, x] - color_v
                    steep = slope_u * slope_u + slope_v * slope_v
                    chi = (error_u * error_u + error_v * error_v) / (
                        scale * unrest[y, x] * noise + phase * steep)
                    out[y, x] = min(chi, cap)


@banded(fastmath=FAST)
def take_better(k, d, a, b, step_y, step_x, tiles, cost, best, new_d, new_a, new_b):
    """Take the planes of the nodes (step_y, step_x) away where their cost is below best."""
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        for y in range(top, top + TILE_ROWS):
            for x in range(left, left + TILE_COLUMNS):
                there_y, there_x = y + step_y, x + step_x
                here = (d[there_y, there_x] - a[there_y, there_x] * F4(step_x)
                        - b[there_y, there_x] * F4(step_y))
                if (cost[y, x] < best[y, x]) & (here == here):
                    best[y, x] = cost[y, x]
                    new_d[y, x] = here
                    new_a[y, x] = a[there_y, there_x]
                    new_b[y, x] = b[there_y, there_x]


@banded(fastmath=FAST)
def pattern_colors(k, image, sweep, d, step, out):
    """Write red, green and blue of what lights every step-th node, float32 (3, h, w), or NaN."""
    rows, columns = out.shape[1:]
    first, last = band(k, rows)
    for row in range(first, last):
        for column in range(columns):
            y, x = step * row, step * column
            u, v, du, dv = place_of(sweep, F4(2 * x) + F4(0.5), F4(2 * y) + F4(0.5),
                                    d[y + PAD, x + PAD])
            if within(image, u, v):
                r, g, b, _, _, _ = color_at(image, u, v, du, dv)
                out[0, row, column], out[1, row, column], out[2, row, column] = r, g, b
            else:
                out[0, row, column] = NAN
                out[1, row, column] = NAN
                out[2, row, column] = NAN


@banded(fastmath=FAST)
def sweep_costs(k, left_u, left_v, trust, image, colors, light, known, sweep, offset, step,
                first_disparity, spacing, scale, cap, neutral, slope, cost):
    """
    Fill a volume, int16 (h, w, D), with the costs of the coarse nodes.

    Node (j, i) lies at x = offset + step i. The disparity of index n is first_disparity + n
    spacing, px. left_u, left_v int16, in units of 1 / scale; trust int16 0..16. known, float32
    (h, w): the index where stereo knows the disparity, NaN elsewhere; there the cost rises by slope
    for each index away from it. image is float32 (H, W, 3), interpolated linearly.

    """
    rows, columns, depth = cost.shape
    first, last = band(k, rows)
    width, height = image.shape[1], image.shape[0]
    for row in range(first, last):
        for column in range(columns):
            x, y = offset + step * F4(column), offset + step * F4(row)
            out = cost[row, column]
            if known[row, column] == known[row, column]:
                for n in range(depth):
                    away = slope * abs(F4(n) - known[row, column])
                    out[n] = I2(min(away, F4(cap)))
                continue
            own_u, own_v = F4(left_u[row, column]), F4(left_v[row, column])
            lr, lb = light[0, row, column], light[1, row, column]
            gray = light[2, row, column] * scale
            w = I2(trust[row, column])
            if w == 0:
                for n in range(depth):
                    out[n] = neutral
                continue
            for n in range(depth):
                u, v, _, _ = place_of(sweep, x, y, first_disparity + F4(n) * spacing)
                inside = (u >= F4(0)) & (v >= F4(0)) & (u < F4(width - 1)) & (v < F4(height - 1))
                u, v = u if inside else F4(0), v if inside else F4(0)
                p, q, o, _, _, _ = color_at(image, u, v, F4(0), F4(0))
                r = lr * (colors[0, 0] * p + colors[0, 1] * q + colors[0, 2] * o + colors[0, 3])
                g = colors[1, 0] * p + colors[1, 1] * q + colors[1, 2] * o + colors[1, 3]
                b = lb * (colors[2, 0] * p + colors[2, 1] * q + colors[2, 2] * o + colors[2, 3])
                norm = gray / max(r + g + b, LEAST_LIGHT)
                away = (abs(own_u - (F4(2) * r - g - b) * norm)
                        + abs(own_v - ROOT3 * (g - b) * norm))
                away = away if inside else F4(cap)
                value = I2(min(away, F4(cap)))
                out[n] = I2(neutral + (I2(I2(value - neutral) * w) >> I2(4)))


@banded()
def sum_windows(k, cost, out):
    """Sum a volume, int16 (h, w, D), over 3 x 3 nodes with weights 1, 2, 1, halved; sum 8."""
    rows, columns, depth = cost.shape
    first, last = band(k, rows)
    for y in range(first, last):
        above, below = max(y - 1, 0), min(y + 1, rows - 1)
        for x in range(columns):
            left, right = max(x - 1, 0), min(x + 1, columns - 1)
            total = out[y, x]
            a, b, c = cost[above, left], cost[above, x], cost[above, right]
            d, e, f = cost[y, left], cost[y, x], cost[y, right]
            g, h, i = cost[below, left], cost[below, x], cost[below, right]
            for n in range(depth):
                corners = I2(I2(a[n] + c[n]) + I2(g[n] + i[n]))
                sides = I2(I2(b[n] + d[n]) + I2(f[n] + h[n]))
                total[n] = I2((I4(corners) + I4(2) * I4(sides) + I4(4) * I4(e[n])) >> I4(1))


@part()
def follow(cost, path, small, large, total, add):
    """
    Go one step along a semi-global path, for all disparities of a node.

    path, int16 (D + 2), holds the costs of the last node less their lowest between two guards; it
    takes those of this one. Returns the lowest cost.

    """
    depth = cost.size
    before = path[0]
    least = LARGEST_COST
    for n in range(depth):
        here, after = path[n + 1], path[n + 2]
        step = min(min(here, I2(min(before, after) + small)), large)
        before = here
        value = I2(cost[n] + step)
        total[n] = I2(total[n] + value) if add else value
        path[n + 1] = value
        least = min(least, value)
    for n in range(depth):
        path[n + 1] = I2(path[n + 1] - least)
    return least


@banded()
def paths_along_rows(k, cost, small, large, guard, total, scratch):
    """Write the costs of the paths from the left and from the right; volumes int16 (h, w, D)."""
    rows, columns, depth = cost.shape
    first, last = band(k, rows)
    path = scratch[k, 0]
    for y in range(first, last):
        for backwards in range(2):
            path[:depth + 2] = I2(0)
            path[0] = guard
            path[depth + 1] = guard
            for n in range(columns):
                x = columns - 1 - n if backwards else n
                follow(cost[y, x], path[:depth + 2], small, large, total[y, x], backwards == 1)


@banded()
def paths_along_columns(k, cost, small, large, guard, total, scratch):
    """Add the costs of the paths from above and from below; volumes int16 (h, w, D)."""
    rows, columns, depth = cost.shape
    first, last = band(k, columns)
    for backwards in range(2):
        for x in range(first, last):
            path = scratch[k, x - first]
            path[:depth + 2] = I2(0)
            path[0] = guard
            path[depth + 1] = guard
        for n in range(rows):
            y = rows - 1 - n if backwards else n
            for x in range(first, last):
                follow(cost[y, x], scratch[k, x - first, :depth + 2], small, large, total[y, x],
                       True)


@banded()
def cheapest_disparities(k, total, distance, best, gap):
    """
    Write the index of the lowest cost of every node, refined by a V, and the gap to a rival.

    A rival is more than `distance` indices away.

    """
    rows, columns, depth = total.shape
    first, last = band(k, rows)
    for y in range(first, last):
        for x in range(columns):
            costs = total[y, x]
            at, least = 0, I4(LARGEST_COST)
            for n in range(depth):
                if costs[n] < least:
                    least = I4(costs[n])
                    at = n
            rival = I4(LARGEST_COST)
            for n in range(depth):
                if abs(n - at) > distance:
                    rival = min(rival, I4(costs[n]))
            place = F4(at)
            if 0 < at < depth - 1:
                before, after = I4(costs[at - 1]), I4(costs[at + 1])
                rise = max(before, after) - least
                if rise > 0:
                    place += F4(0.5) * F4(before - after) / F4(rise)
            best[y, x] = place
            gap[y, x] = F4(rival - least)


@serial(fastmath=FAST)
def claim_places(d, odds, sweep, rows, columns, cell, best, owner):
    """
    Let every node claim the place of the pattern that lights it; the one of the best odds gets it.

    best, float32 (h, w), takes the odds and owner, float32 (h, w), the disparity of the node that
    gets a cell of `cell` pixels of the pattern; -inf and NaN where nobody claims it.

    """
    best[:] = -F4(np.inf)
    owner[:] = NAN
    height, width = best.shape
    for row in range(rows):
        for column in range(columns):
            here = d[row + PAD, column + PAD]
            u, v, _, _ = place_of(sweep, F4(2 * column) + F4(0.5), F4(2 * row) + F4(0.5), here)
            if (u >= F4(0)) & (v >= F4(0)):
                i, j = I4(u / cell), I4(v / cell)
                if (i < width) & (j < height):
                    if odds[row, column] > best[j, i]:
                        best[j, i] = odds[row, column]
                        owner[j, i] = here


@banded(fastmath=FAST)
def find_contested(k, d, sweep, rows, columns, cell, distance, best, owner, contested):
    """
    Write the odds of another surface that claims the same place of the pattern, at least 0.

    Another surface differs by more than `distance`, px, in disparity. contested is float32 (rows,
    columns).

    """
    height, width = best.shape
    first, last = band(k, rows)
    for row in range(first, last):
        for column in range(columns):
            here = d[row + PAD, column + PAD]
            u, v, _, _ = place_of(sweep, F4(2 * column) + F4(0.5), F4(2 * row) + F4(0.5), here)
            contested[row, column] = F4(0)
            if (u >= F4(0)) & (v >= F4(0)):
                i, j = I4(u / cell), I4(v / cell)
                if (i < width) & (j < height):
                    if abs(owner[j, i] - here) > distance:
                        contested[row, column] = max(best[j, i], F4(0))
