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
"""Kernels of the third view: which nodes the two cameras know, and which it measures."""

import math

from .color_kernels import logarithm
from .tuning import TUNING
from ..grid_kernels import F4, FAST, NAN, PAD, SILENT_VARIANCE, TILE_COLUMNS, TILE_ROWS
from ...compiled import band, banded, LENGTH, serial, stack_row

LEAST_GAIN = F4(math.exp(-TUNING.use.most_dim))  # compiled into the kernels


@banded(fastmath=FAST)
def find_known(k, odds, witness, columns, least_odds, most_misfit, firm, counts):
    """
    Write which nodes are firm, bool framed: two cameras know them, and the pattern fits.

    odds and witness, float32 framed, are the log-odds of two cameras and the misfit of the
    pattern there. counts, float32 (rows, 2), takes how many nodes of every row of nodes, of so
    many columns, two cameras know, and how many of them are firm.

    """
    first, last = band(k, counts.shape[0])
    for row in range(first, last):
        y = row + PAD
        told, misfit = odds[y, PAD:PAD + columns], witness[y, PAD:PAD + columns]
        out, known, both = firm[y, PAD:PAD + columns], F4(0), F4(0)
        for x in range(columns):
            known += F4(1) if told[x] > least_odds else F4(0)
            both += F4(1) if (told[x] > least_odds) & (misfit[x] < most_misfit) else F4(0)
        for x in range(columns):
            out[x] = (told[x] > least_odds) & (misfit[x] < most_misfit)
        counts[row, 0], counts[row, 1] = known, both


@banded(fastmath=FAST)
def find_region(k, gain, s, variance, firm, shadow, dim, region):
    """
    Write how dim nodes are, and which are measured: all that are lit but not firm.

    gain, float32 (rows, columns), is 1 over the brightness of firm nodes around; dim, float32
    (rows, columns), takes the logarithm of how much brighter these are, 0 .. most_dim. s and
    variance, float32, firm and region, bool, are framed. A node is lit whose color says something
    and that is less dim than `shadow`.

    """
    rows, columns = dim.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y = row + PAD
        light, noise = s[y, PAD:PAD + columns], variance[y, PAD:PAD + columns]
        there, out = firm[y, PAD:PAD + columns], region[y, PAD:PAD + columns]
        bright, told = gain[row], dim[row]
        for x in range(columns):
            share = max(light[x], F4(1)) * bright[x]
            share = min(max(share, LEAST_GAIN), F4(1))
            told[x] = -logarithm(share)
        for x in range(columns):
            lit = (noise[x] < SILENT_VARIANCE) & (light[x] > F4(1)) & (told[x] < shadow)
            out[x] = lit & (not there[x])


@banded(fastmath=FAST)
def reduce_firm(k, firm, region, d, factor, least, known, wanted, whole):
    """
    Write what two cameras know of the coarse nodes, factor x factor nodes each.

    firm and region, bool, and d are framed. known, float32 (h, w): the mean disparity of the firm
    nodes of a coarse node, px, NaN where fewer than `least` of them are firm. wanted, bool: it is
    not known, and any of its nodes belongs to the region: this one needs a seed. whole, bool: all
    of its nodes are firm.

    """
    rows, columns = known.shape
    per_block, full = LENGTH // factor, F4(factor * factor)
    counts, insides, totals = stack_row(), stack_row(), stack_row()
    first, last = band(k, rows)
    for row in range(first, last):
        for start in range(0, columns, per_block):
            count = min(per_block, columns - start)
            left, width = PAD + start * factor, count * factor
            for x in range(width):
                counts[x], insides[x], totals[x] = F4(0), F4(0), F4(0)
            for y in range(PAD + row * factor, PAD + (row + 1) * factor):
                there, within = firm[y, left:left + width], region[y, left:left + width]
                here = d[y, left:left + width]
                for x in range(width):
                    counts[x] += F4(1) if there[x] else F4(0)
                    insides[x] += F4(1) if within[x] else F4(0)
                    totals[x] += here[x] if there[x] else F4(0)
            for n in range(count):
                number, inside, total = F4(0), F4(0), F4(0)
                for x in range(n * factor, (n + 1) * factor):
                    number += counts[x]
                    inside += insides[x]
                    total += totals[x]
                enough = number >= least
                known[row, start + n] = total / number if enough else NAN
                wanted[row, start + n] = (inside > F4(0)) & (not enough)
                whole[row, start + n] = number == full


@serial()
def tiles_with(nodes, tiles, some):
    """Write which tiles, int32 (N, 2), hold some of the nodes, bool framed; some: bool (N,)."""
    for n in range(tiles.shape[0]):
        top, left = tiles[n]
        found = False
        for y in range(top, top + TILE_ROWS):
            for x in range(left, left + TILE_COLUMNS):
                found |= nodes[y, x]
        some[n] = found
