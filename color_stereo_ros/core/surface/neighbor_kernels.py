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
"""Kernels of the surface method: nodes try the planes of neighbors; see `grid_kernels`."""

import numpy as np

from .grid_kernels import (
    any_above, copy_tile, F4, FAST, foreshortening, NAN, PAD, PHASE_VARIANCE, SILENT_VARIANCE,
    TILE_COLUMNS, TILE_ROWS)
from .texture_kernels import add_patch_brightness
from .tuning import TUNING
from ..compiled import band, banded, part, stack_array, stack_row

# Constants of `tuning`, compiled into the kernels.
HALO, PATCH_MARGIN = TUNING.neighbors.halo, TUNING.neighbors.patch_margin
NEUTRAL_SHARE = F4(TUNING.neighbors.neutral_share)
PATCH_ROWS = TILE_ROWS + 2 * HALO
PATCH_COLUMNS = TILE_COLUMNS + 2 * PATCH_MARGIN
stack_tile = stack_array(F4, TILE_ROWS, TILE_COLUMNS)
stack_patch = stack_array(F4, PATCH_ROWS, PATCH_COLUMNS)


@part(fastmath=FAST)
def patch_misfit(left_u, left_v, left_var, right_u, right_v, right_var, psf, matrix, scale, cap,
                 d, a, b, top, left, step_y, step_x, out):
    """
    Write the misfits of a tile and its halo under the planes of nodes (step_y, step_x) away.

    They are truncated: `cap` where the plane is unknown or leads outside the right image, the
    share NEUTRAL_SHARE of it where the right image is too dark to tell. The left view is blurred
    as the plane demands, see `foreshortening`. The slope of the colors is taken before the color
    matrix; `linearize` takes it after the matrix.

    """
    width = right_u.shape[1]
    m00, m01, m02 = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    m10, m11, m12 = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    start = left - PATCH_MARGIN
    stop = start + PATCH_COLUMNS
    lean_x, lean_y = F4(step_x), F4(step_y)
    places, noises, misfits = stack_row(), stack_row(), stack_row()
    us, vs = (stack_row(), stack_row()), (stack_row(), stack_row())
    for py in range(PATCH_ROWS):
        y = top - HALO + py
        dd = d[y + step_y, start + step_x:stop + step_x]
        aa = a[y + step_y, start + step_x:stop + step_x]
        bb = b[y + step_y, start + step_x:stop + step_x]
        lu = left_u[y, start - 1:stop + 1]
        lv = left_v[y, start - 1:stop + 1]
        lvar = left_var[y, start:stop]
        ru, rv, rvar = right_u[y], right_v[y], right_var[y]
        row = out[py]
        for x in range(PATCH_COLUMNS):
            place = F4(2 * (start - PAD + x)) - (dd[x] - aa[x] * lean_x - bb[x] * lean_y)
            known = (place >= F4(0)) & (place < F4(width - 1))
            places[x] = place if known else F4(-1)
        # some processors gather slowly: then LLVM would make no SIMD of what follows
        for x in range(PATCH_COLUMNS):
            i = np.int32(max(places[x], F4(0)))
            i0, i1 = np.uint32(i), np.uint32(i + 1)
            us[0][x], us[1][x] = ru[i0], ru[i1]
            vs[0][x], vs[1][x] = rv[i0], rv[i1]
            noises[x] = max(rvar[i0], rvar[i1])
        for x in range(PATCH_COLUMNS):
            known, noise = places[x] >= F4(0), noises[x]
            place = max(places[x], F4(0))
            t = place - F4(np.int32(place))
            slope_u, slope_v = us[1][x] - us[0][x], vs[1][x] - vs[0][x]
            u = us[0][x] + slope_u * t
            v = vs[0][x] + slope_v * t
            gain = foreshortening(aa[x], bb[x], psf)
            own = F4(1) - F4(2) * gain
            own_u = own * lu[x + 1] + gain * (lu[x] + lu[x + 2])
            own_v = own * lv[x + 1] + gain * (lv[x] + lv[x + 2])
            error_u = own_u - (m00 * u + m01 * v + m02)
            error_v = own_v - (m10 * u + m11 * v + m12)
            spread = (scale * (lvar[x] + noise)
                      + PHASE_VARIANCE * (slope_u * slope_u + slope_v * slope_v))
            chi = (error_u * error_u + error_v * error_v) / spread
            chi = min(chi, cap)
            chi = chi if noise < SILENT_VARIANCE else NEUTRAL_SHARE * cap
            misfits[x] = chi if known else cap
        for x in range(PATCH_COLUMNS):
            row[x] = misfits[x]


