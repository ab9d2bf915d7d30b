# SPDX-License-Identifier: Apache-2.0
"""
Kernels of the third view: nodes of the left image against the pattern.

A node (column i, row j of the half grid) at a disparity d is lit by the place

    (U, V, W) = sweep (x, y, 1, d),  x = 2 i + 0.5,  y = 2 j + 0.5;   u = U / W,  v = V / W

of the pattern, px: the disparity of the two cameras stands for the distance. The right camera
takes no part. Pattern images are uint32 (H W,): red, green and blue of the linear light of the
projector in the three lowest bytes, so that a place costs four loads.

"""

import math

import numpy as np

from ...compiled import (
    band, banded, LENGTH, part, serial, stack_array, stack_integers, stack_row)
from ..grid_kernels import F4, FAST, I4, NAN, PAD, SILENT_VARIANCE, TILE_COLUMNS, TILE_ROWS, U4
from .tuning import TUNING

I2 = np.int16
ROOT3 = F4(math.sqrt(3.0))
# Constants of `tuning`, compiled into the kernels.
LEAST_DEPTH = F4(TUNING.sweep.least_depth)
FAR_OUTSIDE = F4(TUNING.sweep.far_outside)
UNIT = F4(TUNING.sweep.unit)
MARGIN = F4(TUNING.color.margin)
LEAST_LIGHT = F4(TUNING.color.least_light)
LARGEST = I2(32767)
stack_pixels = stack_array(U4, LENGTH)
PATHS = 2  # of what is needed of a coarse node: paths; 1: its costs only; 0: nothing


@part()
def numbers(matrix):
    """Return the twelve entries of a matrix (3, 4), a tuple: loops keep them in registers."""
    return (matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[0, 3],
            matrix[1, 0], matrix[1, 1], matrix[1, 2], matrix[1, 3],
            matrix[2, 0], matrix[2, 1], matrix[2, 2], matrix[2, 3])


@part(fastmath=FAST)
def red_of(pixel):
    """Return the red of a packed pixel, 0..255."""
    return F4(I4(pixel & U4(255)))


@part(fastmath=FAST)
def green_of(pixel):
    """Return the green of a packed pixel, 0..255."""
    return F4(I4((pixel >> U4(8)) & U4(255)))


@part(fastmath=FAST)
def blue_of(pixel):
    """Return the blue of a packed pixel, 0..255."""
    return F4(I4((pixel >> U4(16)) & U4(255)))


