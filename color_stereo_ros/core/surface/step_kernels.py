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
"""Kernels of the surface method: log-odds beside steps of the disparity; see `grid_kernels`."""

import numpy as np

from .grid_kernels import F4, FAST, PAD, TILE_COLUMNS
from .tuning import TUNING
from ..compiled import band, banded, stack_row

REACH = TUNING.quality.reach  # compiled into the kernels
NOTHING = F4(np.inf)


@banded(fastmath=FAST)
def lower_beside_steps(k, d, rough, rows, columns, low, high, lost, kept, odds):
    """
    Lower the log-odds of nodes beside steps of the disparity, in place.

    The height of a step is the range of d, px, over the nodes up to REACH away, times `rough`,
    float32 (rows, columns), 0 .. 1; unknown nodes do not count. Up to `low` nothing is lost, from
    `high` on it is `lost`. No node falls below `kept`. odds, float32, framed, is like that of
    `trust_kernels.settle`: its frame repeats the nearest nodes left and right.

    """
    per_height = F4(1) / (high - low)
    first, last = band(k, rows)
    lows, highs = stack_row(), stack_row()
    for row in range(first, last):
        y = row + PAD
        for start in range(0, columns, TILE_COLUMNS):
            left, count = start + PAD, min(TILE_COLUMNS, columns - start)
            own, share = odds[y, left:left + count], rough[row, start:start + count]
            for x in range(count + 2 * REACH):
                lows[x], highs[x] = NOTHING, -NOTHING
            for j in range(-REACH, REACH + 1):
                near = d[y + j, left - REACH:left + count + REACH]
                for x in range(count + 2 * REACH):
                    lows[x] = near[x] if near[x] < lows[x] else lows[x]
                    highs[x] = near[x] if near[x] > highs[x] else highs[x]
            for x in range(count):
                least, most = lows[x], highs[x]
                for i in range(1, 2 * REACH + 1):
                    least = min(least, lows[x + i])
                    most = max(most, highs[x + i])
                height = (most - least if most > least else F4(0)) * share[x]
                part = min(max((height - low) * per_height, F4(0)), F4(1))
                floor = min(own[x], kept)
                own[x] = max(own[x] - lost * part, floor)
        odds[y, PAD - 1] = odds[y, PAD]
        odds[y, PAD + columns] = odds[y, PAD + columns - 1]
