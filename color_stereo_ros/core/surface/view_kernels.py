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
"""Kernels of the surface method: from images to the colors of nodes; see `grid_kernels`."""

import math

import numpy as np

from .grid_kernels import F4, FAST, I4, PAD, SILENT_VARIANCE, U4
from .tuning import TUNING
from ..compiled import band, banded, LENGTH, part, serial, stack_row

# Constants of `tuning`, compiled into the kernels.
DARK_LEVEL_RANK = TUNING.views.dark_level_rank
LEAST_BRIGHTNESS = F4(TUNING.views.least_brightness)


@banded()
def box_sums(k, pixels, out):
    """
    Sum 2 x 2 pixels into uint32 (H, W): red + green 2^10 + blue 2^20.

    pixels, uint32 (H, W), hold red, green, blue and anything in ascending bytes. out[y, x] covers
    the pixels x, x + 1 of the rows y, y + 1; last row and column are repeated. Four bytes add up
    to ten bits, so that colors can be added, and gathered, as one number.

    """
    height, width = out.shape
    first, last = band(k, height)
    for y in range(first, last):
        above = pixels[y]
        below = pixels[min(y + 1, height - 1)]
        row = out[y]
        for x in range(width):
            a, b = above[x], below[x]
            red = U4((a & U4(0xff)) + (b & U4(0xff)))
            green = U4((a & U4(0xff00)) + (b & U4(0xff00)))
            blue = U4((a & U4(0xff0000)) + (b & U4(0xff0000)))
            row[x] = red | U4(green << U4(2)) | U4(blue << U4(4))
        for x in range(width - 1):
            row[x] = U4(row[x] + row[x + 1])
        row[width - 1] = U4(row[width - 1] + row[width - 1])