@part(fastmath=FAST)
def see(flat, size, m, c, margin, count, xs, y, ds, red, blue, gray, color_u, color_v, slope_u,
        slope_v):
    """
    Write the chromaticities that the left camera should see at some nodes, and their slopes.

    Nodes lie at (xs[n], y) and have disparities ds[n]; red, blue and gray are their light. The
    slopes are those against d. color_u is NaN where a place lies outside the pattern. The pattern
    is interpolated linearly: it is blurred so far that this is off by 1 % of the contrast. m and c
    are `numbers` of the sweep and of the map of the colors. Parts that return several numbers,
    and stores to arrays that might overlap, would keep the loop from being vectorized.

    """
    height, width = size[0], I4(size[1])
    last_u, last_v = F4(width - 1) - margin, F4(height - 1) - margin
    one, two = F4(1), F4(2)
    us, vs, gus, gvs = stack_row(), stack_row(), stack_row(), stack_row()
    ss, ts, dus, dvs = stack_row(), stack_row(), stack_row(), stack_row()
    places, pixels0, pixels1 = stack_pixels(), stack_pixels(), stack_pixels()
    pixels2, pixels3 = stack_pixels(), stack_pixels()
    for n in range(count):
        x, d = xs[n], ds[n]
        depth = m[8] * x + m[9] * y + m[10] + m[11] * d
        inverse = one / (depth if depth > LEAST_DEPTH else LEAST_DEPTH)
        u = (m[0] * x + m[1] * y + m[2] + m[3] * d) * inverse
        v = (m[4] * x + m[5] * y + m[6] + m[7] * d) * inverse
        inside = ((depth > LEAST_DEPTH) & (u >= margin) & (v >= margin) & (u < last_u)
                  & (v < last_v))
        u, v = u if inside else F4(0), v if inside else F4(0)
        i, j = I4(u), I4(v)
        us[n] = F4(0) if inside else NAN
        ss[n], ts[n] = u - F4(i), v - F4(j)
        dus[n], dvs[n] = (m[3] - u * m[11]) * inverse, (m[7] - v * m[11]) * inverse
        places[n] = U4(j * width + i)
    # some processors gather slowly: then LLVM would make no SIMD of what is around
    for n in range(count):
        at = places[n]
        below = U4(at + U4(width))
        pixels0[n], pixels1[n] = flat[at], flat[U4(at + U4(1))]
        pixels2[n], pixels3[n] = flat[below], flat[U4(below + U4(1))]
    for n in range(count):
        s, t, du, dv = ss[n], ts[n], dus[n], dvs[n]
        p0, p1, p2, p3 = pixels0[n], pixels1[n], pixels2[n], pixels3[n]
        upper, lower = red_of(p1) - red_of(p0), red_of(p3) - red_of(p2)
        top = red_of(p0) + s * upper
        down = red_of(p2) + s * lower - top
        p, dp = top + t * down, du * (upper + t * (lower - upper)) + dv * down
        upper, lower = green_of(p1) - green_of(p0), green_of(p3) - green_of(p2)
        top = green_of(p0) + s * upper
        down = green_of(p2) + s * lower - top
        q, dq = top + t * down, du * (upper + t * (lower - upper)) + dv * down
        upper, lower = blue_of(p1) - blue_of(p0), blue_of(p3) - blue_of(p2)
        top = blue_of(p0) + s * upper
        down = blue_of(p2) + s * lower - top
        o, do = top + t * down, du * (upper + t * (lower - upper)) + dv * down
        p, q, o, dp, dq, do = UNIT * p, UNIT * q, UNIT * o, UNIT * dp, UNIT * dq, UNIT * do
        r = red[n] * (c[0] * p + c[1] * q + c[2] * o + c[3])
        g = c[4] * p + c[5] * q + c[6] * o + c[7]
        b = blue[n] * (c[8] * p + c[9] * q + c[10] * o + c[11])
        dr = red[n] * (c[0] * dp + c[1] * dq + c[2] * do)
        dg = c[4] * dp + c[5] * dq + c[6] * do
        db = blue[n] * (c[8] * dp + c[9] * dq + c[10] * do)
        total = r + g + b
        share = one / (total if total > LEAST_LIGHT else LEAST_LIGHT)
        own_u, own_v = (two * r - g - b) * share, ROOT3 * (g - b) * share
        change = dr + dg + db
        us[n] += gray[n] * own_u  # NaN stays
        vs[n] = gray[n] * own_v
        gus[n] = gray[n] * (two * dr - dg - db - own_u * change) * share
        gvs[n] = gray[n] * (ROOT3 * (dg - db) - own_v * change) * share
    for n in range(count):
        color_u[n] = us[n]
        color_v[n] = vs[n]
        slope_u[n] = gus[n]
        slope_v[n] = gvs[n]


@banded(fastmath=FAST)
def places_of_nodes(k, sweep, d, step, out):
    """Write column and row of the pattern, px, of every step-th node, float32 (2, h, w)."""
    m = numbers(sweep)
    first, last = band(k, out.shape[1])
    for row in range(first, last):
        y = F4(2 * step * row) + F4(0.5)
        here, us, vs = d[PAD + step * row], out[0, row], out[1, row]
        for column in range(us.size):
            x, value = F4(2 * step * column) + F4(0.5), here[PAD + step * column]
            depth = m[8] * x + m[9] * y + m[10] + m[11] * value
            ahead = depth > LEAST_DEPTH
            inverse = F4(1) / (depth if ahead else LEAST_DEPTH)
            u = (m[0] * x + m[1] * y + m[2] + m[3] * value) * inverse
            us[column] = u if ahead else FAR_OUTSIDE
            vs[column] = (m[4] * x + m[5] * y + m[6] + m[7] * value) * inverse


@part()
def any_below(values, bounds):
    """Return whether any entry is smaller than its bound; NaN is not."""
    found = False
    for x in range(values.size):
        found |= values[x] < bounds[x]
    return found


