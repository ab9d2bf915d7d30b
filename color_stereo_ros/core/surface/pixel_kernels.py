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
"""Kernels of the surface method: from nodes to pixels; see `grid_kernels`."""

import numpy as np

from .grid_kernels import F4, FAST, NAN, PAD, TILE_COLUMNS
from .trust_kernels import HIGHEST_ODDS, HOPELESS_ODDS, LOWEST_ODDS
from .tuning import TUNING
from ..compiled import band, banded, part, stack_row
from ..status_codes import INCONSISTENT, OUT_OF_RANGE, VALID

OWN_SHARE = F4(TUNING.pixels.own_share)  # compiled into the kernels


@part(fastmath=FAST)
def logistic(odds):
    """
    Return 1 / (1 + exp(-odds)), to 1e-5 of the smaller of probability and improbability.

    exp(x) = exp(x / 32)^32 with a polynomial, since a call of the library is not vectorized.

    """
    x = min(max(-odds, F4(-16)), F4(16)) * F4(1 / 32)
    power = F4(1) + x * (F4(1) + x * (F4(1 / 2) + x * (F4(1 / 6) + x * (
        F4(1 / 24) + x * (F4(1 / 120) + x * F4(1 / 720))))))
    power *= power
    power *= power
    power *= power
    power *= power
    power *= power
    return F4(1) / (F4(1) + power)


@part(fastmath=FAST)
def bounded(odds):
    """Return log-odds within what interpolation may take over from a neighbor."""
    return min(max(odds, LOWEST_ODDS), HIGHEST_ODDS)


@banded(fastmath=FAST)
def expand(k, d, a, b, std, odds, reason, beyond, rows, columns, lines, limits, focal_baseline,
           offset, least_odds, disparity, depth, out_std, out_confidence, out_status):
    """
    Evaluate the planes of the nodes at some lines of pixels, decide which count, and triangulate.

    Z = focal_baseline / (d - offset). Log-odds of a pixel: OWN_SHARE of its node's, the rest
    bilinear between the nodes around, so that a pixel next to doubtful nodes is doubted more than
    that on the other side of its node; below least_odds it has no range. A pixel whose place lies
    outside the right image has none either, even if that of its node lies inside, unless beyond,
    bool, says that the right camera does not matter. Pixels after the last whole node take the
    nearest one. Where there is no range, disparity, depth and
    out_std are NaN and confidence is 0.

    """
    width = disparity.shape[1]
    lowest, highest = limits[0], limits[1]
    last_place = F4(width - 1)
    near, far = F4(0.75), F4(0.25)
    first, last = band(k, lines.size)
    mixed = stack_row()
    even = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    odd = stack_row(), stack_row(), stack_row(), stack_row(), stack_row()
    for line in range(first, last):
        v = lines[line]
        row = min(v >> 1, rows - 1)
        below = v > 2 * row
        y, other = row + PAD, min(max(row + (1 if below else -1), 0), rows - 1) + PAD
        lean_y = F4(0.5) * (F4(v - 2 * row) - F4(0.5))
        for start in range(0, columns, TILE_COLUMNS):
            count = min(TILE_COLUMNS, columns - start)
            left, right = start + PAD, start + PAD + count
            here, there = odds[y, left - 1:right + 1], odds[other, left - 1:right + 1]
            dd, aa, bb = d[y, left:right], a[y, left:right], b[y, left:right]
            noise, reasons = std[y, left:right], reason[y, left:right]
            anywhere = beyond[y, left:right]
            for x in range(count + 2):
                mixed[x] = near * bounded(here[x]) + far * bounded(there[x])
            plane = dd, aa, bb, noise, here, reasons, anywhere
            bounds = lowest, highest, last_place, least_odds, focal_baseline, offset
            expand_side(0, 2 * start, count, plane, lean_y, mixed, bounds, *even)
            expand_side(1, 2 * start, count, plane, lean_y, mixed, bounds, *odd)
            begin, end = 2 * start, 2 * (start + count)
            interleave(even[0], odd[0], disparity[v, begin:end])
            interleave(even[1], odd[1], depth[v, begin:end])
            interleave(even[2], odd[2], out_std[v, begin:end])
            interleave(even[3], odd[3], out_confidence[v, begin:end])
            interleave(even[4], odd[4], out_status[v, begin:end])
            # an odd last column has no node of its own
            if (right == columns + PAD) & (width > 2 * columns):
                expand_side(2, 2 * start, count, plane, lean_y, mixed, bounds, *even)
                at = count - 1
                disparity[v, width - 1], depth[v, width - 1] = even[0][at], even[1][at]
                out_std[v, width - 1] = even[2][at]
                out_confidence[v, width - 1] = even[3][at]
                out_status[v, width - 1] = np.uint8(even[4][at])


@part(forceinline=True, fastmath=FAST)  # the side is then a constant, and the loop has no branch
def expand_side(side, first_column, count, plane, lean_y, mixed, bounds, values, depths, spreads,
                certainties, codes):
    """
    Evaluate one pixel of every node of a stack row, see `expand`.

    side: 0 for the left pixel of a node, 1 for the right one, 2 for one behind the last node.

    """
    d, a, b, noise, odds, reasons, anywhere = plane
    lowest, highest, last_place, least_odds, focal_baseline, offset = bounds
    near, far, shared = F4(0.75), F4(0.25), F4(1) - OWN_SHARE
    lean_x = F4(0.5) * (F4(side) - F4(0.5))
    beside = 2 * min(side, 1)  # the neighbor in mixed
    first_place = F4(first_column + side)
    for x in range(count):
        value = d[x] + a[x] * lean_x + b[x] * lean_y
        certainty = OWN_SHARE * bounded(odds[x + 1]) + shared * (
            near * mixed[x + 1] + far * mixed[x + beside])
        sure = (certainty >= least_odds) & (odds[x + 1] > HOPELESS_ODDS)
        within = (value >= lowest) & (value <= highest)
        why, spread = reasons[x], noise[x]  # loaded always: a loop with branches is no SIMD
        place = first_place + F4(2 * x) - value
        seen = ((place >= F4(0)) & (place <= last_place)) | anywhere[x]
        valid = sure & within & seen
        code = INCONSISTENT if within else OUT_OF_RANGE
        code = code if sure else why
        values[x] = value if valid else NAN
        depths[x] = focal_baseline / (value - offset) if valid else NAN
        spreads[x] = spread if valid else NAN
        certainties[x] = logistic(certainty) if valid else F4(0)
        codes[x] = F4(VALID if valid else code)


@part()
def interleave(even, odd, out):
    """Write the numbers of two stack rows in turn."""
    for x in range(out.size // 2):
        out[2 * x] = even[x]
        out[2 * x + 1] = odd[x]
