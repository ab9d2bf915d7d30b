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
"""Kernel of the planes of the third view; see `plane_kernels`."""

import numpy as np

from ..grid_kernels import any_above, F4, TILE_COLUMNS, TILE_ROWS
from ..plane_kernels import (
    gated_sums, RADIUS, smooth_sums, solve_row, stack_sums, WIDE_RADIUS)
from ...compiled import band, banded, part


@part()
def any_of(nodes):
    """Return whether any of some nodes, bool, is chosen."""
    found = False
    for x in range(nodes.size):
        found |= nodes[x]
    return found


@part()
def follow_row(d, a, b, gate, told_d, told_a, told_b, told_variance, new_d, new_a, new_b,
               variance):
    """
    Give the nodes of a tile row the planes of the row above, told, unless these are far away.

    d, a, b are the planes so far: those farther than the gate, px, stay. Nothing was fitted to
    these, so that their variance is inf.

    """
    for x in range(TILE_COLUMNS):
        here = told_d[x] + told_b[x]
        near = abs(here - d[x]) < gate
        new_d[x] = here if near else d[x]
        new_a[x] = told_a[x] if near else a[x]
        new_b[x] = told_b[x] if near else b[x]
        variance[x] = told_variance[x] if near else F4(np.inf)


@banded()
def fit_region(k, weight, moment, d, a, b, region, tiles, reach, gate, stride, noise_weight,
               ridge, steepest, reference, new_d, new_a, new_b, variance):
    """
    Least-squares planes of the nodes of a region, and of all others of smooth tiles.

    As `plane_kernels.fit_planes`. Of tiles that need a gate, groups of `stride` lines, 1 or 2, are
    written if any of them holds nodes of the region, bool framed. The first line of a group is
    fitted; the one below takes its planes, see `follow_row`.

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
            variance[top:top + TILE_ROWS, left:right] = F4(np.inf)
            continue
        if reach[tile] == WIDE_RADIUS:
            smooth_sums(weight, moment, top, left, WIDE_RADIUS, sums)
        elif reach[tile] == RADIUS:
            smooth_sums(weight, moment, top, left, RADIUS, sums)
        for y in range(top, top + TILE_ROWS):
            if reach[tile] == 0:
                line = y - (y - top) % stride  # the one that is fitted
                if not (any_of(region[line, left:right])
                        | any_of(region[line + stride - 1, left:right])):
                    continue
                if y > line:
                    follow_row(d[y, left:right], a[y, left:right], b[y, left:right], gate,
                               new_d[line, left:right], new_a[line, left:right],
                               new_b[line, left:right], variance[line, left:right],
                               new_d[y, left:right], new_a[y, left:right], new_b[y, left:right],
                               variance[y, left:right])
                    continue
                gated_sums(weight, moment, d, a, b, y, left, gate, stride, sums[y - top])
            solve_row(sums[y - top], d[y, left:right], a[y, left:right], b[y, left:right],
                      noise_weight, ridge, steepest, reference, new_d[y, left:right],
                      new_a[y, left:right], new_b[y, left:right], variance[y, left:right])
