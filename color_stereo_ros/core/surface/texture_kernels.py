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
"""Kernels of the surface method: brightness as a carrier beside color; see `grid_kernels`."""

import numpy as np

from .grid_kernels import (
    F4, FAST, foreshortening, NAN, PAD, PHASE_VARIANCE, SILENT_VARIANCE, TILE_COLUMNS, TILE_ROWS)
from .tuning import TUNING
from ..compiled import band, banded, part, stack_row

# Constants of `tuning`, compiled into the kernels.
BRIGHTNESS_CAP = F4(TUNING.brightness.brightness_cap)
FULL_SCALE = F4(np.iinfo(np.uint8).max)


@banded(fastmath=FAST)
def local_colors(k, u, v, s, mean, row, column, level, out):
    """
    Write colors whose brightness is that against the surroundings, uint8 (h, w, 1 or 3).

    u, v, s and mean, float32: chromaticities, brightness and mean brightness around (DN). Node
    (j, i) of out is entry (row + j, column + i) of them. The mean of the surroundings becomes
    `level` (DN) in each channel; a gray image takes one channel.

    """
    rows, columns, channels = out.shape
    first, last = band(k, rows)
    half, root = F4(0.5), F4(1 / np.sqrt(3.0))
    for j in range(first, last):
        us, vs, light, around = u[row + j], v[row + j], s[row + j], mean[row + j]
        for i in range(columns):
            at = column + i
            total = level * light[at] / around[at]
            if channels == 1:
                out[j, i, 0] = np.uint8(min(max(total, F4(0)), FULL_SCALE))
                continue
            red = total * (F4(1) + us[at])
            rest = half * (F4(3) * total - red)
            apart = half * F4(3) * total * vs[at] * root
            out[j, i, 0] = np.uint8(min(max(red, F4(0)), FULL_SCALE))
            out[j, i, 1] = np.uint8(min(max(rest + apart, F4(0)), FULL_SCALE))
            out[j, i, 2] = np.uint8(min(max(rest - apart, F4(0)), FULL_SCALE))


@banded(fastmath=FAST)
def linearize_brightness(k, left_t, left_var, right_t, right_var, psf, d, a, b, tiles,
                         robust_misfit, scale, reference, fold, weight, moment, misfit,
                         own_misfit):
    """
    Add the brightness of every node of some tiles to its linearized colors.

    As `plane_kernels.linearize`, for one carrier. own_misfit takes the misfit of the brightness
    alone, NaN where it is unknown. If `fold`, misfit becomes that of all three carriers, scaled
    to an average of 2, in which brightness counts up to BRIGHTNESS_CAP; twice that of the
    brightness where the colors say nothing.

    """
    width = right_t.shape[1]
    one, two, three, half, sixth = F4(1), F4(2), F4(3), F4(0.5), F4(1 / 6)
    first, last = band(k, tiles.shape[0])
    weights, moments, misfits, sums = stack_row(), stack_row(), stack_row(), stack_row()
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        for y in range(top, top + TILE_ROWS):
            rt, rvar = right_t[y], right_var[y]
            lt = left_t[y, left - 1:left + TILE_COLUMNS + 1]
            lvar = left_var[y, left - 1:left + TILE_COLUMNS + 1]
            dd = d[y, left:left + TILE_COLUMNS]
            aa = a[y, left:left + TILE_COLUMNS]
            bb = b[y, left:left + TILE_COLUMNS]
            out_weight = weight[y, left:left + TILE_COLUMNS]
            out_moment = moment[y, left:left + TILE_COLUMNS]
            out_misfit = misfit[y, left:left + TILE_COLUMNS]
            out_own = own_misfit[y, left:left + TILE_COLUMNS]
            for x in range(TILE_COLUMNS):
                place = F4(2 * (left - PAD + x)) - dd[x]
                known = (place >= one) & (place < F4(width - 2))
                place = place if known else one
                i = np.int32(place)
                t = place - F4(i)
                i0, i1 = np.uint32(i - 1), np.uint32(i)
                i2, i3 = np.uint32(i + 1), np.uint32(i + 2)
                t0, t1, t2, t3 = rt[i0], rt[i1], rt[i2], rt[i3]
                value = (sixth * t * (t * (three - t) - two) * t0
                         + (one + half * t * (t * (t - two) - one)) * t1
                         + half * t * (two + t * (one - t)) * t2
                         + sixth * t * (t * t - one) * t3)
                slope = (sixth * (t * (F4(6) - three * t) - two) * t0
                         + half * (t * (three * t - F4(4)) - one) * t1
                         + half * (two + t * (two - three * t)) * t2
                         + sixth * (three * t * t - one) * t3)
                gain = foreshortening(aa[x], bb[x], psf)
                gain = gain if max(lvar[x], lvar[x + 2]) < SILENT_VARIANCE else F4(0)
                own = (one - two * gain) * lt[x + 1] + gain * (lt[x] + lt[x + 2])
                error = own - value
                noise = max(rvar[i1], rvar[i2])
                informed = known & (noise < SILENT_VARIANCE) & (lvar[x + 1] < SILENT_VARIANCE)
                steep = slope * slope
                w = one / (scale * (lvar[x + 1] + noise) + PHASE_VARIANCE * steep)
                chi = w * error * error
                w = w / (one + chi / robust_misfit)
                strength = w * steep
                pulled = strength * (dd[x] - reference) - w * slope * error
                weights[x] = out_weight[x] + (strength if informed else F4(0))
                moments[x] = out_moment[x] + (pulled if informed else F4(0))
                misfits[x] = chi if informed else NAN
                bright = min(chi, BRIGHTNESS_CAP)
                folded = F4(2) / F4(3) * (out_misfit[x] + bright)
                folded = folded if out_misfit[x] == out_misfit[x] else F4(2) * bright
                sums[x] = folded if informed & fold else out_misfit[x]
            for x in range(TILE_COLUMNS):
                out_weight[x] = weights[x]
                out_moment[x] = moments[x]
                out_misfit[x] = sums[x]
                out_own[x] = misfits[x]