@serial()
def channel_levels(pixels, step, known_dark, largest_dark_level, dark, mean):
    """
    Dark level and mean above it of each channel (float32 (3,), DN) in every step-th pixel.

    pixels is uint8 (H, W, 3 or more). The dark level is known_dark, or if that is negative the
    level that one in DARK_LEVEL_RANK pixels does not exceed, at most largest_dark_level: above
    that is light.

    """
    counts = np.zeros((3, 256), np.int64)
    total = 0
    for y in range(step // 2, pixels.shape[0], step):
        for x in range(step // 2, pixels.shape[1], step):
            for channel in range(3):
                counts[channel, pixels[y, x, channel]] += 1
            total += 1
    for channel in range(3):
        level = known_dark
        if known_dark < F4(0):
            at, seen = 0, counts[channel, 0]
            while at < largest_dark_level and seen <= total // DARK_LEVEL_RANK:
                at += 1
                seen += counts[channel, at]
            level = F4(at)
        above = F4(0)
        for at in range(256):
            above += F4(counts[channel, at]) * max(F4(at) - level, F4(0))
        dark[channel] = level
        mean[channel] = above / F4(total)


@banded(fastmath=FAST)
def sample_colors(k, box, index, frac_x, frac_y, stride, dark, gain, softening, saturation, noise,
                  widening, ring, u, v, s, peak, variance):
    """
    Rectify: sample box sums bilinearly at mapped positions and turn them into chromaticity.

    box is uint32 flat with `stride` entries a row, see `box_sums`; index int32 (h, w) names the
    upper left neighbor, -1 = outside. Writes u = (2 r - g - b) / (s + softening),
    v = sqrt(3) (g - b) / (s + softening), s = r + g + b (DN, dark level subtracted, gains
    applied), peak, the brightest raw channel (DN), and the variance of each chromaticity,
    (floor + shot s + relative s^2) / s^2 with noise = (floor, shot, relative), SILENT_VARIANCE
    where a color has no information: outside, all channels from `saturation` on, or black. Outside
    u = v = s = 0, peak = -1.

    widening, float32 (2, h, w) along rows and columns, evens out what nodes see through, see
    `widen_row`; (2, 0, 0): nothing is to be done. ring is float32 (BANDS, 3, 3, w): the last three
    rows of u, those of v, and room for unused values of the bands beside.

    """
    rows = index.shape[0]
    first, last = band(k, rows)
    if first == last:
        return
    plain = widening.shape[1] == 0
    low, high = (first, last) if plain else (max(first - 1, 0), min(last + 1, rows))
    us, vs, spare = ring[k, 0], ring[k, 1], ring[k, 2]
    for y in range(low, high + 1):
        if y < high:
            own = (y >= first) & (y < last)
            sample_row(box, index[y], frac_x[y], frac_y[y], stride, dark, gain, softening,
                       saturation, noise, u[y] if plain else us[y % 3],
                       v[y] if plain else vs[y % 3],
                       s[y] if own else spare[0], peak[y] if own else spare[1],
                       variance[y] if own else spare[2])
        here = y - 1
        if (not plain) & (here >= first) & (here < last):
            above, below = max(here - 1, 0) % 3, min(here + 1, rows - 1) % 3
            widen_row(us[above], us[here % 3], us[below], vs[above], vs[here % 3], vs[below],
                      widening[0, here], widening[1, here], u[here], v[here])


@part(fastmath=FAST)
def sample_row(box, index, frac_x, frac_y, stride, dark, gain, softening, saturation, noise, u, v,
               s, peak, variance):
    """Sample one row of nodes, see `sample_colors`."""
    columns = index.size
    dark_r, dark_g, dark_b = dark[0], dark[1], dark[2]
    gain_r, gain_g, gain_b = gain[0], gain[1], gain[2]
    floor, shot, relative = noise
    root3, one, zero = F4(math.sqrt(3.0)), F4(1), F4(0)
    quarter, ten_bits = F4(0.25), U4(1023)
    us, vs, totals = stack_row(), stack_row(), stack_row()
    peaks, spreads = stack_row(), stack_row()
    for start in range(0, columns, LENGTH):
        stop = min(start + LENGTH, columns)
        places = index[start:stop]
        row_x, row_y = frac_x[start:stop], frac_y[start:stop]
        for x in range(stop - start):
            outside = places[x] < 0
            p = U4(0 if outside else places[x])
            q = U4(p + stride)
            c00, c01, c10, c11 = box[p], box[U4(p + U4(1))], box[q], box[U4(q + U4(1))]
            fx, fy = row_x[x], row_y[x] * quarter
            gx, gy = one - fx, quarter - fy
            w00, w01, w10, w11 = gx * gy, fx * gy, gx * fy, fx * fy
            r = (w00 * F4(I4(c00 & ten_bits)) + w01 * F4(I4(c01 & ten_bits))
                 + w10 * F4(I4(c10 & ten_bits)) + w11 * F4(I4(c11 & ten_bits)))
            g = (w00 * F4(I4((c00 >> U4(10)) & ten_bits))
                 + w01 * F4(I4((c01 >> U4(10)) & ten_bits))
                 + w10 * F4(I4((c10 >> U4(10)) & ten_bits))
                 + w11 * F4(I4((c11 >> U4(10)) & ten_bits)))
            b = (w00 * F4(I4(c00 >> U4(20))) + w01 * F4(I4(c01 >> U4(20)))
                 + w10 * F4(I4(c10 >> U4(20))) + w11 * F4(I4(c11 >> U4(20))))
            highest, lowest = max(r, max(g, b)), min(r, min(g, b))
            r = max(r - dark_r, zero) * gain_r
            g = max(g - dark_g, zero) * gain_g
            b = max(b - dark_b, zero) * gain_b
            total = r + g + b
            scale = one / (total + softening)
            inverse = one / max(total, LEAST_BRIGHTNESS)
            spread = relative + inverse * (shot + floor * inverse)
            silent = outside | (lowest >= saturation) | (spread > SILENT_VARIANCE)
            us[x] = zero if outside else (r + r - g - b) * scale
            vs[x] = zero if outside else (g - b) * (scale * root3)
            totals[x] = zero if outside else total
            peaks[x] = -one if outside else highest
            spreads[x] = SILENT_VARIANCE if silent else spread
        for x in range(stop - start):
            u[start + x] = us[x]
            v[start + x] = vs[x]
            s[start + x] = totals[x]
            peak[start + x] = peaks[x]
            variance[start + x] = spreads[x]


@part(fastmath=FAST)
def widen_row(u0, u1, u2, v0, v1, v2, gain_x, gain_y, out_u, out_v):
    """
    Add second differences along and across a row to its chromaticities, each times its gain.

    u0, u1, u2 are the row above, the row and the row below; the outermost nodes are copied. A
    gain g widens the point spread of a node by 2 g in variance, nodes^2; a negative one
    narrows it.

    """
    last = u1.size - 1
    one, two = F4(1), F4(2)
    for place in (0, last):
        out_u[place], out_v[place] = u1[place], v1[place]
    before_u, here_u, after_u = u1[:last - 1], u1[1:last], u1[2:]
    before_v, here_v, after_v = v1[:last - 1], v1[1:last], v1[2:]
    above_u, below_u, above_v, below_v = u0[1:last], u2[1:last], v0[1:last], v2[1:last]
    along, across = gain_x[1:last], gain_y[1:last]
    inner_u, inner_v = out_u[1:last], out_v[1:last]
    for x in range(inner_u.size):
        own = one - two * (along[x] + across[x])
        inner_u[x] = (own * here_u[x] + along[x] * (before_u[x] + after_u[x])
                      + across[x] * (above_u[x] + below_u[x]))
    for x in range(inner_v.size):
        own = one - two * (along[x] + across[x])
        inner_v[x] = (own * here_v[x] + along[x] * (before_v[x] + after_v[x])
                      + across[x] * (above_v[x] + below_v[x]))


@banded(fastmath=FAST)
def average_alike(k, u, v, variance, reach_y, reach_x, tolerance, noise, out_u, out_v, counts):
    """
    Average the colors of each place with those around it that are alike, in opposite pairs.

    A pair counts if the colors of both are known and close to that of the place: their squared
    distance is below tolerance^2 + noise variance. Two places opposite each other leave the slope
    of a color as it is, and at a depth edge neither counts. counts takes how many places each
    average is of. All arrays are float32 (h, w); unknown, see `sample_colors`, are colors of
    SILENT_VARIANCE. They stay as they are, and count 1.

    """
    rows, columns = u.shape
    first, last = band(k, rows)
    for y in range(first, last):
        mean_u, mean_v, spread, count = out_u[y], out_v[y], variance[y], counts[y]
        for start in range(0, columns, LENGTH):
            stop = min(start + LENGTH, columns)
            bounds = stack_row()
            for x in range(start, stop):
                mean_u[x], mean_v[x], count[x] = u[y, x], v[y, x], F4(1)
                bounds[x - start] = tolerance * tolerance + noise * spread[x]
            for j in range(min(reach_y, y, rows - 1 - y) + 1):
                for i in range(-reach_x if j else 1, reach_x + 1):
                    low, high = max(start, abs(i)), min(stop, columns - abs(i))
                    add_pairs(u, v, variance, y, j, i, low, high, bounds[low - start:], mean_u,
                              mean_v, count)
            for x in range(start, stop):
                known = spread[x] < SILENT_VARIANCE
                share = F4(1) / count[x]
                mean_u[x] = mean_u[x] * share if known else u[y, x]
                mean_v[x] = mean_v[x] * share if known else v[y, x]
                count[x] = count[x] if known else F4(1)


@part(fastmath=FAST)
def add_pairs(u, v, variance, y, j, i, low, high, bounds, sum_u, sum_v, counts):
    """Add the pairs j rows and i columns before and behind a part of a row, `average_alike`."""
    here_u, here_v = u[y, low:high], v[y, low:high]
    rows = (u[y - j, low - i:high - i], v[y - j, low - i:high - i],
            u[y + j, low + i:high + i], v[y + j, low + i:high + i])
    before_u, before_v, behind_u, behind_v = rows
    before, behind = variance[y - j, low - i:high - i], variance[y + j, low + i:high + i]
    total_u, total_v, count = sum_u[low:high], sum_v[low:high], counts[low:high]
    for x in range(here_u.size):
        p_u, p_v = before_u[x] - here_u[x], before_v[x] - here_v[x]
        q_u, q_v = behind_u[x] - here_u[x], behind_v[x] - here_v[x]
        alike = ((p_u * p_u + p_v * p_v < bounds[x]) & (q_u * q_u + q_v * q_v < bounds[x])
                 & (before[x] < SILENT_VARIANCE) & (behind[x] < SILENT_VARIANCE))
        total_u[x] += before_u[x] + behind_u[x] if alike else F4(0)
        total_v[x] += before_v[x] + behind_v[x] if alike else F4(0)
        count[x] += F4(2) if alike else F4(0)


@serial(fastmath=FAST)
def add_color_sums(left_u, left_v, right_u, right_v, d, misfit, worst, rows, columns, step_y,
                   step_x, normal, target):
    """
    Add x x^T to normal (3, 3) and x y^T to target (3, 2), float64, of matched colors.

    x = (u, v, 1) at the place of a node in the right image (linear interpolation), y = (u, v) of
    the node. Every step_y-th row and step_x-th column counts, from the second on, where the
    misfit is below `worst`.

    """
    width = right_u.shape[1]
    for y in range(PAD + 1, PAD + rows, step_y):
        for x in range(PAD + 1, PAD + columns, step_x):
            if not misfit[y, x] < worst:
                continue
            place = F4(2 * (x - PAD)) - d[y, x]
            i = min(max(np.int32(place), np.int32(0)), np.int32(width - 2))
            t = place - F4(i)
            u = right_u[y, i] + t * (right_u[y, i + 1] - right_u[y, i])
            v = right_v[y, i] + t * (right_v[y, i + 1] - right_v[y, i])
            color, goal = (u, v, F4(1)), (left_u[y, x], left_v[y, x])
            for row in range(3):
                for column in range(3):
                    normal[row, column] += color[row] * color[column]
                for column in range(2):
                    target[row, column] += color[row] * goal[column]
