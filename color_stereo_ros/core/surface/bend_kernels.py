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
"""Kernels of the surface method: surfaces that bend within a window; see `grid_kernels`."""

import math

from .grid_kernels import F4, FAST, TILE_COLUMNS, TILE_ROWS
from .plane_kernels import gated_sums, LEAST_SIGNAL_SHARE, LEAST_WEIGHT, RADIUS, smooth_sums
from .plane_kernels import stack_sums
from .tuning import TUNING
from ..compiled import band, banded, part

# Constants of `tuning`, compiled into the kernels.
SPAN = TUNING.bends.span
LARGEST_BEND = F4(TUNING.bends.largest_bend)
MISFIT_CAP = F4(TUNING.bends.misfit_cap)
ROW_STRIDE = TUNING.bends.row_stride


@banded(fastmath=FAST)
def find_bent_tiles(k, d, variance, misfit, tiles, least_bend, noise_ratio, usual_misfit,
                    misfit_gain, least_share, bent, noise):
    """
    Mark the tiles in which the disparity bends by more than its noise.

    A node bends if the second difference of d over SPAN nodes, along rows or along columns, lies
    between its noise and LARGEST_BEND (px). The square of the noise is least_bend^2 plus
    noise_ratio times the mean variance of the tile, times `noise`. bent, bool, is where more than
    least_share of the nodes of a tile bend. noise, float32: 1 where planes fit, plus misfit_gain
    times what the mean root misfit exceeds usual_misfit by: planes that fit badly are noisier
    than their variance says. Every second row is looked at.

    """
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        right = left + TILE_COLUMNS
        spread, level, known = F4(0), F4(0), F4(0)
        for y in range(top, top + TILE_ROWS, 2):
            row, chi = variance[y, left:right], misfit[y, left:right]
            for x in range(TILE_COLUMNS):
                counts = (row[x] < LARGEST_BEND) & (chi[x] >= F4(0))
                spread += row[x] if counts else F4(0)
                level += math.sqrt(min(chi[x], MISFIT_CAP)) if counts else F4(0)
                known += F4(1) if counts else F4(0)
        share = F4(1) / max(known, F4(1))
        factor = F4(1) + misfit_gain * max(level * share - usual_misfit, F4(0))
        least = least_bend * least_bend + noise_ratio * factor * spread * share
        most = LARGEST_BEND * LARGEST_BEND
        bends = F4(0)
        for y in range(top, top + TILE_ROWS, 2):
            here = d[y, left - SPAN:right + SPAN]
            above, below = d[y - SPAN, left:right], d[y + SPAN, left:right]
            for x in range(TILE_COLUMNS):
                center = F4(2) * here[x + SPAN]
                across = here[x] + here[x + 2 * SPAN] - center
                along = above[x] + below[x] - center
                across, along = across * across, along * along
                bends += F4(1) if ((across > least) & (across < most)) | (
                    (along > least) & (along < most)) else F4(0)
        bent[tile] = bends > least_share * F4(TILE_ROWS // 2 * TILE_COLUMNS)
        noise[tile] = factor


@banded(fastmath=FAST)
def write_pulls(k, weight, moment, d, reference, pull):
    """Write what every node asks for beyond its own disparity: pull = moment - weight d."""
    first, last = band(k, d.shape[0])
    for y in range(first, last):
        weights, moments, own, out = weight[y], moment[y], d[y], pull[y]
        for x in range(out.size):
            asked = moments[x] - weights[x] * (own[x] - reference)
            out[x] = asked if asked == asked else F4(0)


@part(fastmath=FAST)
def bend_row(sums, d, a, b, noise_weight, ridge, steepest, noise, doubt, new_d, new_a, new_b,
             variance):
    """
    Add to one tile row of planes what a plane through the pulls of the window says.

    The step of the disparity, s, has the variance v of that fit, times noise. The share 1 - v /
    s^2 of it, at least 0, is taken: it minimizes bias^2 + variance. The variance grows by that of
    the share; by the square of what is left of the step; and by (doubt s)^2.

    """
    for x in range(TILE_COLUMNS):
        known = (sums[0, x] > LEAST_WEIGHT) & (d[x] == d[x])
        s0 = max(sums[0, x], LEAST_WEIGHT)
        hold = ridge * s0
        inverse = F4(1) / s0
        mean_x = sums[1, x] * inverse
        mean_y = sums[2, x] * inverse
        xx = sums[3, x] - sums[1, x] * mean_x + hold
        xy = sums[4, x] - sums[1, x] * mean_y
        yy = sums[5, x] - sums[2, x] * mean_y + hold
        tx = sums[7, x] - mean_x * sums[6, x]
        ty = sums[8, x] - mean_y * sums[6, x]
        inverse_det = F4(1) / (xx * yy - xy * xy)
        slope_x = (tx * yy - ty * xy) * inverse_det
        slope_y = (ty * xx - tx * xy) * inverse_det
        step = sums[6, x] * inverse - mean_x * slope_x - mean_y * slope_y
        spread = inverse + (mean_x * mean_x * yy - F4(2) * mean_x * mean_y * xy
                            + mean_y * mean_y * xx) * inverse_det
        signal = sums[0, x] - noise_weight * sums[9, x]
        told = known & (signal > LEAST_SIGNAL_SHARE * s0)
        spread = spread * (s0 / max(signal, LEAST_SIGNAL_SHARE * s0)) * noise
        square = step * step
        known = told & (square > spread)
        share = (square - spread) / (square if known else F4(1))
        share = share if known else F4(0)
        left = (F4(1) - share) * step
        new_d[x] = d[x] + share * step if known else d[x]
        new_a[x] = min(max(a[x] + share * slope_x, -steepest), steepest) if known else a[x]
        new_b[x] = min(max(b[x] + share * slope_y, -steepest), steepest) if known else b[x]
        wider = share * share * spread + min(left * left, spread) + doubt * doubt * square
        variance[x] += wider if told else F4(0)


@banded()
def unbend(k, weight, pull, d, a, b, tiles, noise, smooth, gate, noise_weight, ridge, steepest,
           doubt, new_d, new_a, new_b, variance):
    """
    Correct the planes of some tiles for the bend of the surface.

    A plane that is fitted to a bent surface is off by half the second difference over the window.
    Planes through what the nodes of a window ask for beyond their own disparities show by how
    much (Tukey's twicing: the bias then grows with the fourth power of the window, as that of a
    quadric). Windows have RADIUS nodes; smooth, bool: tiles that need no gate. Of the
    others every ROW_STRIDE-th row of the window counts. All else is as in
    `plane_kernels.fit_planes`. variance, px^2, changes in place; see `bend_row`.

    """
    first, last = band(k, tiles.shape[0])
    sums = stack_sums()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        right = left + TILE_COLUMNS
        if smooth[tile]:
            smooth_sums(weight, pull, top, left, RADIUS, sums)
        else:
            for y in range(TILE_ROWS):
                gated_sums(weight, pull, d, a, b, top + y, left, gate, ROW_STRIDE,
                           sums[y])
        for y in range(top, top + TILE_ROWS):
            bend_row(sums[y - top], d[y, left:right], a[y, left:right], b[y, left:right],
                     noise_weight, ridge, steepest, noise[tile], doubt, new_d[y, left:right],
                     new_a[y, left:right], new_b[y, left:right], variance[y, left:right])
