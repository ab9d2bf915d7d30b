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
"""Kernels of the surface method: planes by least squares; see `grid_kernels`."""

import numpy as np

from .grid_kernels import (
    any_above, copy_tile, F4, FAST, foreshortening, NAN, PAD, PHASE_VARIANCE, SILENT_VARIANCE,
    TILE_COLUMNS, TILE_ROWS)
from .tuning import TUNING
from ..compiled import band, banded, part, stack_array, stack_row

# Constants of `tuning`, compiled into the kernels.
RADIUS, WIDE_RADIUS = TUNING.planes.radius, TUNING.planes.wide_radius
SPAN = TUNING.planes.span
LEAST_WEIGHT = F4(TUNING.planes.least_weight)
LEAST_SIGNAL_SHARE = F4(TUNING.planes.least_signal_share)


@banded(fastmath=FAST)
def linearize(k, left_u, left_v, left_var, right_u, right_v, right_var, psf, matrix, d, a, b,
              tiles, first_line, line_step, robust_misfit, scale, reference, weight, moment,
              misfit):
    """
    Compare every node of some tiles with the place its disparity points to, and linearize there.

    With e = L - M R(x - d) and g = M R'(x - d), an error of the disparity shows as e = g (d -
    d_true). Writes weight = w g.g, moment = weight (d - reference) - w g.e and misfit = w e.e,
    where w = 1 / (scale (var_L + var_R) + PHASE_VARIANCE g.g) and, in weight and moment, is
    multiplied by Cauchy's 1 / (1 + misfit / robust_misfit). g includes the matrix M, unlike the
    slope in `neighbor_kernels.patch_misfit`. Interpolated by cubics through four columns: linear
    interpolation pulls towards whole pixels, Catmull-Rom by .006 px. The left view of a node is
    blurred as its plane demands, see `foreshortening`, but not beside nodes without information.
    matrix (2, 3) maps right chromaticities to left ones. Unknown d, no information, or a place
    outside the right image: weight = moment = 0, misfit NaN. Of the lines of a tile those from
    first_line on count, line_step apart.

    """
    width = right_u.shape[1]
    m00, m01, m02 = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    m10, m11, m12 = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    one, two, three, half, sixth = F4(1), F4(2), F4(3), F4(0.5), F4(1 / 6)
    first, last = band(k, tiles.shape[0])
    weights, moments, misfits = stack_row(), stack_row(), stack_row()
    places, noises = stack_row(), stack_row()
    us = stack_row(), stack_row(), stack_row(), stack_row()
    vs = stack_row(), stack_row(), stack_row(), stack_row()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        for y in range(top + first_line, top + TILE_ROWS, line_step):
            ru, rv, rvar = right_u[y], right_v[y], right_var[y]
            lu = left_u[y, left - 1:left + TILE_COLUMNS + 1]
            lv = left_v[y, left - 1:left + TILE_COLUMNS + 1]
            lvar = left_var[y, left - 1:left + TILE_COLUMNS + 1]
            dd = d[y, left:left + TILE_COLUMNS]
            aa = a[y, left:left + TILE_COLUMNS]
            bb = b[y, left:left + TILE_COLUMNS]
            out_weight = weight[y, left:left + TILE_COLUMNS]
            out_moment = moment[y, left:left + TILE_COLUMNS]
            out_misfit = misfit[y, left:left + TILE_COLUMNS]
            for x in range(TILE_COLUMNS):
                place = F4(2 * (left - PAD + x)) - dd[x]
                known = (place >= one) & (place < F4(width - 2))
                places[x] = place if known else one
            # some processors gather slowly: then LLVM would make no SIMD of what follows
            for x in range(TILE_COLUMNS):
                i = np.int32(places[x])
                i0, i1 = np.uint32(i - 1), np.uint32(i)
                i2, i3 = np.uint32(i + 1), np.uint32(i + 2)
                us[0][x], us[1][x], us[2][x], us[3][x] = ru[i0], ru[i1], ru[i2], ru[i3]
                vs[0][x], vs[1][x], vs[2][x], vs[3][x] = rv[i0], rv[i1], rv[i2], rv[i3]
                noises[x] = max(rvar[i1], rvar[i2])
            for x in range(TILE_COLUMNS):
                place = F4(2 * (left - PAD + x)) - dd[x]
                known = (place >= one) & (place < F4(width - 2))
                t, noise = places[x] - F4(np.int32(places[x])), noises[x]
                w0 = sixth * t * (t * (three - t) - two)
                w1 = one + half * t * (t * (t - two) - one)
                w2 = half * t * (two + t * (one - t))
                w3 = sixth * t * (t * t - one)
                g0 = sixth * (t * (F4(6) - three * t) - two)
                g1 = half * (t * (three * t - F4(4)) - one)
                g2 = half * (two + t * (two - three * t))
                g3 = sixth * (three * t * t - one)
                u0, u1, u2, u3 = us[0][x], us[1][x], us[2][x], us[3][x]
                v0, v1, v2, v3 = vs[0][x], vs[1][x], vs[2][x], vs[3][x]
                u = w0 * u0 + w1 * u1 + w2 * u2 + w3 * u3
                v = w0 * v0 + w1 * v1 + w2 * v2 + w3 * v3
                gu = g0 * u0 + g1 * u1 + g2 * u2 + g3 * u3
                gv = g0 * v0 + g1 * v1 + g2 * v2 + g3 * v3
                gain = foreshortening(aa[x], bb[x], psf)
                gain = gain if max(lvar[x], lvar[x + 2]) < SILENT_VARIANCE else F4(0)
                own = one - two * gain
                own_u = own * lu[x + 1] + gain * (lu[x] + lu[x + 2])
                own_v = own * lv[x + 1] + gain * (lv[x] + lv[x + 2])
                error_u = own_u - (m00 * u + m01 * v + m02)
                error_v = own_v - (m10 * u + m11 * v + m12)
                slope_u = m00 * gu + m01 * gv
                slope_v = m10 * gu + m11 * gv
                informed = known & (noise < SILENT_VARIANCE) & (lvar[x + 1] < SILENT_VARIANCE)
                steep = slope_u * slope_u + slope_v * slope_v
                w = one / (scale * (lvar[x + 1] + noise) + PHASE_VARIANCE * steep)
                chi = w * (error_u * error_u + error_v * error_v)
                w = w / (one + chi / robust_misfit)
                strength = w * steep
                pulled = (strength * (dd[x] - reference)
                          - w * (slope_u * error_u + slope_v * error_v))
                weights[x] = strength if informed else F4(0)
                moments[x] = pulled if informed else F4(0)
                misfits[x] = chi if informed else NAN
            for x in range(TILE_COLUMNS):
                out_weight[x] = weights[x]
                out_moment[x] = moments[x]
                out_misfit[x] = misfits[x]


