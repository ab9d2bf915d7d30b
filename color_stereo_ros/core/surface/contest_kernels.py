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
"""Kernels of the surface method: planes compared in small windows; see `grid_kernels`."""

import numpy as np

from .grid_kernels import F4, FAST, PAD
from .tuning import TUNING
from ..compiled import band, banded, part

# Compiled into the kernels.
REACH, ALIKE = TUNING.contest.reach, F4(TUNING.contest.alike)
OWN, SEED, NEIGHBOR = range(3)  # whose plane a node has


@part(fastmath=FAST)
def window_difference(left, right, gain, y, x, d, a, b, cap):
    """
    Return the sum of absolute differences of two images around a node under a plane, DN.

    The differences of all channels of a node count up to cap, which also stands for places
    outside the right image. gain makes the right image as bright as the left one.

    """
    rows, columns, channels = left.shape
    last = F4(right.shape[1] - 1)
    total = F4(0)
    for j in range(-REACH, REACH + 1):
        row = min(max(y + j, 0), rows - 1)
        for i in range(-REACH, REACH + 1):
            column = min(max(x + i, 0), columns - 1)
            place = F4(2 * column) - (d + a * F4(column - x) + b * F4(row - y))
            inside = (place >= F4(0)) & (place < last)
            place = place if inside else F4(0)
            at = np.int32(place)
            t = place - F4(at)
            difference = F4(0)
            for channel in range(channels):
                low, high = F4(right[row, at, channel]), F4(right[row, at + 1, channel])
                difference += abs(F4(left[row, column, channel]) - gain * (low + t * (high - low)))
            total += min(difference, cap) if inside else cap
    return total


@banded(fastmath=FAST)
def contest(k, left, right, gain, wanted, seed, seed_variance, cap, margin, d, a, b, variance,
            new_d, new_a, new_b, new_variance, winner):
    """
    Let nodes take the plane that fits a small window best, of those around and of a search.

    The candidates are their own plane, which is favored by margin (DN), that of their seed, and
    those of the four neighbors, unless nearly the same. left and right, uint8 (rows, columns or
    more, C): images of one row per node; gain, float32 (rows, columns), see `window_difference`;
    wanted, bool (rows, columns), of the nodes that are asked. seed, px, framed, NaN = none: a
    plane without slope, of seed_variance. winner, uint8 (rows, columns), takes OWN, SEED or
    NEIGHBOR. Reads d, a, b and variance, framed, and writes new_* at all nodes.

    """
    rows, columns = wanted.shape
    nowhere = F4((2 * REACH + 1) ** 2) * cap  # what no plane that fits nowhere beats
    first, last = band(k, rows)
    for row in range(first, last):
        y = row + PAD
        for column in range(columns):
            x = column + PAD
            best_d, best_a, best_b, spread = d[y, x], a[y, x], b[y, x], variance[y, x]
            who = OWN
            if wanted[row, column]:
                bright = gain[row, column]
                least = nowhere
                if best_d == best_d:
                    least = window_difference(left, right, bright, row, column, best_d, best_a,
                                              best_b, cap) - margin
                found = seed[y, x]
                if found == found:
                    cost = window_difference(left, right, bright, row, column, found, F4(0),
                                             F4(0), cap)
                    if cost < least:
                        least, best_d, best_a, best_b, who = cost, found, F4(0), F4(0), SEED
                        spread = seed_variance
                for side in range(4):
                    j = (side == 0) - (side == 1)
                    i = (side == 2) - (side == 3)
                    lean, tilt = a[y + j, x + i], b[y + j, x + i]
                    there = d[y + j, x + i] - lean * F4(i) - tilt * F4(j)
                    change = abs(there - best_d) + abs(lean - best_a) + abs(tilt - best_b)
                    if (there == there) & (not change < ALIKE):
                        cost = window_difference(left, right, bright, row, column, there, lean,
                                                 tilt, cap)
                        if cost < least:
                            least, best_d, best_a, best_b, who = cost, there, lean, tilt, NEIGHBOR
                            spread = variance[y + j, x + i]
            new_d[y, x], new_a[y, x], new_b[y, x] = best_d, best_a, best_b
            new_variance[y, x], winner[row, column] = spread, who