@banded(fastmath=FAST)
def linearize_sweep(k, left_u, left_v, left_var, flat, size, colors, light, unrest, sweep, d,
                    tiles, region, robust_misfit, scale, phase, reference, known_weight,
                    known_moment, weight, moment, misfit):
    """
    Compare the nodes of some tiles with the pattern, and linearize there; only those in region.

    As `plane_kernels.linearize`; the pattern has no noise. The variance of a color is scale unrest
    left_var + phase g.g. light, float32 (3, framed): red and blue against green, and the share of
    the color that is left. known_weight and known_moment are what is
    known of the nodes otherwise; they are added. The misfit of places outside the pattern is NaN.
    flat is the pattern image of size (height, width).

    """
    one = F4(1)
    m, c = numbers(sweep), numbers(colors)
    at, weights, moments, misfits = stack_integers(), stack_row(), stack_row(), stack_row()
    own_u, own_v, noises = stack_row(), stack_row(), stack_row()
    xs, ds, red, blue, gray = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    color_u, color_v, slope_u, slope_v = stack_row(), stack_row(), stack_row(), stack_row()
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        right = left + TILE_COLUMNS
        for y in range(top, top + TILE_ROWS):
            out_weight, out_moment = weight[y, left:right], moment[y, left:right]
            out_misfit = misfit[y, left:right]
            for x in range(left, right):
                weight[y, x], moment[y, x] = known_weight[y, x], known_moment[y, x]
                misfit[y, x] = NAN
            count = 0
            for x in range(left, right):
                if region[y, x] & (left_var[y, x] < SILENT_VARIANCE):
                    at[count] = I2(x - left)
                    xs[count] = F4(2 * (x - PAD)) + F4(0.5)
                    ds[count] = d[y, x]
                    red[count], blue[count], gray[count] = (light[0, y, x], light[1, y, x],
                                                            light[2, y, x])
                    own_u[count], own_v[count] = left_u[y, x], left_v[y, x]
                    noises[count] = scale * unrest[y, x] * left_var[y, x]
                    count += 1
            if count == 0:
                continue
            whole = (count + 7) & ~7  # vectors of 8; what is left from before is not used
            see(flat, size, m, c, MARGIN, whole, xs, F4(2 * (y - PAD)) + F4(0.5), ds, red, blue,
                gray, color_u, color_v, slope_u, slope_v)
            for n in range(whole):
                error_u, error_v = own_u[n] - color_u[n], own_v[n] - color_v[n]
                steep = slope_u[n] * slope_u[n] + slope_v[n] * slope_v[n]
                w = one / (noises[n] + phase * steep)
                chi = w * (error_u * error_u + error_v * error_v)
                w = w / (one + chi / robust_misfit)
                weights[n] = w * steep
                moments[n] = (w * steep * (ds[n] - reference)
                              + w * (slope_u[n] * error_u + slope_v[n] * error_v))
                misfits[n] = chi
            for n in range(count):
                if color_u[n] == color_u[n]:
                    x = at[n]
                    out_weight[x] += weights[n]
                    out_moment[x] += moments[n]
                    out_misfit[x] = misfits[n]


@banded(fastmath=FAST)
def sweep_misfits(k, left_u, left_v, left_var, flat, size, colors, light, unrest, sweep, d, a, b,
                  step_y, step_x, tiles, region, scale, phase, cap, out):
    """
    Write the misfit of every node of some tiles under the plane of the node (step_y, step_x) away.

    At most cap, which also stands for what is unknown or not in region.

    """
    m, c = numbers(sweep), numbers(colors)
    at, misfits = stack_integers(), stack_row()
    own_u, own_v, noises = stack_row(), stack_row(), stack_row()
    xs, ds, red, blue, gray = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    color_u, color_v, slope_u, slope_v = stack_row(), stack_row(), stack_row(), stack_row()
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        right = left + TILE_COLUMNS
        for y in range(top, top + TILE_ROWS):
            out_misfit = out[y, left:right]
            out_misfit[:] = cap
            there, count = y + step_y, 0
            for x in range(left, right):
                if region[y, x] & (left_var[y, x] < SILENT_VARIANCE):
                    at[count] = I2(x - left)
                    xs[count] = F4(2 * (x - PAD)) + F4(0.5)
                    ds[count] = (d[there, x + step_x] - a[there, x + step_x] * F4(step_x)
                                 - b[there, x + step_x] * F4(step_y))
                    red[count], blue[count], gray[count] = (light[0, y, x], light[1, y, x],
                                                            light[2, y, x])
                    own_u[count], own_v[count] = left_u[y, x], left_v[y, x]
                    noises[count] = scale * unrest[y, x] * left_var[y, x]
                    count += 1
            if count == 0:
                continue
            whole = (count + 7) & ~7
            see(flat, size, m, c, MARGIN, whole, xs, F4(2 * (y - PAD)) + F4(0.5), ds, red, blue,
                gray, color_u, color_v, slope_u, slope_v)
            for n in range(whole):
                error_u, error_v = own_u[n] - color_u[n], own_v[n] - color_v[n]
                steep = slope_u[n] * slope_u[n] + slope_v[n] * slope_v[n]
                misfits[n] = (error_u * error_u + error_v * error_v) / (
                    noises[n] + phase * steep)
            for n in range(count):
                if misfits[n] < cap:
                    out_misfit[at[n]] = misfits[n]