stack_sums = stack_array(F4, TILE_ROWS, 10, TILE_COLUMNS)  # rows of tiles as in `gated_sums`


@part(forceinline=True, fastmath=FAST)  # the radius is then a constant
def smooth_sums(weight, moment, top, left, radius, sums):
    """
    Window sums of one tile without a gate, first over rows, then over columns.

    radius, at most WIDE_RADIUS; sums is (TILE_ROWS, 10, TILE_COLUMNS), each row as in
    `gated_sums`. From row to row the sums over rows lose one row, move, and gain one.

    """
    margin = 4 * ((radius + 3) // 4)  # a whole number of vectors: no loop has a remainder
    wide, shift = TILE_COLUMNS + 2 * margin, margin - radius
    start, stop = left - margin, left + TILE_COLUMNS + margin
    reach = F4(radius)
    w0, w1, w2, z0, z1 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    m0, m1, m2, m3, m4 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    m5, m6, m7, m8, m9 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    count = stack_row()
    for row in (w0, w1, w2, z0, z1, count):
        for x in range(wide):
            row[x] = F4(0)
    for j in range(-radius - 1, radius):  # the window of the row above the tile
        w, z = weight[top + j, start:stop], moment[top + j, start:stop]
        step = F4(j + 1)
        for x in range(wide):
            w0[x] += w[x]
            w1[x] += w[x] * step
            w2[x] += w[x] * (step * step)
            z0[x] += z[x]
            z1[x] += z[x] * step
            count[x] += F4(1) if w[x] > F4(0) else F4(0)
    for y in range(TILE_ROWS):
        row = top + y
        old_w, old_z = weight[row - 1 - radius, start:stop], moment[row - 1 - radius, start:stop]
        new_w, new_z = weight[row + radius, start:stop], moment[row + radius, start:stop]
        for x in range(wide):
            s0 = w0[x] - old_w[x]
            s1 = w1[x] + reach * old_w[x]
            s2 = w2[x] - (reach * reach) * old_w[x]
            t0 = z0[x] - old_z[x]
            t1 = z1[x] + reach * old_z[x]
            w0[x] = s0 + new_w[x]
            w1[x] = s1 - s0 + reach * new_w[x]
            w2[x] = s2 - s1 - s1 + s0 + (reach * reach) * new_w[x]
            z0[x] = t0 + new_z[x]
            z1[x] = t1 - t0 + reach * new_z[x]
            count[x] += (F4(1) if new_w[x] > F4(0) else F4(0)) - (
                F4(1) if old_w[x] > F4(0) else F4(0))
        for x in range(TILE_COLUMNS):
            s0, s1, s3 = F4(0), F4(0), F4(0)
            for i in range(2 * radius + 1):
                step = F4(i - radius)
                s0 += w0[x + i + shift]
                s1 += w0[x + i + shift] * step
                s3 += w0[x + i + shift] * (step * step)
            m0[x], m1[x], m3[x] = s0, s1, s3
        for x in range(TILE_COLUMNS):
            s2, s4, s5, number = F4(0), F4(0), F4(0), F4(0)
            for i in range(2 * radius + 1):
                step = F4(i - radius)
                s2 += w1[x + i + shift]
                s4 += w1[x + i + shift] * step
                s5 += w2[x + i + shift]
                number += count[x + i + shift]
            m2[x], m4[x], m5[x], m9[x] = s2, s4, s5, number
        for x in range(TILE_COLUMNS):
            t0, t1, t2 = F4(0), F4(0), F4(0)
            for i in range(2 * radius + 1):
                step = F4(i - radius)
                t0 += z0[x + i + shift]
                t1 += z0[x + i + shift] * step
                t2 += z1[x + i + shift]
            m6[x], m7[x], m8[x] = t0, t1, t2
        copy_sums((m0, m1, m2, m3, m4, m5, m6, m7, m8, m9), sums[y])


@part()
def copy_sums(rows, sums):
    """Write a tuple of stack rows into the first rows of sums."""
    for k in range(len(rows)):
        row = rows[k]
        for x in range(TILE_COLUMNS):
            sums[k, x] = row[x]


@part(fastmath=FAST)
def gated_sums(weight, moment, d, a, b, y, left, gate, stride, sums):
    """
    Window sums of one tile row over the nodes that lie on the surface of the center.

    A node counts where its own disparity is within `gate` of the plane of the center; of the
    window rows every `stride`-th is looked at. sums is (10, TILE_COLUMNS): the moments 1, x, y,
    xx, xy, yy of weight and 1, x, y of moment, and the number of nodes that weigh something.

    """
    dc = d[y, left:left + TILE_COLUMNS]
    ac = a[y, left:left + TILE_COLUMNS]
    bc = b[y, left:left + TILE_COLUMNS]
    m0, m1, m2, m3, m4 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    m5, m6, m7, m8, m9 = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    base, s0, s1, s2 = stack_row(), stack_row(), stack_row(), stack_row()
    t0, t1, count = stack_row(), stack_row(), stack_row()
    for row in (m0, m1, m2, m3, m4, m5, m6, m7, m8, m9):
        for x in range(TILE_COLUMNS):
            row[x] = F4(0)
    for j in range(-RADIUS, RADIUS + 1, stride):
        row_y = F4(j)
        for x in range(TILE_COLUMNS):
            base[x] = dc[x] + bc[x] * row_y
        for row in (s0, s1, s2, t0, t1, count):
            for x in range(TILE_COLUMNS):
                row[x] = F4(0)
        for i in range(-RADIUS, RADIUS + 1):
            step = F4(i)
            w_row = weight[y + j, left + i:left + i + TILE_COLUMNS]
            z_row = moment[y + j, left + i:left + i + TILE_COLUMNS]
            d_row = d[y + j, left + i:left + i + TILE_COLUMNS]
            for x in range(TILE_COLUMNS):
                near = abs(d_row[x] - (base[x] + ac[x] * step)) < gate
                w, z = w_row[x], z_row[x]
                w = w if near else F4(0)
                z = z if near else F4(0)
                s0[x] += w
                s1[x] += w * step
                s2[x] += w * (step * step)
                t0[x] += z
                t1[x] += z * step
                count[x] += F4(1) if w > F4(0) else F4(0)
        for x in range(TILE_COLUMNS):
            m0[x] += s0[x]
            m1[x] += s1[x]
            m2[x] += s0[x] * row_y
            m3[x] += s2[x]
            m4[x] += s1[x] * row_y
            m5[x] += s0[x] * (row_y * row_y)
            m6[x] += t0[x]
            m7[x] += t1[x]
            m8[x] += t0[x] * row_y
            m9[x] += count[x]
    copy_sums((m0, m1, m2, m3, m4, m5, m6, m7, m8, m9), sums)


@part(fastmath=FAST)
def solve_row(sums, d, a, b, noise_weight, ridge, steepest, reference, new_d, new_a, new_b,
              variance):
    """
    Solve the 3 x 3 normal equations of one tile row for the planes (d, a, b).

    The slopes are held by a ridge of `ridge` times the zeroth moment towards their last value.
    variance is that of d at the center for noise of unit misfit; inf without information. Noise
    has gradients, too. They add noise_weight per node to the weights, which is no information.

    """
    solved_d, solved_a, solved_b, spreads = stack_row(), stack_row(), stack_row(), stack_row()
    for x in range(TILE_COLUMNS):
        known = sums[0, x] > LEAST_WEIGHT
        s0 = max(sums[0, x], LEAST_WEIGHT)
        hold = ridge * s0
        inverse = F4(1) / s0
        mean_x = sums[1, x] * inverse
        mean_y = sums[2, x] * inverse
        xx = sums[3, x] - sums[1, x] * mean_x + hold
        xy = sums[4, x] - sums[1, x] * mean_y
        yy = sums[5, x] - sums[2, x] * mean_y + hold
        tx = sums[7, x] - mean_x * sums[6, x] + hold * a[x]
        ty = sums[8, x] - mean_y * sums[6, x] + hold * b[x]
        inverse_det = F4(1) / (xx * yy - xy * xy)
        slope_x = (tx * yy - ty * xy) * inverse_det
        slope_y = (ty * xx - tx * xy) * inverse_det
        slope_x = min(max(slope_x, -steepest), steepest)
        slope_y = min(max(slope_y, -steepest), steepest)
        solved = sums[6, x] * inverse - mean_x * slope_x - mean_y * slope_y
        spread = (mean_x * mean_x * yy - F4(2) * mean_x * mean_y * xy
                  + mean_y * mean_y * xx) * inverse_det
        solved_d[x] = reference + solved if known else d[x]
        solved_a[x] = slope_x if known else a[x]
        solved_b[x] = slope_y if known else b[x]
        signal = sums[0, x] - noise_weight * sums[9, x]
        known = known & (signal > LEAST_SIGNAL_SHARE * s0)
        spreads[x] = (inverse + spread) * (s0 / signal) if known else F4(np.inf)
    for x in range(TILE_COLUMNS):
        new_d[x] = solved_d[x]
        new_a[x] = solved_a[x]
        new_b[x] = solved_b[x]
        variance[x] = spreads[x]


@banded()
def fit_planes(k, weight, moment, d, a, b, tiles, reach, gate, stride, noise_weight, ridge,
               steepest, reference, new_d, new_a, new_b, variance):
    """
    Least-squares planes of all nodes of some tiles.

    reach, int8: radius of the window where a tile needs no gate, RADIUS or WIDE_RADIUS; 0 where
    it needs one.

    """
    first, last = band(k, tiles.shape[0])
    sums = stack_sums()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        right = left + TILE_COLUMNS
        radius = max(np.int64(reach[tile]), RADIUS)
        informed = any_above(weight[top - radius:top + TILE_ROWS + radius,
                                    left - radius:right + radius], F4(0))
        if not informed:
            copy_tile(d, a, b, top, left, new_d, new_a, new_b)
            variance[top:top + TILE_ROWS, left:right] = F4(np.inf)
            continue
        if reach[tile] == WIDE_RADIUS:
            smooth_sums(weight, moment, top, left, WIDE_RADIUS, sums)
        elif reach[tile] == RADIUS:
            smooth_sums(weight, moment, top, left, RADIUS, sums)
        else:
            for y in range(TILE_ROWS):
                gated_sums(weight, moment, d, a, b, top + y, left, gate, stride, sums[y])
        for y in range(top, top + TILE_ROWS):
            solve_row(sums[y - top], d[y, left:right], a[y, left:right], b[y, left:right],
                      noise_weight, ridge, steepest, reference, new_d[y, left:right],
                      new_a[y, left:right], new_b[y, left:right], variance[y, left:right])


@banded(fastmath=FAST)
def find_smooth_tiles(k, d, a, b, color_variance, tiles, halo, step, smooth):
    """
    Mark the tiles in and around which one surface fits everywhere.

    No unknown node, and no node more than `step` px off the plane of the one SPAN nodes to its
    left or above it (`halo` nodes around the tile included). Windows round off creases, so
    adjacent planes agree there. Nodes without information do not count.

    """
    rows, columns = TILE_ROWS + 2 * halo, TILE_COLUMNS + 2 * halo
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0] - halo, tiles[tile, 1] - halo
        stop = left + columns
        broken = 0
        for y in range(top, top + rows):
            here, quiet = d[y, left:stop], color_variance[y, left:stop]
            after, lean = d[y, left + SPAN:stop], a[y, left:stop]
            quiet_after = color_variance[y, left + SPAN:stop]
            for x in range(columns - SPAN):
                fits = abs(after[x] - here[x] - F4(SPAN) * lean[x]) < step
                counts = (quiet[x] < SILENT_VARIANCE) & (quiet_after[x] < SILENT_VARIANCE)
                broken += 1 if counts & (not fits) else 0
            if y >= top + SPAN:
                above, fall = d[y - SPAN, left:stop], b[y - SPAN, left:stop]
                quiet_above = color_variance[y - SPAN, left:stop]
                for x in range(columns):
                    fits = abs(here[x] - above[x] - F4(SPAN) * fall[x]) < step
                    counts = (quiet[x] < SILENT_VARIANCE) & (quiet_above[x] < SILENT_VARIANCE)
                    broken += 1 if counts & (not fits) else 0
            if broken > 0:
                break
        smooth[tile] = broken == 0
