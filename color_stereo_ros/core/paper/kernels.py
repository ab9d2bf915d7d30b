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
Compiled loops of the paper's method: bare arrays in and out.

Conventions of the search. Disparities are counted as k = 0 .. D-1 with d = first + k. The right
row is stored reversed and padded, entry i belonging to column x = W - 1 - first - i, so that the
candidates of a left pixel x are the D entries from i = W - 1 - x on, in the order of k. Unsigned
indices keep numba from testing for negative ones, which would stop the vectorization over k.
Loops over k run to a multiple of LANES: vectors without a remainder are up to twice as fast. The
window sum of the disparities added for that starts at PADDING_COST, so that none of them wins.

"""

import math

import numpy as np

from .tuning import TUNING
from ..compiled import get_num_threads, parallel, prange, serial
from ..status_codes import (
    AMBIGUOUS, DARK, INCONSISTENT, NO_MATCH, OUT_OF_RANGE, OUTSIDE_IMAGE, SATURATED, VALID)

# Constants of `tuning`, compiled into the kernels.
COST_UNIT = TUNING.search.cost_unit
COST_CAP = TUNING.search.cost_cap
FAR = TUNING.search.unlit_ratio
UNKNOWN_COST = TUNING.search.unknown_cost
NO_COST = TUNING.search.no_cost
NO_INDEX = TUNING.search.no_index
LANES = TUNING.search.lanes
PADDING_COST = TUNING.search.padding_cost
LEAST_COMPONENT = TUNING.search.least_component
LEAST_SUM = TUNING.colors.least_sum


def band_count():
    """Return into how many bands of rows parallel kernels cut an image: one per thread."""
    return get_num_threads()


@parallel(error_model='python')
def correct_colors(image, inside, dark, gains, min_signal, saturation, zero_weakest, target,
                   corrected, reason):
    """
    Correct the colors of an image (paper, sec. 2.2) and find the pixels that cannot be used.

    Writes corrected (H, W, 4): components and 1, or four zeros where the pixel cannot be used;
    reason (H, W): VALID where usable, OUTSIDE_IMAGE, DARK or SATURATED.

    """
    height, width = reason.shape
    for y in prange(height):
        for x in range(width):
            red, green, blue = int(image[y, x, 0]), int(image[y, x, 1]), int(image[y, x, 2])
            strongest = max(red - dark[0], green - dark[1], blue - dark[2])
            code = VALID
            if not inside[y, x]:
                code = OUTSIDE_IMAGE
            elif max(red, green, blue) >= saturation:
                code = SATURATED
            elif strongest < min_signal:
                code = DARK
            reason[y, x] = code
            for channel in range(4):
                corrected[y, x, channel] = np.float32(0.0)
            if code == VALID:
                r = max(np.float32(0.0), (red - dark[0]) * gains[0])
                g = max(np.float32(0.0), (green - dark[1]) * gains[1])
                b = max(np.float32(0.0), (blue - dark[2]) * gains[2])
                if zero_weakest:
                    weakest = min(r, g, b)
                    r = r if r > weakest else np.float32(0.0)
                    g = g if g > weakest else np.float32(0.0)
                    b = b if b > weakest else np.float32(0.0)
                factor = np.float32(1.0)
                if target > 0:
                    factor = target / max(r + g + b, np.float32(LEAST_SUM))
                corrected[y, x, 0] = r * factor
                corrected[y, x, 1] = g * factor
                corrected[y, x, 2] = b * factor
                corrected[y, x, 3] = np.float32(1.0)


@serial(error_model='python')
def average_spots(image, inside, dark, min_signal, saturation, step, size, colors, lit):
    """
    Average small squares of an image on a coarse grid.

    Writes colors (rows, columns, 3), above the dark level, and lit (rows, columns): all pixels
    of the square lie inside the raw image and are neither dark nor saturated.

    """
    rows, columns = lit.shape
    share = np.float32(1.0 / (size * size))
    for row in range(rows):
        for column in range(columns):
            red, green, blue = 0, 0, 0
            usable = True
            for y in range(row * step, row * step + size):
                for x in range(column * step, column * step + size):
                    r, g, b = int(image[y, x, 0]), int(image[y, x, 1]), int(image[y, x, 2])
                    red += r
                    green += g
                    blue += b
                    strongest = max(r - dark[0], g - dark[1], b - dark[2])
                    usable &= inside[y, x] and strongest >= min_signal
                    usable &= max(r, g, b) < saturation
            colors[row, column, 0] = red * share - dark[0]
            colors[row, column, 1] = green * share - dark[1]
            colors[row, column, 2] = blue * share - dark[2]
            lit[row, column] = usable


@parallel(error_model='python')
def normalize(colors, reason):
    """Divide smoothed colors (H, W, 4) by their smoothed weight; zeros where not usable."""
    height, width = reason.shape
    for y in prange(height):
        for x in range(width):
            factor = np.float32(0.0)
            if reason[y, x] == VALID:
                factor = np.float32(1.0) / colors[y, x, 3]
            for channel in range(4):
                colors[y, x, channel] *= factor


@serial()
def _fill_right_row(colors, first, ratios_p, ratios_q):
    """Write the ratios to each component of one right row, reversed and padded, (3, W + D - 1)."""
    width = colors.shape[0]
    far = np.float32(FAR)
    ratios_p[:] = far
    ratios_q[:] = far
    for i in range(max(0, -first), min(ratios_p.shape[1], width - first)):
        x = width - 1 - first - i
        if colors[x, 3] > 0:
            for m in range(3):
                scale = np.float32(1.0) / max(colors[x, m], np.float32(LEAST_COMPONENT))
                ratios_p[m, i] = min(far, colors[x, (m + 1) % 3] * scale)
                ratios_q[m, i] = min(far, colors[x, (m + 2) % 3] * scale)


@serial()
def _add_cost_row(colors, ratios_p, ratios_q, ring, sums):
    """
    Replace one row of pixel costs in the ring and update the column sums.

    The paper's squared distance of the scaled colors without its division: with m the largest
    left component, L_m^2 [(L_p/L_m - R_p/R_m)^2 + (L_q/L_m - R_q/R_m)^2].

    """
    width, count = sums.shape
    unit = np.float32(COST_UNIT)
    cap = np.float32(COST_CAP)
    half = np.float32(0.5)
    for x in range(width):
        base = np.uint64(width - 1 - x)
        m = 0
        if colors[x, 1] > colors[x, 0]:
            m = 1
        if colors[x, 2] > colors[x, m]:
            m = 2
        strongest = colors[x, m]
        weight = unit * strongest * strongest
        divisor = max(strongest, np.float32(LEAST_COMPONENT))
        p = colors[x, (m + 1) % 3] / divisor
        q = colors[x, (m + 2) % 3] / divisor
        least = half
        if colors[x, 3] == 0:
            least = np.float32(UNKNOWN_COST)
        for k in range(np.uint64(count)):
            e = ratios_p[m, base + np.uint64(k)] - p
            f = ratios_q[m, base + np.uint64(k)] - q
            cost = np.int32(min(cap, weight * (e * e + f * f) + least))
            sums[x, k] += cost - np.int32(ring[x, k])
            ring[x, k] = np.uint16(cost)


@serial(error_model='python')
def _drop_cost_row(ring, sums):
    """Take one row of pixel costs out of the ring and the column sums."""
    width, count = sums.shape
    for x in range(width):
        for k in range(count):
            sums[x, k] -= np.int32(ring[x, k])
            ring[x, k] = np.uint16(0)


@serial(error_model='python')
def _slide(sums, x, reach, total):
    """Move the window sums of all disparities to column x; total[k + 1] belongs to k."""
    width, count = sums.shape
    one = np.uint64(1)
    enter = np.uint64(min(x + reach, width - 1))
    leave = np.uint64(max(x - reach - 1, 0))
    entering = x + reach < width
    leaving = x - reach - 1 >= 0
    if entering and leaving:
        for k in range(np.uint64(count)):
            total[np.uint64(k) + one] += sums[enter, k] - sums[leave, k]
    elif entering:
        for k in range(np.uint64(count)):
            total[np.uint64(k) + one] += sums[enter, k]
    elif leaving:
        for k in range(np.uint64(count)):
            total[np.uint64(k) + one] -= sums[leave, k]


@serial(error_model='python')
def _best(total, low, high):
    """Return the smallest cost in low <= k < high and its first position."""
    one = np.uint64(1)
    best = np.int32(NO_COST)
    for k in range(np.uint64(low), np.uint64(high)):
        best = min(best, total[np.uint64(k) + one])
    where = np.int32(NO_INDEX)
    for k in range(np.uint64(low), np.uint64(high)):
        here = total[np.uint64(k) + one] == best
        where = min(where, np.int32(k) if here else np.int32(NO_INDEX))
    return best, where


@serial(error_model='python')
def _second(total, low, high, where):
    """Return the smallest local minimum of the cost apart from the one at `where`."""
    one, two = np.uint64(1), np.uint64(2)
    second = np.int32(PADDING_COST)
    for k in range(np.uint64(low), np.uint64(high)):
        cost = total[np.uint64(k) + one]
        minimum = (cost <= total[np.uint64(k)]) & (cost <= total[np.uint64(k) + two])
        apart = (np.int32(k) < where - 1) | (np.int32(k) > where + 1)
        second = min(second, cost if minimum & apart else np.int32(PADDING_COST))
    return second


@serial(error_model='python')
def _offer_to_right(total, low, high, base, right_cost, right_index):
    """Let the left pixel bid for its candidates: each right pixel keeps the cheapest k."""
    start, one = np.uint64(base), np.uint64(1)
    for k in range(np.uint64(low), np.uint64(high)):
        cost = total[np.uint64(k) + one]
        kept = right_cost[start + np.uint64(k)]
        right_cost[start + np.uint64(k)] = min(cost, kept)
        right_index[start + np.uint64(k)] = (
            np.int32(k) if cost < kept else right_index[start + np.uint64(k)])


@serial(error_model='python')
def _search_row(usable, sums, reach, count, low, high, total, right_cost, right_index, winner,
                costs):
    """
    Find the winner of each left pixel of one row.

    Writes winner (W, 2): k of the winner and k of the winner of its right pixel, -1 where the
    left pixel is not usable; costs (W, 4): cost before, at and after the winner, and of the best
    other minimum.

    """
    width, padded = sums.shape
    total[:] = 0
    total[0] = PADDING_COST
    total[count + 1:] = PADDING_COST
    right_cost[:] = NO_COST
    right_index[:] = -1
    for x in range(min(reach, width)):
        for k in range(padded):
            total[k + 1] += sums[x, k]
    for x in range(width):
        _slide(sums, x, reach, total)
        winner[x, 0] = -1
        if usable[x, 3] > 0:
            stop = padded if high[x] == count else high[x]
            best, where = _best(total, low[x], stop)
            _offer_to_right(total, low[x], stop, width - 1 - x, right_cost, right_index)
            winner[x, 0] = where
            costs[x, 0] = total[where]
            costs[x, 1] = best
            costs[x, 2] = total[where + 2]
            costs[x, 3] = _second(total, low[x], stop, where)
    for x in range(width):
        winner[x, 1] = -1
        if winner[x, 0] >= 0:
            winner[x, 1] = right_index[width - 1 - x + winner[x, 0]]


@parallel(error_model='python')
def search(left, right, first, count, reach_x, reach_y, low, high, ring, sums, total, ratios,
           right_cost, right_index, winner, costs):
    """
    Search the corresponding points of an image (paper, sec. 2.2: minimum of Q over the window).

    One band of rows per first index of the buffers, each band with its own. Writes winner
    (H, W, 2) and costs (H, W, 4); see _search_row.

    """
    bands = ring.shape[0]
    height = left.shape[0]
    rows = 2 * reach_y + 1
    for band in prange(bands):
        start = band * height // bands
        stop = (band + 1) * height // bands
        ring[band] = 0
        sums[band] = 0
        for y in range(start - reach_y, stop + reach_y):
            slot = (y + rows) % rows
            if 0 <= y < height:
                _fill_right_row(right[y], first, ratios[band, 0], ratios[band, 1])
                _add_cost_row(left[y], ratios[band, 0], ratios[band, 1], ring[band, slot],
                              sums[band])
            else:
                _drop_cost_row(ring[band, slot], sums[band])
            center = y - reach_y
            if center >= start:
                _search_row(left[center], sums[band], reach_x, count, low[center], high[center],
                            total[band], right_cost[band], right_index[band], winner[center],
                            costs[center])


@serial(error_model='python')
def _offset(before, best, after, subpixel):
    """
    Return the offset of the minimum from the middle one of three costs, px.

    subpixel 1: parabola; 2: the better neighbor and the winner, weighted with each other's cost
    (paper, sec. 3); 0: none.

    """
    if subpixel == 1:
        return np.float32(0.5) * (before - after) / (before - best + after - best)
    if subpixel == 2:
        neighbor = min(before, after)
        share = best / max(best + neighbor, np.float32(1.0))  # whole numbers: 0 or at least 1
        return share if after < before else -share
    return np.float32(0.0)


@parallel(error_model='python')
def accept_winners(winner, costs, reason, right, first, count, low, high, tolerance, uniqueness,
                   subpixel, independent, smallest, largest, disparity, deviation, status):
    """
    Turn winners into disparities, or into the reason why there is none.

    Reads winner (H, W, 2) and costs (H, W, 4) of the search, the number of independent pixels in
    a window and the limits of the disparity; writes disparity and deviation (its standard
    deviation), (H, W), and status (H, W), the codes of Status.

    """
    height, width = status.shape
    one = np.float32(1.0)
    distinct = one + np.float32(uniqueness)
    independent = np.float32(independent)
    for y in prange(height):
        for x in range(width):
            k = winner[y, x, 0]
            column = x - first - k
            before, best = np.float32(costs[y, x, 0]), np.float32(costs[y, x, 1])
            after, second = np.float32(costs[y, x, 2]), np.float32(costs[y, x, 3])
            bend = before - best + after - best
            code = int(reason[y, x])
            if code == VALID:
                if k == 0 or k == count - 1:
                    code = OUT_OF_RANGE  # least at a limit: the minimum may lie outside
                elif k == low[y, x] or k == high[y, x] - 1 or column < 0 or column >= width:
                    code = NO_MATCH
                elif right[y, column, 3] == 0:
                    code = NO_MATCH
                elif tolerance > 0 and abs(winner[y, x, 1] - k) > tolerance:
                    code = INCONSISTENT
                elif bend <= 0 or second <= best * distinct:
                    code = AMBIGUOUS  # one color: another place has the same cost
            found = np.float32(np.nan)
            if code == VALID:
                found = first + k + _offset(before, best, after, subpixel)
                if found < smallest or found > largest:
                    code = OUT_OF_RANGE
                    found = np.float32(np.nan)
            status[y, x] = code
            disparity[y, x] = found
            deviation[y, x] = np.nan
            if code == VALID:
                # Least squares: with Q = Q0 + bend / 2 (d - d0)^2 and a noise of Q0 / (2 n) per
                # color difference, the variance of d0 is that noise over half the bend.
                noise = max(best, one) / independent
                deviation[y, x] = math.sqrt(noise / bend)