@banded(fastmath=FAST)
def take_better(k, d, a, b, step_y, step_x, tiles, cost, best, new_d, new_a, new_b):
    """Take the planes of the nodes (step_y, step_x) away where their cost is below best."""
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        right, begin = left + TILE_COLUMNS, left + step_x
        stop = begin + TILE_COLUMNS
        for y in range(top, top + TILE_ROWS):
            costs, least = cost[y, left:right], best[y, left:right]
            if not any_below(costs, least):
                continue
            there = y + step_y
            dd, aa, bb = d[there, begin:stop], a[there, begin:stop], b[there, begin:stop]
            out_d, out_a, out_b = (new_d[y, left:right], new_a[y, left:right],
                                   new_b[y, left:right])
            for x in range(TILE_COLUMNS):
                here = dd[x] - aa[x] * F4(step_x) - bb[x] * F4(step_y)
                if (costs[x] < least[x]) & (here == here):
                    least[x] = costs[x]
                    out_d[x] = here
                    out_a[x] = aa[x]
                    out_b[x] = bb[x]


@banded(fastmath=FAST)
def sweep_costs(k, left_u, left_v, trust, flat, size, colors, light, known, needed, sweep, offset,
                step, first_disparity, spacing, scale, cap, neutral, slope, cost):
    """
    Fill a volume, int16 (h, w, D), with the costs of the coarse nodes that are needed, not 0.

    Node (j, i) lies at x = offset + step i. The disparity of index n is first_disparity + n
    spacing, px. left_u, left_v int16, in units of 1 / scale; trust int16 0..16. known, float32
    (h, w): the index where two cameras know the disparity, NaN elsewhere; there the cost rises by
    slope for each index away from it.

    """
    rows, columns, depth = cost.shape
    first, last = band(k, rows)
    full = F4(cap)
    m, c = numbers(sweep), numbers(colors)
    some, xs, ds = stack_integers(), stack_row(), stack_row()
    red, blue, gray = stack_row(), stack_row(), stack_row()
    color_u, color_v, slope_u, slope_v = stack_row(), stack_row(), stack_row(), stack_row()
    for row in range(first, last):
        for column in range(columns):
            if needed[row, column] == 0:
                continue
            out = cost[row, column]
            if known[row, column] == known[row, column]:
                for n in range(depth):
                    away = slope * abs(F4(n) - known[row, column])
                    out[n] = I2(away if away < full else full)
                continue
            w = I2(trust[row, column])
            if w == 0:
                for n in range(depth):
                    out[n] = neutral
                continue
            own_u, own_v = F4(left_u[row, column]), F4(left_v[row, column])
            for n in range(LENGTH):
                xs[n] = offset + step * F4(column)
                red[n], blue[n] = light[0, row, column], light[1, row, column]
                gray[n] = light[2, row, column] * scale
            for start in range(0, depth, LENGTH):
                count = min(LENGTH, depth - start)
                whole = (count + 7) & ~7  # vectors of 8
                for n in range(whole):
                    ds[n] = first_disparity + F4(start + n) * spacing
                see(flat, size, m, c, F4(0), whole, xs, offset + step * F4(row), ds, red, blue,
                    gray, color_u, color_v, slope_u, slope_v)
                for n in range(whole):
                    away = abs(own_u - color_u[n]) + abs(own_v - color_v[n])
                    away = away if away < full else full
                    some[n] = I2(neutral + (I2(I2(I2(away) - neutral) * w) >> I2(4)))
                for n in range(count):
                    out[start + n] = some[n]


