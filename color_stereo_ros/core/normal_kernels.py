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
Kernels of the surface normals: planes of the disparity on nodes of 2 x 2 pixels.

Node (j, i) holds the pixels 2 j, 2 j + 1 of 2 i, 2 i + 1; the last ones of an odd size belong to
the node before. Planes are d + a i + b j: px, px per node.

"""

import numpy as np

from .compiled import LENGTH, part, serial, stack_row

F4 = np.float32
NAN = F4(np.nan)
FAST = {'nsz', 'arcp', 'contract', 'afn', 'reassoc'}
"""What LLVM may do to sums and products; NaN stays NaN."""


@part()
def mean_of(first, second):
    """Return the mean of two numbers, the other one where one is NaN."""
    if first != first:
        return second
    return first if second != second else F4(0.5) * (first + second)


@serial()
def read_planes(disparity, pad, d, a, b):
    """
    Write the plane of every node from the disparities of its pixels, NaN = unknown.

    disparity: float32 (H, W), px. d, a, b: float32, nodes in a frame of pad, which is filled with
    NaN. A slope is the difference of two pixels of a row or column; it is unknown where no row or
    no column has both. d is the mean of the known pixels.

    """
    d[:], a[:], b[:] = NAN, NAN, NAN
    rows, columns = d.shape[0] - 2 * pad, d.shape[1] - 2 * pad
    for y in range(rows):
        first, second = disparity[2 * y], disparity[2 * y + 1]
        for x in range(columns):
            upper_left, upper_right = first[2 * x], first[2 * x + 1]
            lower_left, lower_right = second[2 * x], second[2 * x + 1]
            total, known = F4(0), F4(0)
            for value in (upper_left, upper_right, lower_left, lower_right):
                if value == value:
                    total += value
                    known += F4(1)
            if known == F4(0):
                continue
            d[y + pad, x + pad] = total / known
            across = mean_of(upper_right - upper_left, lower_right - lower_left)
            down = mean_of(lower_left - upper_left, lower_right - upper_right)
            if (across == across) and (down == down):
                a[y + pad, x + pad], b[y + pad, x + pad] = F4(2) * across, F4(2) * down


@serial(fastmath=FAST)
def fit_slopes(d, a, b, reach, down, along, shift, gate, bend, offset, ridge, slope_a,
               slope_b):
    """
    Fit a plane to the disparities of the nodes around every node.

    A node up to reach away, every down-th row, every along-th column, every other row shifted by
    shift, counts if its plane comes within a limit of the disparity here, and the plane here,
    where there is one, within this limit of its disparity. The limit is gate + bend (i^2 + j^2)
    (d - offset). Least squares of c + A i + B j; ridge times the squared difference from the mean
    slopes of those nodes is added. A slope is NaN where no node counts. The arrays d, a, b are
    framed by reach.

    slope_a, slope_b: float32 (rows, columns).

    """
    rows, columns = slope_a.shape
    n, si, sj = stack_row(), stack_row(), stack_row()
    sii, sij, sjj = stack_row(), stack_row(), stack_row()
    sd, sid, sjd = stack_row(), stack_row(), stack_row()
    sa, sb = stack_row(), stack_row()
    for y in range(rows):
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            begin = reach + start
            here = d[y + reach, begin:begin + count]
            own_a, own_b = a[y + reach, begin:begin + count], b[y + reach, begin:begin + count]
            for x in range(LENGTH):
                n[x] = si[x] = sj[x] = sii[x] = sij[x] = sjj[x] = F4(0)
                sd[x] = sid[x] = sjd[x] = sa[x] = sb[x] = F4(0)
            for j in range(-reach, reach + 1, down):
                first = (j + reach) // down % 2 * shift - reach
                for i in range(first, reach + 1, along):
                    fi, fj = F4(i), F4(j)
                    bent = bend * (fi * fi + fj * fj)
                    at = begin + i
                    there = d[y + reach + j, at:at + count]
                    their_a = a[y + reach + j, at:at + count]
                    their_b = b[y + reach + j, at:at + count]
                    for x in range(count):
                        rise = there[x] - here[x]
                        backward = abs(rise - their_a[x] * fi - their_b[x] * fj)
                        forward = abs(rise - own_a[x] * fi - own_b[x] * fj)
                        limit = gate + bent * (here[x] - offset)
                        # False where a plane is unknown
                        counts = (backward <= limit) & (
                            (forward <= limit) | (own_a[x] != own_a[x]))
                        weight = F4(1) if counts else F4(0)
                        rise = rise if counts else F4(0)
                        n[x] += weight
                        si[x] += weight * fi
                        sj[x] += weight * fj
                        sii[x] += weight * (fi * fi)
                        sij[x] += weight * (fi * fj)
                        sjj[x] += weight * (fj * fj)
                        sd[x] += rise
                        sid[x] += rise * fi
                        sjd[x] += rise * fj
                        sa[x] += their_a[x] if counts else F4(0)
                        sb[x] += their_b[x] if counts else F4(0)
            for x in range(count):
                share = F4(1) / n[x] if n[x] > F4(0) else NAN
                # about the mean of the places, so that c drops out
                ii = sii[x] - si[x] * si[x] * share + ridge
                ij = sij[x] - si[x] * sj[x] * share
                jj = sjj[x] - sj[x] * sj[x] * share + ridge
                right_i = sid[x] - si[x] * sd[x] * share + ridge * sa[x] * share
                right_j = sjd[x] - sj[x] * sd[x] * share + ridge * sb[x] * share
                share = F4(1) / (ii * jj - ij * ij)
                n[x] = (right_i * jj - right_j * ij) * share
                sd[x] = (right_j * ii - right_i * ij) * share
            for x in range(count):
                slope_a[y, start + x], slope_b[y, start + x] = n[x], sd[x]


@part()
def change_of(before, here, after):
    """
    Return the smaller one of the two changes along three numbers (minmod).

    0 where they have opposite signs or both are unknown; where one is unknown, the other one.

    """
    back, forth = here - before, after - here
    if back * forth < F4(0):
        return F4(0)
    if (back != back) or (abs(forth) < abs(back)):
        back = forth
    return back if back == back else F4(0)


@serial()
def write_normals(disparity, slope_a, slope_b, offset, focal_x, focal_y, center_x, center_y,
                  normals):
    """
    Write the unit normals of all pixels, float32 (H, W, 3), towards the camera; NaN = unknown.

    A plane n X = c has d - offset = f B / Z = f B / c n (x, y, 1) with x = (u - center_x) /
    focal_x, y likewise. Thus n is parallel to (focal_x d_u, focal_y d_v, d - offset -
    (u - center_x) d_u - (v - center_y) d_v); d_u, d_v: slopes of the disparity, px per px. Within
    a node they change as towards the neighbor whose slopes differ less: an edge lies on one side.

    """
    height, width = disparity.shape
    rows, columns = slope_a.shape
    for v in range(height):
        down, y = F4(v) - center_y, min(v // 2, rows - 1)
        row_a, row_b = slope_a[y], slope_b[y]
        above, below = max(y - 1, 0), min(y + 1, rows - 1)
        off_y = F4(0.5) * F4(v - 2 * y) - F4(0.25)
        line, out = disparity[v], normals[v]
        for u in range(width):
            x = min(u // 2, columns - 1)
            before, after = max(x - 1, 0), min(x + 1, columns - 1)
            off_x = F4(0.5) * F4(u - 2 * x) - F4(0.25)
            across = F4(0.5) * (
                row_a[x] + off_x * change_of(row_a[before], row_a[x], row_a[after])
                + off_y * change_of(slope_a[above, x], row_a[x], slope_a[below, x]))
            along = F4(0.5) * (
                row_b[x] + off_x * change_of(row_b[before], row_b[x], row_b[after])
                + off_y * change_of(slope_b[above, x], row_b[x], slope_b[below, x]))
            n_x, n_y = focal_x * across, focal_y * along
            n_z = line[u] - offset - (F4(u) - center_x) * across - down * along
            scale = F4(-1) / np.sqrt(n_x * n_x + n_y * n_y + n_z * n_z)
            out[u, 0], out[u, 1], out[u, 2] = n_x * scale, n_y * scale, n_z * scale
            if out[u, 0] != out[u, 0]:
                out[u, 1] = out[u, 2] = NAN