@banded(fastmath=FAST)
def add_seeds(k, seed, d, tiles, gate, seed_weight, reference, weight, moment):
    """
    Add what a search has found to the linearized nodes of some tiles.

    A node of some weight whose seed (px, framed, NaN = none) lies within gate (px) of its
    disparity asks for that seed, too, with seed_weight (px^-2).

    """
    first, last = band(k, tiles.shape[0])
    for tile in range(first, last):
        top, left = tiles[tile, 0], tiles[tile, 1]
        for y in range(top, top + TILE_ROWS):
            found, here = seed[y, left:left + TILE_COLUMNS], d[y, left:left + TILE_COLUMNS]
            weights = weight[y, left:left + TILE_COLUMNS]
            moments = moment[y, left:left + TILE_COLUMNS]
            for x in range(TILE_COLUMNS):
                near = (abs(found[x] - here[x]) < gate) & (weights[x] > F4(0))
                moments[x] += seed_weight * (found[x] - reference) if near else F4(0)
                weights[x] += seed_weight if near else F4(0)


@part(fastmath=FAST)
def add_patch_brightness(left_t, left_var, right_t, right_var, psf, scale, cap, d, a, b, top,
                         left, step_y, step_x, halo, margin, out):
    """
    Add the misfit of the brightness to that of the colors of a patch.

    See `neighbor_kernels.patch_misfit`; the sum is scaled as in `linearize_brightness`. halo and
    margin are the rows and columns of the patch around its tile.

    """
    width = right_t.shape[1]
    start = left - margin
    stop = start + out.shape[1]
    lean_x, lean_y = F4(step_x), F4(step_y)
    sums = stack_row()
    for py in range(out.shape[0]):
        y = top - halo + py
        dd = d[y + step_y, start + step_x:stop + step_x]
        aa = a[y + step_y, start + step_x:stop + step_x]
        bb = b[y + step_y, start + step_x:stop + step_x]
        lt, lvar = left_t[y, start - 1:stop + 1], left_var[y, start:stop]
        rt, rvar = right_t[y], right_var[y]
        row = out[py]
        for x in range(out.shape[1]):
            place = F4(2 * (start - PAD + x)) - (dd[x] - aa[x] * lean_x - bb[x] * lean_y)
            known = (place >= F4(0)) & (place < F4(width - 1))
            place = place if known else F4(0)
            i = np.int32(place)
            t = place - F4(i)
            i0, i1 = np.uint32(i), np.uint32(i + 1)
            slope = rt[i1] - rt[i0]
            noise = max(rvar[i0], rvar[i1])
            gain = foreshortening(aa[x], bb[x], psf)
            own = (F4(1) - F4(2) * gain) * lt[x + 1] + gain * (lt[x] + lt[x + 2])
            error = own - (rt[i0] + slope * t)
            chi = error * error / (scale * (lvar[x] + noise) + PHASE_VARIANCE * slope * slope)
            total = F4(2) / F4(3) * (row[x] + min(chi, BRIGHTNESS_CAP))
            total = total if known & (noise < SILENT_VARIANCE) else row[x]
            sums[x] = min(total, cap)
        for x in range(out.shape[1]):
            row[x] = sums[x]