@banded()
def sum_windows(k, cost, needed, out):
    """
    Sum a volume, int16 (h, w, D), over 3 x 3 nodes with weights 1, 2, 1, halved; sum 8.

    Only at nodes where needed, uint8 (h, w), is PATHS.

    """
    rows, columns, depth = cost.shape
    first, last = band(k, rows)
    for y in range(first, last):
        above, below = max(y - 1, 0), min(y + 1, rows - 1)
        for x in range(columns):
            if needed[y, x] != PATHS:
                continue
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
    least = LARGEST
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
def paths_along_rows(k, cost, needed, small, large, guard, total, scratch):
    """
    Write the costs of the paths from the left and from the right; volumes int16 (h, w, D).

    Paths begin anew after nodes where needed, uint8 (h, w), is not PATHS.

    """
    rows, columns, depth = cost.shape
    first, last = band(k, rows)
    path = scratch[k, 0]
    for y in range(first, last):
        for backwards in range(2):
            path[:depth + 2] = I2(0)
            path[0] = guard
            path[depth + 1] = guard
            whole = True
            for n in range(columns):
                x = columns - 1 - n if backwards else n
                if needed[y, x] != PATHS:
                    whole = False
                    continue
                if not whole:
                    path[1:depth + 1] = I2(0)
                    whole = True
                follow(cost[y, x], path[:depth + 2], small, large, total[y, x], backwards == 1)


@banded()
def paths_along_columns(k, cost, needed, small, large, guard, total, scratch):
    """Add the costs of the paths from above and from below; see `paths_along_rows`."""
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
            before = min(max(y + 1 if backwards else y - 1, 0), rows - 1)
            for x in range(first, last):
                if needed[y, x] != PATHS:
                    continue
                if needed[before, x] != PATHS:
                    scratch[k, x - first, 1:depth + 1] = I2(0)
                follow(cost[y, x], scratch[k, x - first, :depth + 2], small, large, total[y, x],
                       True)


@banded()
def cheapest_disparities(k, total, known, needed, best):
    """
    Write the index of the lowest cost of every node of a volume (h, w, D), refined by a V.

    Where needed, uint8 (h, w), is not PATHS, the known index is written, float32 (h, w); where
    this is NaN, that of the last node of the row.

    """
    rows, columns, depth = total.shape
    first, last = band(k, rows)
    for y in range(first, last):
        place = F4(0)
        for x in range(columns):
            if needed[y, x] != PATHS:
                place = known[y, x] if known[y, x] == known[y, x] else place
                best[y, x] = place
                continue
            costs = total[y, x]
            least = LARGEST
            for n in range(depth):
                least = min(least, costs[n])
            at = 0
            while costs[at] != least:
                at += 1
            place = F4(at)
            if 0 < at < depth - 1:
                before, after = I4(costs[at - 1]), I4(costs[at + 1])
                rise = max(before, after) - I4(least)
                if rise > 0:
                    place += F4(0.5) * F4(before - after) / F4(rise)
            best[y, x] = place


@serial()
def claim_places(d, odds, places, cell, best, owner):
    """
    Let every node claim the place of the pattern that lights it; the one of the best odds gets it.

    d, odds are float32 (rows, columns), places float32 (2, rows, columns), px. best, float32 (h,
    w), takes the odds and owner, float32 (h, w), the disparity of the node that gets a cell of
    `cell` pixels of the pattern; -inf and NaN where nobody claims it.

    """
    best[:] = -F4(np.inf)
    owner[:] = NAN
    height, width = best.shape
    rows, columns = odds.shape
    for row in range(rows):
        for column in range(columns):
            u, v = places[0, row, column], places[1, row, column]
            if (u >= F4(0)) & (v >= F4(0)):
                i, j = I4(u / cell), I4(v / cell)
                if (i < width) & (j < height):
                    if odds[row, column] > best[j, i]:
                        best[j, i] = odds[row, column]
                        owner[j, i] = d[row, column]


@banded()
def find_contested(k, d, places, cell, distance, best, owner, contested):
    """
    Write the odds of another surface that claims the same place of the pattern, at least 0.

    Another surface differs by more than `distance`, px, in disparity. contested is float32 (rows,
    columns).

    """
    height, width = best.shape
    rows, columns = contested.shape
    first, last = band(k, rows)
    for row in range(first, last):
        for column in range(columns):
            u, v = places[0, row, column], places[1, row, column]
            contested[row, column] = F4(0)
            if (u >= F4(0)) & (v >= F4(0)):
                i, j = I4(u / cell), I4(v / cell)
                if (i < width) & (j < height):
                    if abs(owner[j, i] - d[row, column]) > distance:
                        contested[row, column] = max(best[j, i], F4(0))
