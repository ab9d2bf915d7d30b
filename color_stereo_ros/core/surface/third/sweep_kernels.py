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
Kernels of the third view: nodes of the left image against the pattern.

A node (column i, row j of the half grid) at a disparity d is lit by the place

    (U, V, W) = sweep (x, y, 1, d),  x = 2 i + 0.5,  y = 2 j + 0.5;   u = U / W,  v = V / W

of the pattern, px: the disparity of the two cameras stands for the distance. The right camera
takes no part. Pattern images are uint32 (H W,): red, green and blue of the linear light of the
projector in the three lowest bytes, so that a place costs four loads.

"""

import math

import numpy as np

from .fitting_kernels import any_of
from .tuning import TUNING
from ..coarse_kernels import smaller_step
from ..grid_kernels import F4, FAST, I4, NAN, PAD, SILENT_VARIANCE, U4
from ...compiled import (
    band, banded, LENGTH, part, serial, stack_array, stack_integers, stack_row)

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
def find_pixels(flat, size, m, margin, count, xs, ys, ds, us, ss, ts, dus, dvs, pixels0, pixels1,
                pixels2, pixels3):
    """
    Write which pixels of the pattern surround the places that light some nodes, and where between.

    Nodes lie at (xs[n], ys[n]) and have disparities ds[n]. us is 0, and NaN where a place lies
    outside the pattern; ss, ts are the fractions, dus, dvs the slopes of the place against d. m is
    `numbers` of the sweep.

    """
    height, width = size[0], I4(size[1])
    last_u, last_v = F4(width - 1) - margin, F4(height - 1) - margin
    one = F4(1)
    places = stack_pixels()
    for n in range(count):
        x, y, d = xs[n], ys[n], ds[n]
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


@part(fastmath=FAST)
def see_along(thin, share, size, m, c, x, y, light, first, spacing, count, color_u, color_v):
    """
    Write the chromaticities that a node should have at disparities first, first + spacing, ...

    The node lies at (x, y); light holds its three numbers, m and c are `numbers` of the sweep and
    of the map of the colors. thin is the pattern of that size, reduced to a share of its width.
    The nearest pixel counts: neighboring disparities lie several pixels apart. NaN where a place
    lies outside the pattern.

    """
    one, two, half = F4(1), F4(2), F4(0.5)
    last_u, last_v, width = F4(size[1] - 1), F4(size[0] - 1), I4(thin.shape[1])
    flat = thin.reshape(-1)
    base_u, base_v = m[0] * x + m[1] * y + m[2], m[4] * x + m[5] * y + m[6]
    base = m[8] * x + m[9] * y + m[10]
    us, vs, places, pixels = stack_row(), stack_row(), stack_pixels(), stack_pixels()
    for n in range(count):
        d = first + F4(n) * spacing
        depth = base + m[11] * d
        inverse = one / (depth if depth > LEAST_DEPTH else LEAST_DEPTH)
        u, v = (base_u + m[3] * d) * inverse, (base_v + m[7] * d) * inverse
        inside = ((depth > LEAST_DEPTH) & (u >= F4(0)) & (v >= F4(0)) & (u < last_u)
                  & (v < last_v))
        u, v = u if inside else F4(0), v if inside else F4(0)
        us[n] = F4(0) if inside else NAN
        places[n] = U4(I4((v + half) * share) * width + I4((u + half) * share))
    for n in range(count):  # some processors gather slowly, see `find_pixels`
        pixels[n] = flat[places[n]]
    for n in range(count):
        pixel = pixels[n]
        p, q, o = UNIT * red_of(pixel), UNIT * green_of(pixel), UNIT * blue_of(pixel)
        r = light[0] * (c[0] * p + c[1] * q + c[2] * o + c[3])
        g = c[4] * p + c[5] * q + c[6] * o + c[7]
        b = light[1] * (c[8] * p + c[9] * q + c[10] * o + c[11])
        total = r + g + b
        gain = light[2] / (total if total > LEAST_LIGHT else LEAST_LIGHT)
        us[n] += (two * r - g - b) * gain  # NaN stays
        vs[n] = ROOT3 * (g - b) * gain
    for n in range(count):
        color_u[n] = us[n]
        color_v[n] = vs[n]


@part(fastmath=FAST)
def see(flat, size, m, c, margin, count, xs, ys, ds, red, blue, gray, color_u, color_v, slope_u,
        slope_v):
    """
    Write the chromaticities that the left camera should see at some nodes, and their slopes.

    Nodes as in `find_pixels`; red, blue and gray are their light. The slopes are those against d.
    color_u is NaN where a place lies outside the pattern. The pattern is interpolated linearly: it
    is blurred so far that this is off by 1 % of the contrast. m and c are `numbers` of the sweep
    and of the map of the colors. Parts that return several numbers, and stores to arrays that
    might overlap, would keep the loop from being vectorized.

    """
    one, two = F4(1), F4(2)
    us, vs, gus, gvs = stack_row(), stack_row(), stack_row(), stack_row()
    ss, ts, dus, dvs = stack_row(), stack_row(), stack_row(), stack_row()
    pixels0, pixels1 = stack_pixels(), stack_pixels()
    pixels2, pixels3 = stack_pixels(), stack_pixels()
    find_pixels(flat, size, m, margin, count, xs, ys, ds, us, ss, ts, dus, dvs, pixels0, pixels1,
                pixels2, pixels3)
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


@banded()
def count_nodes(k, wanted, left_var, counts):
    """Count the wanted nodes of every row whose color says something; see `list_nodes`."""
    rows, columns = wanted.shape
    first, last = band(k, rows)
    for y in range(first, last):
        looked, variances, count = wanted[y], left_var[y], 0
        for x in range(columns):
            count += 1 if looked[x] & (variances[x] < SILENT_VARIANCE) else 0
        counts[y] = count


@banded()
def list_nodes(k, wanted, starts, left_u, left_v, left_var, light, unrest, scale, nodes, told):
    """
    List the wanted nodes whose color says something, and what does not change with their planes.

    wanted bool, framed; starts int64: how many there are in the rows above a row. nodes int32 (N,)
    takes their place in flat framed arrays, told float32 (8, N) column and row of the left image,
    px, both chromaticities, the variance of these (scale unrest left_var), and the three numbers
    of light, float32 (3, framed): red and blue against green, and the share of the color that is
    left.

    """
    rows, columns = wanted.shape
    first, last = band(k, rows)
    xs, ys, own_u, own_v, noises = told[0], told[1], told[2], told[3], told[4]
    red, blue, gray = told[5], told[6], told[7]
    for y in range(first, last):
        n, row = starts[y], F4(2 * (y - PAD)) + F4(0.5)
        looked, us, vs, variances = wanted[y], left_u[y], left_v[y], left_var[y]
        factors, reds, blues, grays = unrest[y], light[0, y], light[1, y], light[2, y]
        for x in range(columns):
            if looked[x] and variances[x] < SILENT_VARIANCE:
                nodes[n] = I4(y * columns + x)
                xs[n], ys[n] = F4(2 * (x - PAD)) + F4(0.5), row
                own_u[n], own_v[n] = us[x], vs[x]
                noises[n] = scale * factors[x] * variances[x]
                red[n], blue[n], gray[n] = reds[x], blues[x], grays[x]
                n += 1


@part(fastmath=FAST)
def read_block(told, start, count, xs, ys, own_u, own_v, noises, red, blue, gray):
    """Copy what `list_nodes` told of count nodes from start on: stores into rows keep SIMD."""
    for n in range(count):
        xs[n], ys[n] = told[0, start + n], told[1, start + n]
        own_u[n], own_v[n] = told[2, start + n], told[3, start + n]
        noises[n], red[n] = told[4, start + n], told[5, start + n]
        blue[n], gray[n] = told[6, start + n], told[7, start + n]


@banded(fastmath=FAST)
def linearize_sweep(k, nodes, told, flat, size, colors, sweep, d, robust_misfit, phase, reference,
                    weight, moment, misfit):
    """
    Compare listed nodes with the pattern, and linearize there; others keep what they have.

    As `plane_kernels.linearize`; the pattern has no noise. nodes and told as `list_nodes` writes
    them; d, weight, moment and misfit are flat. The variance of a color is that of the list +
    phase g.g. Places outside the pattern tell nothing, and their misfit is NaN. flat is the
    pattern image of size (height, width).

    """
    one = F4(1)
    m, c = numbers(sweep), numbers(colors)
    weights, moments, misfits = stack_row(), stack_row(), stack_row()
    own_u, own_v, noises = stack_row(), stack_row(), stack_row()
    xs, ys, ds, red, blue, gray = (stack_row(), stack_row(), stack_row(), stack_row(), stack_row(),
                                   stack_row())
    color_u, color_v, slope_u, slope_v = stack_row(), stack_row(), stack_row(), stack_row()
    first, last = band(k, (nodes.size + LENGTH - 1) // LENGTH)
    for block in range(first, last):
        start = block * LENGTH
        count = min(LENGTH, nodes.size - start)
        whole = (count + 7) & ~7  # vectors of 8; what is left from before is not used
        read_block(told, start, count, xs, ys, own_u, own_v, noises, red, blue, gray)
        for n in range(count):
            ds[n] = d[nodes[start + n]]
        see(flat, size, m, c, MARGIN, whole, xs, ys, ds, red, blue, gray, color_u, color_v,
            slope_u, slope_v)
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
            at, seen = nodes[start + n], color_u[n] == color_u[n]
            weight[at] = weights[n] if seen else F4(0)
            moment[at] = moments[n] if seen else F4(0)
            misfit[at] = misfits[n] if seen else NAN


@banded(fastmath=FAST)
def sweep_misfits(k, nodes, told, flat, size, colors, sweep, d, a, b, steps, width, phase, cap,
                  out):
    """
    Write the misfits of all listed nodes under the planes of nodes around, float32 (M, N).

    steps, int64 (M, 2): how many rows below and columns to the right these nodes lie. At most cap,
    which also stands for what is unknown. nodes and told as `list_nodes` writes them; d, a and b
    are flat, of rows of a width. Planes of neighbors lead to places nearby: the pattern is read
    once.

    """
    m, c = numbers(sweep), numbers(colors)
    own_u, own_v, noises = stack_row(), stack_row(), stack_row()
    xs, ys, ds, red, blue, gray = (stack_row(), stack_row(), stack_row(), stack_row(), stack_row(),
                                   stack_row())
    color_u, color_v, slope_u, slope_v = stack_row(), stack_row(), stack_row(), stack_row()
    first, last = band(k, (nodes.size + LENGTH - 1) // LENGTH)
    for block in range(first, last):
        start = block * LENGTH
        count = min(LENGTH, nodes.size - start)
        whole = (count + 7) & ~7
        read_block(told, start, count, xs, ys, own_u, own_v, noises, red, blue, gray)
        for which in range(steps.shape[0]):
            shift = steps[which, 0] * width + steps[which, 1]
            down, along = F4(steps[which, 0]), F4(steps[which, 1])
            for n in range(count):
                at = nodes[start + n] + shift
                ds[n] = d[at] - a[at] * along - b[at] * down
            see(flat, size, m, c, MARGIN, whole, xs, ys, ds, red, blue, gray, color_u, color_v,
                slope_u, slope_v)
            misfits = out[which, start:start + count]
            for n in range(count):
                error_u, error_v = own_u[n] - color_u[n], own_v[n] - color_v[n]
                steep = slope_u[n] * slope_u[n] + slope_v[n] * slope_v[n]
                chi = (error_u * error_u + error_v * error_v) / (noises[n] + phase * steep)
                ds[n] = chi if chi < cap else cap
            for n in range(count):
                misfits[n] = ds[n]


@banded()
def put_nodes(k, nodes, values, out):
    """Write the values of listed nodes, (N,), to their places in a flat array."""
    first, last = band(k, nodes.size)
    for n in range(first, last):
        out[nodes[n]] = values[n]


@serial()
def shorten_list(nodes, told, wanted, some, some_told):
    """
    List those of listed nodes that are wanted, bool flat; return how many there are.

    nodes and told as in `list_nodes`. some takes the places, and some_told, flat, what is told of
    them, one kind after the other.

    """
    count = 0
    for n in range(nodes.size):
        if wanted[nodes[n]]:
            some[count] = nodes[n]
            some_told[count] = F4(n)  # for now
            count += 1
    for i in range(told.shape[0] - 1, -1, -1):
        for n in range(count):
            some_told[i * count + n] = told[i, I4(some_told[n])]
    return count


@banded(fastmath=FAST)
def sparse_misfits(k, left_u, left_v, left_var, light, unrest, scale, flat, size, colors, sweep, d,
                   phase, cap, out):
    """
    Write the misfits of every second node, across and down, at its plane; float32 (h, w).

    As `sweep_misfits`, without a list: all these nodes are compared. Those whose color says
    nothing get cap.

    """
    m, c = numbers(sweep), numbers(colors)
    own_u, noises = stack_row(), stack_row()
    xs, ys, ds, red, blue, gray = (stack_row(), stack_row(), stack_row(), stack_row(), stack_row(),
                                   stack_row())
    color_u, color_v, slope_u, slope_v = stack_row(), stack_row(), stack_row(), stack_row()
    rows, columns = out.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y = PAD + 2 * row
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            whole, left = (count + 7) & ~7, PAD + 2 * start
            us, vs, variances = left_u[y, left:], left_v[y, left:], left_var[y, left:]
            factors, reds, blues = unrest[y, left:], light[0, y, left:], light[1, y, left:]
            grays, here, told = light[2, y, left:], d[y, left:], out[row, start:start + count]
            for n in range(count):
                at = U4(2 * n)
                xs[n], ys[n] = F4(4 * (start + n)) + F4(0.5), F4(4 * row) + F4(0.5)
                ds[n], noises[n] = here[at], scale * factors[at] * variances[at]
                red[n], blue[n], gray[n] = reds[at], blues[at], grays[at]
            see(flat, size, m, c, MARGIN, whole, xs, ys, ds, red, blue, gray, color_u, color_v,
                slope_u, slope_v)
            for n in range(count):
                at = U4(2 * n)
                error_u, error_v = us[at] - color_u[n], vs[at] - color_v[n]
                steep = slope_u[n] * slope_u[n] + slope_v[n] * slope_v[n]
                chi = (error_u * error_u + error_v * error_v) / (noises[n] + phase * steep)
                own_u[n] = chi if (chi < cap) & (variances[at] < SILENT_VARIANCE) else cap
            for n in range(count):
                told[n] = own_u[n]


@banded(fastmath=FAST)
def around_sparse(k, sparse, rows, columns, out):
    """
    Write the mean of what `sparse_misfits` wrote of the 3 x 3 nodes around every node.

    out, float32 framed, of (rows, columns) nodes; its frame stays.

    """
    half, quarter = F4(0.5), F4(0.25)
    first, last = band(k, rows)
    for row in range(first, last):
        above, below = sparse[row // 2], sparse[(row + 1) // 2]
        told = out[PAD + row, PAD:PAD + columns]
        even, odd = stack_row(), stack_row()
        for start in range(0, (columns + 1) // 2, LENGTH):
            count = min(LENGTH, (columns + 1) // 2 - start)
            one, other = above[start:start + count], below[start:start + count]
            for n in range(count):
                even[n] = half * (one[n] + other[n])
            one, other = above[start + 1:start + 1 + count], below[start + 1:start + 1 + count]
            for n in range(one.size):
                odd[n] = half * even[n] + quarter * (one[n] + other[n])
            for n in range(count):
                told[2 * (start + n)] = even[n]
            for n in range(min(count, columns // 2 - start)):
                told[2 * (start + n) + 1] = odd[n]


@part(fastmath=FAST)
def sum_columns(cost, y, start, out):
    """Write the sums of three nodes around row y, for the columns from start on."""
    above, here = cost[y - 1, start:start + out.size], cost[y, start:start + out.size]
    below = cost[y + 1, start:start + out.size]
    for x in range(out.size):
        out[x] = above[x] + here[x] + below[x]


@banded(fastmath=FAST)
def best_windows(k, cost, chosen, out):
    """
    Write the lowest mean of the nine windows of 3 x 3 nodes that hold a chosen node.

    All arrays are framed; cost and out float32, chosen bool. Some others get theirs, too.

    """
    rows, columns = cost.shape
    first, last = band(k, rows - 2 * PAD)
    tops, centers, downs, lows = stack_row(), stack_row(), stack_row(), stack_row()
    ninth = F4(1 / 9)
    for y in range(PAD + first, PAD + last):
        for start in range(PAD, columns - PAD, LENGTH - 4):
            count = min(LENGTH - 4, columns - PAD - start)
            if not any_of(chosen[y, start:start + count]):
                continue
            sum_columns(cost, y - 1, start - 2, tops[:count + 4])
            sum_columns(cost, y, start - 2, centers[:count + 4])
            sum_columns(cost, y + 1, start - 2, downs[:count + 4])
            for x in range(count + 2):
                top = tops[x] + tops[x + 1] + tops[x + 2]
                center = centers[x] + centers[x + 1] + centers[x + 2]
                down = downs[x] + downs[x + 1] + downs[x + 2]
                lows[x] = min(min(top, center), down)
            told = out[y, start:start + count]
            for x in range(count):
                told[x] = ninth * min(min(lows[x], lows[x + 1]), lows[x + 2])


@banded(fastmath=FAST)
def take_best(k, d, a, b, step, costs, best, wanted, new_d, new_a, new_b):
    """
    Write for every node its own plane, or, if wanted, the best of the planes `step` nodes away.

    costs, float32 (4, framed), are those under the planes to the left, right, above, below. best,
    float32 framed, holds those under the own planes, and takes the lowest of nodes that change.
    Planes of nodes whose cost is at most settled stay, and those within step of the border.

    """
    rows, columns = best.shape
    first, last = band(k, rows)
    for y in range(first, last):
        for x in range(columns):
            new_d[y, x], new_a[y, x], new_b[y, x] = d[y, x], a[y, x], b[y, x]
        if (y < step) | (y >= rows - step):
            continue
        for x in range(step, columns - step):
            if not wanted[y, x]:
                continue
            least, which = best[y, x], -1
            for n in range(4):
                if costs[n, y, x] < least:
                    least, which = costs[n, y, x], n
            if which < 0:
                continue
            along = step * ((which == 1) - (which == 0))
            down = step * ((which == 3) - (which == 2))
            j, i = y + down, x + along
            here = d[j, i] - a[j, i] * F4(along) - b[j, i] * F4(down)
            if here == here:
                best[y, x] = least
                new_d[y, x], new_a[y, x], new_b[y, x] = here, a[j, i], b[j, i]


@banded()
def seed_unknown(k, coarse, whole, factor, rows, columns, d, a, b):
    """
    Give nodes the plane of their coarse node, but not where all nodes of it are firm.

    As `coarse_kernels.seed_planes`; whole, bool (h, w), as
    `region_kernels.reduce_firm` writes it.

    """
    coarse_rows, coarse_columns = coarse.shape
    unit, center = F4(2 * factor), F4(0.5 * (factor - 1))
    first, last = band(k, rows)
    for y in range(first, last):
        cy = min(y // factor, coarse_rows - 1)
        off_y = F4(y - cy * factor) - center
        for cx in range(coarse_columns):
            edge = (cx == coarse_columns - 1) | (cy == coarse_rows - 1)
            if whole[cy, cx] and not edge:
                continue
            here = coarse[cy, cx]
            slope_x = F4(2) * smaller_step(coarse[cy, max(cx - 1, 0)], here,
                                           coarse[cy, min(cx + 1, coarse_columns - 1)])
            slope_y = F4(2) * smaller_step(coarse[max(cy - 1, 0), cx], here,
                                           coarse[min(cy + 1, coarse_rows - 1), cx])
            base = here * unit + slope_y * off_y
            stop = columns if cx == coarse_columns - 1 else (cx + 1) * factor
            for x in range(cx * factor, stop):
                d[y + PAD, x + PAD] = base + slope_x * (F4(x - cx * factor) - center)
                a[y + PAD, x + PAD] = slope_x
                b[y + PAD, x + PAD] = slope_y


@part()
def anchor_row(there, known, out):
    """Write what is known where it is there; all others stay."""
    for x in range(out.size):
        out[x] = known[x] if there[x] else out[x]


@part()
def choose_known(there, known, otherwise, out):
    """Write what is known where it is there, and otherwise a number."""
    for x in range(out.size):
        out[x] = known[x] if there[x] else otherwise


@banded()
def anchor_nodes(k, firm, told_misfit, known_d, known_a, known_b, known_weight, known_moment, cap,
                 d, a, b, weight, moment, misfit):
    """
    Give firm nodes what two cameras know of them, and let all others know nothing but their plane.

    All arrays are framed. told_misfit is what the pattern says of the planes of two cameras; the
    misfit of all others is the cap.

    """
    first, last = band(k, firm.shape[0])
    for y in range(first, last):
        there, told = firm[y], told_misfit[y]
        anchor_row(there, known_d[y], d[y])
        anchor_row(there, known_a[y], a[y])
        anchor_row(there, known_b[y], b[y])
        choose_known(there, known_weight[y], F4(0), weight[y])
        choose_known(there, known_moment[y], F4(0), moment[y])
        choose_known(there, told, cap, misfit[y])


@banded(fastmath=FAST)
def sweep_costs(k, left_u, left_v, trust, thin, share, size, colors, light, known, needed, sweep,
                offset, step, first_disparity, spacing, scale, cap, neutral, slope, depth, cost):
    """
    Fill a volume, int16 (h, w, D), with the costs of the coarse nodes that are needed, not 0.

    Node (j, i) lies at x = offset + step i. The disparity of index n is first_disparity + n
    spacing, px; those from depth on stay as they are. thin, share and size as in `see_along`.
    left_u, left_v int16, in units of 1 / scale; trust int16 0..16. known, float32 (h, w): the
    index where two cameras know the disparity, NaN elsewhere; there the cost rises by slope for
    each index away from it.

    """
    rows, columns = needed.shape
    first, last = band(k, rows)
    full = F4(cap)
    m, c = numbers(sweep), numbers(colors)
    some, color_u, color_v = stack_integers(), stack_row(), stack_row()
    for row in range(first, last):
        for column in range(columns):
            if needed[row, column] == 0:
                continue
            out = cost[row, column]
            best = known[row, column]
            if best == best:
                for start in range(0, depth, LENGTH):
                    here = best - F4(start)
                    for n in range(LENGTH):
                        away = slope * abs(F4(n) - here)
                        some[n] = I2(away if away < full else full)
                    for n in range(min(LENGTH, depth - start)):
                        out[start + n] = some[n]
                continue
            w = I2(trust[row, column])
            if w == 0:
                for n in range(depth):
                    out[n] = neutral
                continue
            own_u, own_v = F4(left_u[row, column]), F4(left_v[row, column])
            told = (light[0, row, column], light[1, row, column],
                    light[2, row, column] * scale)
            for start in range(0, depth, LENGTH):
                count = min(LENGTH, depth - start)
                whole = (count + 15) & ~15  # vectors of up to 16
                see_along(thin, share, size, m, c, offset + step * F4(column),
                          offset + step * F4(row), told, first_disparity + F4(start) * spacing,
                          spacing, whole, color_u, color_v)
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


@part(forceinline=True)
def follow(cost, path, small, large, total, add):
    """
    Go one step along a semi-global path, for all disparities of a node.

    path, int16 (D + 3), holds the costs of the last node between two guards, and their lowest; it
    takes those of this one. Loops store into small arrays of their own: LLVM makes no SIMD of
    stores into arrays that might overlap.

    """
    depth, lowest = cost.size, path[cost.size + 2]
    before, values, totals = stack_integers(), stack_integers(), stack_integers()
    bound, last, least = I2(large + lowest), I2(path[0] + lowest), LARGEST
    path[depth + 1] = last  # the guard is no cost of the last node
    for start in range(0, depth, LENGTH):
        count = min(LENGTH, depth - start)
        costs, sums = cost[start:start + count], total[start:start + count]
        own, after = path[start + 1:start + 1 + count], path[start + 2:start + 2 + count]
        before[0] = last
        for n in range(count - 1):
            before[n + 1] = own[n]
        last = own[count - 1]
        for n in range(count):
            step = min(min(own[n], I2(min(before[n], after[n]) + small)), bound)
            value = I2(costs[n] + I2(step - lowest))
            values[n] = value
            totals[n] = I2(sums[n] + value) if add else value
            least = min(least, value)
        for n in range(count):
            own[n] = values[n]
            sums[n] = totals[n]
    path[depth + 2] = least


@part()
def begin_path(path, guard):
    """Let nothing be known of the last node; path as in `follow`."""
    path[:] = I2(0)
    path[0] = guard


@banded()
def paths_along_rows(k, cost, needed, small, large, guard, total, scratch):
    """
    Write the costs of the paths from the left and from the right; volumes int16 (h, w, D).

    Paths begin anew after nodes where needed, uint8 (h, w), is not PATHS.

    """
    rows, columns, depth = cost.shape
    first, last = band(k, rows)
    path = scratch[k, 0, :depth + 3]
    for y in range(first, last):
        for backwards in range(2):
            whole = False
            for n in range(columns):
                x = columns - 1 - n if backwards else n
                if needed[y, x] != PATHS:
                    whole = False
                    continue
                if not whole:
                    begin_path(path, guard)
                    whole = True
                follow(cost[y, x], path, small, large, total[y, x], backwards == 1)


@banded()
def paths_along_columns(k, cost, needed, small, large, guard, total, scratch):
    """Add the costs of the paths from above and from below; see `paths_along_rows`."""
    rows, columns, depth = cost.shape
    first, last = band(k, columns)
    for backwards in range(2):
        for n in range(rows):
            y = rows - 1 - n if backwards else n
            before = y + 1 if backwards else y - 1
            for x in range(first, last):
                if needed[y, x] != PATHS:
                    continue
                path = scratch[k, x - first, :depth + 3]
                if n == 0 or needed[before, x] != PATHS:
                    begin_path(path, guard)
                follow(cost[y, x], path, small, large, total[y, x], True)


@banded()
def cheapest_disparities(k, total, depth, known, needed, best):
    """
    Write the index of the lowest cost of every node of a volume (h, w, D), refined by a V.

    The first depth entries of a node count.
    Where needed, uint8 (h, w), is not PATHS, the known index is written, float32 (h, w); where
    this is NaN, that of the last node of the row.

    """
    rows, columns = needed.shape
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


@banded(fastmath=FAST)
def cells_of_nodes(k, sweep, d, cell, height, width, out):
    """
    Write which cell of the pattern lights every node, int32 (rows, columns); -1: none.

    d is framed, px. Cells are `cell` pixels of the pattern wide, (height, width) of them, counted
    row by row.

    """
    m = numbers(sweep)
    rows, columns = out.shape
    first, last = band(k, rows)
    share = F4(1) / cell
    for row in range(first, last):
        y = F4(2 * row) + F4(0.5)
        here, cells = d[PAD + row, PAD:PAD + columns], out[row]
        for column in range(columns):
            x, value = F4(2 * column) + F4(0.5), here[column]
            depth = m[8] * x + m[9] * y + m[10] + m[11] * value
            ahead = depth > LEAST_DEPTH
            inverse = share / (depth if ahead else LEAST_DEPTH)
            u = (m[0] * x + m[1] * y + m[2] + m[3] * value) * inverse
            v = (m[4] * x + m[5] * y + m[6] + m[7] * value) * inverse
            inside = (ahead & (u >= F4(0)) & (v >= F4(0)) & (u < F4(width)) & (v < F4(height)))
            u, v = u if inside else F4(0), v if inside else F4(0)
            cells[column] = I4(v) * I4(width) + I4(u) if inside else I4(-1)


@serial()
def claim_cells(two_d, third_d, odds, cells, best, owner):
    """
    Let every node claim the cell of the pattern that lights it; the one of the best odds gets it.

    A node claims that of two cameras or that of the third view, whichever has the better log-odds,
    odds[0] or odds[1], float32 (2 or more, rows, columns). two_d, third_d are framed; cells, int32
    (2, rows, columns), are those of `cells_of_nodes`. best, float32, takes the odds and owner,
    float32, the disparity of the node that gets a cell; -inf and NaN where nobody claims it.

    """
    best[:] = -F4(np.inf)
    owner[:] = NAN
    rows, columns = cells.shape[1:]
    for row in range(rows):
        for column in range(columns):
            two, third = odds[0, row, column], odds[1, row, column]
            taken = third > two
            at = cells[1, row, column] if taken else cells[0, row, column]
            value = third if taken else two
            if at >= 0 and value > best[at]:
                best[at] = value
                owner[at] = (third_d[row + PAD, column + PAD] if taken
                             else two_d[row + PAD, column + PAD])


@banded(fastmath=FAST)
def find_contested(k, d, cells, distance, best, owner, contested):
    """
    Write the odds of another surface that claims the same cell of the pattern, at least 0.

    Another surface differs by more than `distance`, px, in disparity. d is framed, contested is
    float32 (rows, columns); all others as in `claim_cells`.

    """
    rows, columns = contested.shape
    first, last = band(k, rows)
    for row in range(first, last):
        here, at, out = d[PAD + row, PAD:PAD + columns], cells[row], contested[row]
        for column in range(columns):
            there = max(at[column], I4(0))
            other = (at[column] >= 0) & (abs(owner[there] - here[column]) > distance)
            out[column] = max(best[there], F4(0)) if other else F4(0)
