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
Kernels of the coarse search: bare arrays in and out; `coarse` gives them meaning.

The *coarse grid* has one node per `2 * factor` pixels, the half grid (see `grid_kernels`) one
per two. A *volume*, int16 (lines, D, lanes), holds a number for every node and disparity; it comes
in two layouts: the rows of the coarse grid are its lines, or the columns. A semi-global
path runs from line to line, so that all lanes, and all disparities, go through one SIMD loop.

"""

import math

import numpy as np

from .grid_kernels import F4, FAST, I4, PAD
from .tuning import TUNING
from ..compiled import band, banded, LENGTH, part, stack_integers

I2 = np.int16
LARGEST = I2(32767)
# Constants of `tuning`, compiled into the kernels.
RIVAL_DISTANCE = TUNING.repetition.rival_distance
AGREEMENT = TUNING.coarse.agreement
GUARD_COST = I2(TUNING.coarse.guard_cost)


@banded(fastmath=FAST)
def reduce_colors(k, u, v, s, top, left, step_x, step_y, softening, scale, full_trust, out_u,
                  out_v, out_s, out_w, scratch):
    """
    Average step_y x step_x nodes, from (top, left) on, into one coarse node, quantized to int16.

    Chromaticities are averaged as colors (weighted by brightness). out_u, out_v are in units of
    1 / scale, out_s (float32) is the mean brightness, out_w the trust 0..16 that rises with
    brightness and is full at full_trust (DN). scratch is float32 (BANDS, 3, nodes of a row that
    count).

    """
    rows, columns = out_u.shape
    count = F4(step_x * step_y)
    first, last = band(k, rows)
    sums = scratch[k]
    used = columns * step_x
    sum_u, sum_v, sum_s = sums[0, :used], sums[1, :used], sums[2, :used]
    for y in range(first, last):
        sums[:] = F4(0)
        for j in range(top + y * step_y, top + (y + 1) * step_y):
            us, vs = u[j, left:left + sum_s.size], v[j, left:left + sum_s.size]
            totals = s[j, left:left + sum_s.size]
            for i in range(sum_s.size):
                weight = totals[i] + softening
                sum_u[i] += us[i] * weight
                sum_v[i] += vs[i] * weight
                sum_s[i] += totals[i]
        for x in range(columns):
            color_u, color_v, light = F4(0), F4(0), F4(0)
            for i in range(x * step_x, (x + 1) * step_x):
                color_u += sum_u[i]
                color_v += sum_v[i]
                light += sum_s[i]
            norm = scale / (light + softening * count)
            out_u[y, x] = I2(color_u * norm)
            out_v[y, x] = I2(color_v * norm)
            out_s[y, x] = light / count
            out_w[y, x] = I2(min(F4(16), F4(16) * light / (full_trust * count)))


@part()
def cost_line(left_u, left_v, left_t, left_w, low_u, low_v, high_u, high_v, right_t, right_w, cap,
              neutral, out):
    """
    Write the matching costs of one line of nodes at one disparity, int16.

    Colors between low and high cost nothing. A dark pixel on either side moves the cost towards
    `neutral`, which favors no disparity.

    """
    zero = I2(0)
    for i in range(out.size):
        du = max(max(I2(left_u[i] - high_u[i]), I2(low_u[i] - left_u[i])), zero)
        dv = max(max(I2(left_v[i] - high_v[i]), I2(low_v[i] - left_v[i])), zero)
        dt = I2(left_t[i] - right_t[i])
        cost = I2(I2(du + dv) + max(dt, I2(-dt)))
        cost = min(cost, cap)
        trust = min(left_w[i], right_w[i])
        out[i] = I2(neutral + (I2(I2(cost - neutral) * trust) >> I2(4)))


@banded()
def cost_volume(k, left, right, start, line_step, disparity_step, cap, neutral, cost, scratch):
    """
    Fill a volume with costs summed over 3 x 3 coarse nodes, see `sum_window` (borders repeated).

    left is int16 (4, lines, lanes): u, v, texture, trust. right, int16 (6, N): lowest u and v,
    highest u and v, texture, trust. It is flat: at the d-th disparity, lane 0 of line n
    is compared with entry start + n line_step - d disparity_step.
    scratch is int16 (BANDS, 4, D, lanes + 2): three lines of costs and a sum.

    """
    lines, depth, lanes = cost.shape
    first, last = band(k, lines)
    ring = scratch[k]
    for line in range(first - 1, last + 1):
        n = min(max(line, 0), lines - 1)
        newest = ring[(line + 3) % 3]
        for d in range(depth):
            at = start + n * line_step - d * disparity_step
            to = at + lanes
            cost_line(left[0, n], left[1, n], left[2, n], left[3, n], right[0, at:to],
                      right[1, at:to], right[2, at:to], right[3, at:to], right[4, at:to],
                      right[5, at:to], cap, neutral, newest[d, :lanes])
        if line > first:
            for d in range(depth):
                sum_window(ring[line % 3, d], ring[(line + 1) % 3, d], ring[(line + 2) % 3, d],
                           ring[3, 0], cost[line - 1, d])


@part()
def sum_window(below, above, here, total, out):
    """
    Sum three lines and then three neighbors, int16; total, (lanes + 2,), is scratch.

    The weights are 1, 2, 1 along both directions, halved, so that their sum is 8: edges stay in
    place, and the surroundings do not outvote thin things.

    """
    lanes = out.size
    middle = total[1:lanes + 1]
    for i in range(lanes):
        middle[i] = I2(I2(above[i] + below[i]) + I2(here[i] + here[i]))
    total[0] = total[1]
    total[lanes + 1] = total[lanes]
    after = total[2:]
    for i in range(lanes):
        out[i] = I2(I2(I2(total[i] + after[i]) + I2(middle[i] + middle[i])) >> I2(1))


@banded(count=2)
def sgm_paths(layout, cost, turned_cost, small, large, total, turned_total, scratch):
    """
    Write the path costs from above and below into total, those from the sides into turned_total.

    scratch is int16 (2, 2 D + 3, lanes of either layout).

    """
    for backwards in range(2):
        if layout == 0:
            follow_paths(cost, backwards, small, large, total, scratch[layout])
        else:
            follow_paths(turned_cost, backwards, small, large, turned_total, scratch[layout])


@part()
def follow_paths(cost, backwards, small, large, total, scratch):
    """
    Follow the semi-global paths through all lines of a volume (Hirschmueller 2008, eq. 13).

    L(d) = C(d) + min(L'(d), L'(d -+ 1) + small, min L' + large) - min L', where ' is the line
    before. Only L' - min L' of a line is kept, so that no term differs from lane to lane. The
    forward pass writes total, the backward pass adds to it.

    """
    lines, depth, lanes = cost.shape
    used = scratch.reshape(-1)[:(2 * depth + 3) * lanes].reshape(2 * depth + 3, lanes)
    lowest, spare, path = used[0], used[1:depth + 1], used[depth + 1:]
    path[:] = I2(0)  # no line precedes the first one
    path[0] = GUARD_COST
    path[depth + 1] = GUARD_COST
    for step in range(lines):
        line = lines - 1 - step if backwards else step
        latest = spare if backwards else total[line]
        extend_paths(cost[line].reshape(-1), path.reshape(-1), small, large, lanes,
                     latest.reshape(-1))
        subtract_lowest(latest, lowest, path)
        if backwards:
            add_row(latest.reshape(-1), total[line].reshape(-1))


@part()
def extend_paths(cost, path, small, large, lanes, latest):
    """Write latest = cost + the cheapest step, for all disparities and lanes of a line."""
    size = latest.size
    before, same, after = path[:size], path[lanes:lanes + size], path[2 * lanes:2 * lanes + size]
    for i in range(size):
        step = min(min(same[i], I2(min(before[i], after[i]) + small)), large)
        latest[i] = I2(cost[i] + step)


@part()
def subtract_lowest(latest, lowest, path):
    """Write the costs of a line less the lowest of each lane between the guards of path."""
    depth, lanes = latest.shape
    for i in range(lanes):
        lowest[i] = LARGEST
    for d in range(depth):
        row = latest[d]
        for i in range(lanes):
            lowest[i] = min(lowest[i], row[i])
    for d in range(depth):
        row, out = latest[d], path[d + 1]
        for i in range(lanes):
            out[i] = I2(row[i] - lowest[i])


@banded()
def add_turned(k, pairs, columns, total):
    """
    Add the turned path costs to total, int16 (rows, D, columns).

    pairs, int32, are those of int16 (columns, D, even number of rows), flat: one gather fetches
    the costs of two rows.

    """
    rows, depth = total.shape[0], total.shape[1]
    stride = np.uint32(pairs.size // columns)
    first, last = band(k, depth)
    even, odd = stack_integers(), stack_integers()
    for d in range(first, last):
        for left in range(0, columns, LENGTH):
            right = min(left + LENGTH, columns)
            for y in range(0, rows, 2):
                found = pairs[left * stride + d * (stride // depth) + y // 2:]
                for i in range(right - left):
                    pair = found[np.uint32(i) * stride]
                    even[i] = I2(pair)
                    odd[i] = I2(pair >> I4(16))
                add_row(even, total[y, d, left:right])
                if y + 1 < rows:
                    add_row(odd, total[y + 1, d, left:right])


@part()
def add_row(row, out):
    """Add to the entries of out those of a row that may be longer, int16."""
    for i in range(out.size):
        out[i] = I2(out[i] + row[i])


@part()
def cheapest(total, start, least, best):
    """Find the lowest cost of LENGTH lanes from start on and its first index, int16 stack rows."""
    lanes = min(LENGTH, total.shape[1] - start)
    for i in range(lanes):
        least[i] = LARGEST
        best[i] = I2(0)
    for d in range(total.shape[0]):
        row = total[d, start:start + lanes]
        for i in range(lanes):
            best[i] = I2(d) if row[i] < least[i] else best[i]
            least[i] = min(least[i], row[i])


@part()
def has_rival(total, x, at, bound):
    """Return whether a disparity that is no neighbor of the best, at, costs less than bound."""
    for d in range(total.shape[0]):
        if abs(d - at) > RIVAL_DISTANCE and total[d, x] < bound:
            return True
    return False


@banded()
def count_rivals(k, total, trust, full_trust, worst, gap, step, counts):
    """
    Count the nodes that match well at two places.

    Looks at every step-th node of every step-th row whose trust, int16 (rows, columns), is
    full_trust, and whose best match costs less than worst. counts, int64 (BANDS, 2), takes how
    many there are, and how many have a disparity more than RIVAL_DISTANCE nodes from the best one
    that costs less than gap more.

    """
    rows = total.shape[0]
    first, last = band(k, rows)
    least, best = stack_integers(), stack_integers()
    counts[k, 0] = 0
    counts[k, 1] = 0
    for y in range(first + (-first) % step, last, step):
        costs = total[y]
        for left in range(0, costs.shape[1], LENGTH):
            cheapest(costs, left, least, best)
            stop = min(left + LENGTH, costs.shape[1])
            for x in range(left + (-left) % step, stop, step):
                at, low = I4(best[x - left]), I4(least[x - left])
                if (trust[y, x] >= full_trust) & (low < worst):
                    counts[k, 0] += 1
                    if has_rival(costs, x, at, low + gap):
                        counts[k, 1] += 1


@banded()
def rival_gaps(k, cost, total, gaps):
    """
    Write by how much the own colors of nodes favor their match over its nearest rival.

    cost and total, int16 (rows, D, columns): of the nodes alone, and along the paths, which choose
    the match and its rival, the cheapest one more than RIVAL_DISTANCE nodes away. gaps, float32
    (rows, columns): cost of the rival less that of the match; LARGEST where there is no rival.

    """
    rows, depth, columns = total.shape
    first, last = band(k, rows)
    least, best = stack_integers(), stack_integers()
    second, rival = stack_integers(), stack_integers()
    for y in range(first, last):
        for left in range(0, columns, LENGTH):
            lanes = min(LENGTH, columns - left)
            cheapest(total[y], left, least, best)
            for i in range(lanes):
                second[i], rival[i] = LARGEST, best[i]
            for d in range(depth):
                row = total[y, d, left:left + lanes]
                for i in range(lanes):
                    cheaper = (abs(d - best[i]) > RIVAL_DISTANCE) & (row[i] < second[i])
                    rival[i] = I2(d) if cheaper else rival[i]
                    second[i] = row[i] if cheaper else second[i]
            for i in range(lanes):
                gaps[y, left + i] = F4(LARGEST) if rival[i] == best[i] else (
                    F4(cost[y, rival[i], left + i]) - F4(cost[y, best[i], left + i]))


@part()
def tip_offset(before, here, after):
    """Return the offset of the tip of a V with equal slopes through three costs, float32."""
    rise = max(before, after) - here
    return F4(0.5) * F4(before - after) / F4(rise) if rise > 0 else F4(0)


@banded()
def winners(k, total, first, least_gap, disparity, clear, scratch):
    """
    Winner-takes-all with left-right consistency on the coarse grid; total is (rows, D, columns).

    Writes disparity (coarse nodes, V-fit between neighbors, NaN where the right image prefers
    a left node more than AGREEMENT away), and clear, float32: 1, or 0 where a disparity more than
    RIVAL_DISTANCE nodes away costs less than least_gap more. scratch int32 (BANDS, 2, columns).

    """
    rows, depth, columns = total.shape
    start, stop = band(k, rows)
    best_left, best_right = scratch[k, 0], scratch[k, 1]
    least, best = stack_integers(), stack_integers()
    for y in range(start, stop):
        costs = total[y]
        best_right[:] = 1 << 28
        for left in range(0, columns, LENGTH):
            cheapest(costs, left, least, best)
            for x in range(left, min(left + LENGTH, columns)):
                at, low = I4(best[x - left]), I4(least[x - left])
                disparity[y, x] = F4(first + at)
                if 0 < at < depth - 1:
                    disparity[y, x] += tip_offset(I4(costs[at - 1, x]), low,
                                                  I4(costs[at + 1, x]))
                clear[y, x] = F4(1)
                if least_gap > 0 and has_rival(costs, x, at, low + least_gap):
                    clear[y, x] = F4(0)
                best_left[x] = first + at
                right = x - (first + at)
                if 0 <= right < columns:
                    # cost and disparity in one number: the cheaper, then the nearer one wins
                    bid = I4(low * 4096 + 2048 - (first + at))
                    best_right[right] = min(best_right[right], bid)
        for x in range(columns):
            right = x - best_left[x]
            if 0 <= right < columns:
                rival = 2048 - best_right[right] % 4096
                if abs(rival - best_left[x]) > AGREEMENT:
                    disparity[y, x] = np.nan
            else:
                disparity[y, x] = np.nan


@banded()
def seed_planes(k, coarse, factor, offset, rows, columns, d, a, b):
    """
    Give every node of the (rows, columns) half grid the plane of its coarse node.

    Slopes are the smaller of the two one-sided differences, so that they do not reach across a
    depth edge. coarse is in coarse nodes; d, a, b in full pixels per node, framed; NaN stays.
    offset (px) is added: the coarse grids of left and right may be shifted.

    """
    coarse_rows, coarse_columns = coarse.shape
    unit = F4(2 * factor)
    center = F4(0.5 * (factor - 1))
    first, last = band(k, rows)
    for y in range(first, last):
        cy = min(y // factor, coarse_rows - 1)
        off_y = F4(y - cy * factor) - center
        for cx in range(coarse_columns):
            here = coarse[cy, cx]
            slope_x = F4(2) * smaller_step(coarse[cy, max(cx - 1, 0)], here,
                                           coarse[cy, min(cx + 1, coarse_columns - 1)])
            slope_y = F4(2) * smaller_step(coarse[max(cy - 1, 0), cx], here,
                                           coarse[min(cy + 1, coarse_rows - 1), cx])
            base = here * unit + offset + slope_y * off_y
            stop = columns if cx == coarse_columns - 1 else (cx + 1) * factor
            for x in range(cx * factor, stop):
                d[y + PAD, x + PAD] = base + slope_x * (F4(x - cx * factor) - center)
                a[y + PAD, x + PAD] = slope_x
                b[y + PAD, x + PAD] = slope_y


@part()
def smaller_step(before, here, after):
    """Return the smaller in magnitude of two differences, 0 where neither is known."""
    backward = here - before
    forward = after - here
    if math.isnan(backward):
        backward = forward
    if math.isnan(forward):
        forward = backward
    if math.isnan(backward):
        return F4(0)
    return backward if abs(backward) < abs(forward) else forward