@part(fastmath=FAST)
def best_shifted_mean(misfit, mean, cost):
    """
    Write cost, float32 tile: the lowest of the nine 3 x 3 means that contain a node.

    Windows that may shift do not straddle a depth edge. mean is a float32 patch of scratch.

    """
    ninth = F4(1.0 / 9.0)
    for y in range(1, PATCH_ROWS - 1):
        above, here, below = misfit[y - 1], misfit[y], misfit[y + 1]
        row = mean[y]
        for x in range(PATCH_MARGIN - 1, PATCH_COLUMNS - PATCH_MARGIN + 1):
            row[x] = ninth * (above[x - 1] + above[x] + above[x + 1] + here[x - 1] + here[x]
                              + here[x + 1] + below[x - 1] + below[x] + below[x + 1])
    for y in range(TILE_ROWS):
        above, here, below = mean[y + 1], mean[y + 2], mean[y + 3]
        row = cost[y]
        for x in range(TILE_COLUMNS):
            at = x + PATCH_MARGIN
            low = min(min(above[at - 1], above[at]), above[at + 1])
            low = min(low, min(min(here[at - 1], here[at]), here[at + 1]))
            row[x] = min(low, min(min(below[at - 1], below[at]), below[at + 1]))


@banded()
def propagate(k, left_u, left_v, left_var, right_u, right_v, right_var, psf, matrix, scale, cap,
              inertia, brightness, d, a, b, tiles, step, judged, new_d, new_a, new_b, cost):
    """
    Let the nodes of some tiles try the planes of their neighbors `step` nodes away.

    A node takes the plane that fits best (see `best_shifted_mean`); its own one is favored by
    `inertia`. If it is `judged`, cost holds its cost from an earlier call. Reads d, a, b, writes
    new_* and cost in the tiles only. Tiles without any known plane in reach stay unknown, at a
    cost of `cap`. brightness: arrays of left and right brightness with their variances and the
    scale of these, see `texture_kernels`; arrays without entries where it does not count.

    """
    first, last = band(k, tiles.shape[0])
    misfit, mean, trial, best = stack_patch(), stack_patch(), stack_tile(), stack_tile()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        reach = step + HALO
        if not any_above(d[top - reach:top + TILE_ROWS + reach,
                           left - reach:left + TILE_COLUMNS + reach], F4(-np.inf)):
            new_d[top:top + TILE_ROWS, left:left + TILE_COLUMNS] = NAN
            cost[top:top + TILE_ROWS, left:left + TILE_COLUMNS] = cap
            continue
        for candidate in range(5):
            step_y = step * ((candidate == 2) - (candidate == 1))
            step_x = step * ((candidate == 4) - (candidate == 3))
            if candidate == 0 and judged:
                for y in range(TILE_ROWS):
                    for x in range(TILE_COLUMNS):
                        best[y, x] = cost[top + y, left + x]
            else:
                patch_misfit(left_u, left_v, left_var, right_u, right_v, right_var, psf, matrix,
                             scale, cap, d, a, b, top, left, step_y, step_x, misfit)
                if brightness[0].size > 0:
                    add_patch_brightness(brightness[0], brightness[1], brightness[2],
                                         brightness[3], psf, brightness[4], cap, d, a, b, top,
                                         left, step_y, step_x, HALO, PATCH_MARGIN, misfit)
                best_shifted_mean(misfit, mean, best if candidate == 0 else trial)
            take_better(trial, inertia, d, a, b, top, left, step_y, step_x, candidate == 0,
                        best, new_d, new_a, new_b, cost)


@part(fastmath=FAST)
def take_better(trial, inertia, d, a, b, top, left, step_y, step_x, own, best, new_d, new_a,
                new_b, cost):
    """Write the plane of a candidate where its trial cost beats the best so far."""
    if own:
        copy_tile(d, a, b, top, left, new_d, new_a, new_b)
        for y in range(TILE_ROWS):
            for x in range(TILE_COLUMNS):
                cost[top + y, left + x] = best[y, x]
                best[y, x] -= inertia
        return
    lean_x, lean_y = F4(step_x), F4(step_y)
    best_d, best_a, best_b = stack_row(), stack_row(), stack_row()
    costs, lows = stack_row(), stack_row()
    for y in range(TILE_ROWS):
        source, start = top + y + step_y, left + step_x
        old_d = d[source, start:start + TILE_COLUMNS]
        old_a = a[source, start:start + TILE_COLUMNS]
        old_b = b[source, start:start + TILE_COLUMNS]
        row_d = new_d[top + y, left:left + TILE_COLUMNS]
        row_a = new_a[top + y, left:left + TILE_COLUMNS]
        row_b = new_b[top + y, left:left + TILE_COLUMNS]
        row_cost = cost[top + y, left:left + TILE_COLUMNS]
        trials, bests = trial[y], best[y]
        for x in range(TILE_COLUMNS):
            better = trials[x] < bests[x]
            slope_x, slope_y = old_a[x], old_b[x]
            moved = old_d[x] - slope_x * lean_x - slope_y * lean_y
            last_d, last_a, last_b, last_cost = row_d[x], row_a[x], row_b[x], row_cost[x]
            best_d[x] = moved if better else last_d
            best_a[x] = slope_x if better else last_a
            best_b[x] = slope_y if better else last_b
            costs[x] = trials[x] if better else last_cost
            lows[x] = trials[x] if better else bests[x]
        for x in range(TILE_COLUMNS):
            row_d[x] = best_d[x]
            row_a[x] = best_a[x]
            row_b[x] = best_b[x]
            row_cost[x] = costs[x]
            bests[x] = lows[x]
