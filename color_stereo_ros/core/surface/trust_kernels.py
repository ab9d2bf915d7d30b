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
"""Kernels of the surface method: how far a node can be trusted; see `grid_kernels`."""

import math

import numpy as np

from .grid_kernels import F4, FAST, I4, PAD, TILE_COLUMNS
from .tuning import TUNING
from ..compiled import band, banded, BANDS, LENGTH, part, serial, stack_row
from ..status_codes import (
    AMBIGUOUS, DARK, IMPLAUSIBLE, INCONSISTENT, NO_MATCH, OUT_OF_RANGE, OUTSIDE_IMAGE, SATURATED)

EVIDENCE = 'cost', 'misfit', 'sigma', 'apart', 'imbalance'
APART = EVIDENCE.index('apart')
# Constants of `tuning`, compiled into the kernels.
MISFIT_CAP = F4(TUNING.trust.misfit_cap)
VARIANCE_FACTOR = F4(TUNING.trust.variance_factor)
STD_PER_DISTANCE = F4(TUNING.trust.std_per_distance)
ISLAND_ODDS = F4(TUNING.trust.island_odds)
UNKNOWN_ODDS = F4(TUNING.trust.unknown_odds)
HOPELESS_ODDS = F4(TUNING.trust.hopeless_odds)
LOWEST_ODDS, HIGHEST_ODDS = F4(TUNING.trust.odds_limits[0]), F4(TUNING.trust.odds_limits[1])
FULL_SIZE = TUNING.trust.full_size
UNLIT = F4(TUNING.trust.unlit)
IMBALANCE_OFFSET = F4(TUNING.trust.imbalance_offset)
VARIANCE_CAP = F4(TUNING.trust.variance_cap)
DISTANCE_CAP = F4(TUNING.trust.distance_cap)
IMBALANCE_CAP = F4(TUNING.trust.imbalance_cap)
UNMATCHED_SHARE = F4(TUNING.trust.unmatched_share)
HIDDEN_SLOPE = F4(TUNING.trust.hidden_slope)
LEAST_FOOTPRINT = F4(TUNING.trust.footprint_limits[0])
MOST_FOOTPRINT = F4(TUNING.trust.footprint_limits[1])


@serial(fastmath=FAST)
def brightness_balance(d, misfit, left_s, right_s, step, worst, balance, weight):
    """
    Compare the brightness of every step-th node with that of its place in the right image.

    balance, float32 (h, w), takes (left - right) / (left + right), weight 1 where the misfit is
    below `worst` and 0 elsewhere; balance is 0 there.

    """
    width = right_s.shape[1]
    for row in range(balance.shape[0]):
        y = PAD + row * step + step // 2
        for column in range(balance.shape[1]):
            x = column * step + step // 2
            place = F4(2 * x) - d[y, x + PAD]
            known = (misfit[y, x + PAD] < worst) & (place >= F4(0)) & (place < F4(width - 1))
            at = np.int32(place if known else F4(0))
            found = imbalance(left_s[y, x + PAD], right_s[y, at])
            balance[row, column] = found if known else F4(0)
            weight[row, column] = F4(1) if known else F4(0)


@part(fastmath=FAST)
def imbalance(left, right):
    """Return the difference of two brightnesses (DN) over their sum, steadied near black."""
    return (left - right) / (left + right + F4(2) * IMBALANCE_OFFSET)


@banded(fastmath=FAST)
def weigh_evidence(k, d, a, b, cost, misfit, variance, left_s, right_s, usual_balance, rows,
                   columns, form, evidence, log_odds):
    """
    Log-odds that a node is right within 1 px, from how well its plane fits.

    evidence, float32 (5, rows, columns), see EVIDENCE: square roots of the cost of the best
    shifted window, of the mean misfit of the 3 x 3 nodes, of the standard deviation (px), of the
    mean distance of the four neighbors from the plane (px), and of how far the `imbalance` of left
    and right brightness is from `usual_balance`, float32 (rows, columns), that of the
    surroundings; roots, since logarithms are not vectorized. With x = (1, evidence), log_odds,
    framed, is x . form x; form is float32 (6, 6), upper triangular. UNKNOWN_ODDS where d or its
    variance is unknown.

    """
    ninth, quarter = F4(1.0 / 9.0), F4(0.25)
    last_place = F4(right_s.shape[1] - 1)
    first, last = band(k, rows)
    e0, e1, e2, e3 = stack_row(), stack_row(), stack_row(), stack_row()
    e4, sums = stack_row(), stack_row()
    for row in range(first, last):
        y = row + PAD
        bright = right_s[y]
        for start in range(0, columns, TILE_COLUMNS):
            left, count = start + PAD, min(TILE_COLUMNS, columns - start)
            right = left + count
            above, below = d[y - 1, left:right], d[y + 1, left:right]
            here = d[y, left - 1:right + 1]
            lean_x, lean_y = a[y, left:right], b[y, left:right]
            chi0 = misfit[y - 1, left - 1:right + 1]
            chi1 = misfit[y, left - 1:right + 1]
            chi2 = misfit[y + 1, left - 1:right + 1]
            fit, spread = cost[y, left:right], variance[y, left:right]
            own_s, usual = left_s[y, left:right], usual_balance[row, start:start + count]
            for x in range(count):
                total = F4(0)
                for i in range(3):
                    total += capped(chi0[x + i]) + capped(chi1[x + i]) + capped(chi2[x + i])
                center = here[x + 1]
                apart = (apartness(here[x + 2] - center - lean_x[x])
                         + apartness(here[x] - center + lean_x[x])
                         + apartness(below[x] - center - lean_y[x])
                         + apartness(above[x] - center + lean_y[x]))
                place = F4(2 * (start + x)) - center
                place = place if (place >= F4(0)) & (place < last_place) else F4(0)
                at = np.int32(place)
                low, high = bright[np.uint32(at)], bright[np.uint32(at + 1)]
                other = low + (high - low) * (place - F4(at))
                e0[x] = math.sqrt(capped(fit[x]))
                e1[x] = math.sqrt(total * ninth)
                e2[x] = math.sqrt(math.sqrt(min(spread[x], VARIANCE_CAP)))
                e3[x] = math.sqrt(quarter * apart)
                e4[x] = math.sqrt(min(abs(imbalance(own_s[x], other) - usual[x]),
                                      IMBALANCE_CAP))
                known = (center == center) & (spread[x] < F4(np.inf))
                odds = quadratic(form, e0[x], e1[x], e2[x], e3[x], e4[x])
                sums[x] = odds if known else UNKNOWN_ODDS
            for x in range(count):
                evidence[0, row, start + x] = e0[x]
                evidence[1, row, start + x] = e1[x]
                evidence[2, row, start + x] = e2[x]
                evidence[3, row, start + x] = e3[x]
                evidence[4, row, start + x] = e4[x]
                log_odds[y, left + x] = sums[x]


@part(fastmath=FAST)
def quadratic(m, a, b, c, d, e):
    """Return x . m x of x = (1, a, b, c, d, e) and an upper triangular m."""
    return (m[0, 0]
            + a * (m[0, 1] + m[1, 1] * a + m[1, 2] * b + m[1, 3] * c + m[1, 4] * d + m[1, 5] * e)
            + b * (m[0, 2] + m[2, 2] * b + m[2, 3] * c + m[2, 4] * d + m[2, 5] * e)
            + c * (m[0, 3] + m[3, 3] * c + m[3, 4] * d + m[3, 5] * e)
            + d * (m[0, 4] + m[4, 4] * d + m[4, 5] * e)
            + e * (m[0, 5] + m[5, 5] * e))


@part(fastmath=FAST)
def capped(misfit):
    """Return a misfit, at most MISFIT_CAP; NaN counts as that."""
    return misfit if misfit < MISFIT_CAP else MISFIT_CAP


@part(fastmath=FAST)
def apartness(difference):
    """Return the magnitude of a difference, at most DISTANCE_CAP; NaN counts as that."""
    size = abs(difference)
    return size if size < DISTANCE_CAP else DISTANCE_CAP


@part()
def root_of(parent, node):
    """Return the representative of a node's segment, and shorten the path to it."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@serial()
def distrust_islands(d, a, b, log_odds, s, full_brightness, rows, columns, joined_distance,
                     least_size, run_of, first, parent, size):
    """
    Distrust small segments: log_odds becomes ISLAND_ODDS where too few nodes are joined.

    Fewer than least_size are too few. Two neighbors are joined if both have positive log_odds and
    one lies within joined_distance (px) of the plane of the other. A node whose brightness s is
    below full_brightness (DN) counts less in proportion: dark nodes match by chance, so more of
    them must agree. Segments are found by runs: joined nodes of one row. run_of, first, parent
    and size are int32 scratch (rows * columns).

    """
    ends = np.empty(BANDS, I4)
    join_nodes(d, a, b, log_odds, s, full_brightness, rows, columns, joined_distance, run_of,
               first, parent, size, ends)
    for k in range(1, BANDS):
        join_bands(d, b, log_odds, band(k, rows)[0], columns, joined_distance, run_of, parent)
    for k in range(BANDS):
        for run in range(band(k, rows)[0] * columns, ends[k]):
            root = root_of(parent, run)
            if root != run:
                size[root] += size[run]
    for k in range(BANDS):
        for run in range(band(k, rows)[0] * columns, ends[k]):
            if size[root_of(parent, run)] < FULL_SIZE * least_size:
                node = first[run]
                while node < rows * columns and run_of[node] == run:
                    log_odds[node // columns + PAD, node % columns + PAD] = ISLAND_ODDS
                    node += 1


@banded(fastmath=FAST)
def join_nodes(k, d, a, b, log_odds, s, full_brightness, rows, columns, joined_distance, run_of,
               first, parent, size, ends):
    """
    Join the nodes of each band to runs and the runs to segments; see `distrust_islands`.

    The runs of a band are counted from its first node on, ends is where that ends. size is in
    parts of a bright node, FULL_SIZE of which make one.

    """
    first_row, last_row = band(k, rows)
    runs = first_row * columns
    # 1 trusted, + 2 joined to the left, + 4 to the upper node, + 8 times the size
    links = stack_row()
    full, one = F4(FULL_SIZE), F4(1)
    parts = full / full_brightness
    for row in range(first_row, last_row):
        y = row + PAD
        last_run, last_above = -1, -1
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            left, right = start + PAD, start + PAD + count
            here, before, above = d[y, left:right], d[y, left - 1:right - 1], d[y - 1, left:right]
            lean, lean_before = a[y, left:right], a[y, left - 1:right - 1]
            fall, fall_above = b[y, left:right], b[y - 1, left:right]
            own, odds_before = log_odds[y, left:right], log_odds[y, left - 1:right - 1]
            odds_above, light = log_odds[y - 1, left:right], s[y, left:right]
            for x in range(count):
                trusted = own[x] > 0
                step_x, step_y = here[x] - before[x], here[x] - above[x]
                with_left = trusted & (odds_before[x] > 0) & (
                    (abs(step_x - lean_before[x]) < joined_distance)
                    | (abs(step_x - lean[x]) < joined_distance))
                with_upper = trusted & (odds_above[x] > 0) & (
                    (abs(step_y - fall_above[x]) < joined_distance)
                    | (abs(step_y - fall[x]) < joined_distance))
                weight = F4(I4(max(min(parts * light[x], full), one)))
                links[x] = ((F4(1) + F4(8) * weight if trusted else F4(0))
                            + (F4(2) if with_left else F4(0)) + (F4(4) if with_upper else F4(0)))
            for x in range(count):
                node = row * columns + start + x
                link = np.int32(links[x])
                if link == 0:
                    run_of[node] = -1
                    continue
                if link & 2:
                    run = run_of[node - 1]
                    size[run] += link >> 3
                else:
                    run = runs
                    first[run] = node
                    parent[run] = run
                    size[run] = link >> 3
                    runs += 1
                run_of[node] = run
                if link & 4 and row > first_row:
                    upper = run_of[node - columns]
                    if upper != last_above or run != last_run:
                        last_run, last_above = run, upper
                        parent[root_of(parent, run)] = root_of(parent, upper)
    ends[k] = runs


@part()
def join_bands(d, b, log_odds, row, columns, joined_distance, run_of, parent):
    """Join the runs of a row to those of the row above, which belongs to another band."""
    y = row + PAD
    if row == 0 or row * columns >= run_of.size:
        return
    for x in range(columns):
        here, above = x + PAD, row * columns + x - columns
        change = d[y, here] - d[y - 1, here]
        if log_odds[y, here] > 0 and log_odds[y - 1, here] > 0 and (
                abs(change - b[y - 1, here]) < joined_distance
                or abs(change - b[y, here]) < joined_distance):
            parent[root_of(parent, run_of[above + columns])] = root_of(parent, run_of[above])


@part()
def whole_below(value):
    """Return the largest whole number up to a value, float32: math.floor is a call."""
    whole = F4(np.int32(value))
    return whole - F4(1) if whole > value else whole


@banded()
def find_hidden(k, d, a, log_odds, rows, columns, width, hidden_distance, hidden, owners,
                odds_row):
    """
    Mark nodes whose place in the right image belongs to a more trusted surface.

    Every node covers the right columns that its footprint reaches; per column the most trusted
    node is kept. A node is hidden where that node's surface, continued along its own plane,
    does not pass through it. owners, int32, and odds_row, float32, are scratch (BANDS, width).

    """
    first, last = band(k, rows)
    owner, most = owners[k], odds_row[k]
    flags, lows, highs = stack_row(), stack_row(), stack_row()
    for row in range(first, last):
        y = row + PAD
        dd, aa = d[y, PAD:PAD + columns], a[y, PAD:PAD + columns]
        own = log_odds[y, PAD:PAD + columns]
        marks = hidden[y, PAD:PAD + columns]
        owner[:] = -1
        most[:] = ISLAND_ODDS
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            places, leans = dd[start:start + count], aa[start:start + count]
            for i in range(count):
                center = F4(2 * (start + i)) - (places[i] if places[i] == places[i] else F4(0))
                reach = min(max(LEAST_FOOTPRINT, F4(1) - F4(0.5) * leans[i]), MOST_FOOTPRINT)
                lows[i] = -whole_below(reach - center)
                highs[i] = whole_below(center + reach)
            for i in range(count):
                x = start + i
                if own[x] > ISLAND_ODDS:
                    low = max(np.int32(lows[i]), np.int32(0))
                    high = min(np.int32(highs[i]), np.int32(width - 1))
                    for at in range(low, high + 1):
                        if own[x] > most[at]:
                            most[at] = own[x]
                            owner[at] = x
        for start in range(0, columns, TILE_COLUMNS):
            count = min(TILE_COLUMNS, columns - start)
            for i in range(count):
                x = start + i
                known = own[x] > ISLAND_ODDS
                place = whole_below(F4(2 * x) + F4(0.5) - (dd[x] if known else F4(0)))
                known = known & (place >= 0) & (place < width)
                rival = owner[np.uint32(place if known else 0)]
                known = known & (rival >= 0)
                at = np.uint32(rival if known else 0)
                away = F4(x) - F4(rival)
                apart = abs(dd[at] + aa[at] * away - dd[x])
                flags[i] = F4(1) if known & (
                    apart > hidden_distance + HIDDEN_SLOPE * abs(away)) else F4(0)
            for i in range(count):
                marks[start + i] = flags[i] > F4(0)


@banded(fastmath=FAST)
def settle(k, d, variance, evidence, cost, log_odds, hidden, peak, s, rows, columns, limits,
           saturation, min_signal, hidden_odds, vague_std, std, odds, reason):
    """
    Turn evidence into log-odds, standard deviation and the reason why there may be no range.

    limits (px): of the disparity. hidden_odds is added to the log-odds of hidden nodes. min_signal
    (DN): below this sum of the channels the reason is DARK. vague_std (px): above this standard
    deviation of a plane, the colors around a node are too uniform. The
    standard deviation grows with the distance of the neighbors from the plane: there the surface
    is no plane. odds is HOPELESS_ODDS where no range is possible at any min_confidence; its frame
    repeats the nearest nodes left and right. reason takes the codes of `Status`.

    """
    too_vague = vague_std * vague_std
    lowest, highest = limits[0], limits[1]
    first, last = band(k, rows)
    spreads, sums, codes = stack_row(), stack_row(), stack_row()
    for row in range(first, last):
        y = row + PAD
        for start in range(0, columns, LENGTH):
            count = min(LENGTH, columns - start)
            left, right = start + PAD, start + PAD + count
            dd, noise, fit = d[y, left:right], variance[y, left:right], cost[y, left:right]
            odds_row, behind = log_odds[y, left:right], hidden[y, left:right]
            peaks, light = peak[y, left:right], s[y, left:right]
            aparts = evidence[APART, row, start:start + count]
            for x in range(count):
                is_hidden = behind[x] != 0
                apart = STD_PER_DISTANCE * aparts[x] * aparts[x]
                spread = math.sqrt(VARIANCE_FACTOR * noise[x] + apart * apart)
                vaguer = noise[x] > too_vague
                bright = peaks[x] >= saturation
                outside = peaks[x] < F4(0)
                inside_limits = (dd[x] >= lowest) & (dd[x] <= highest)  # not if NaN
                # the first reason of the list wins, so it is assigned last
                code = NO_MATCH if fit[x] > UNMATCHED_SHARE * MISFIT_CAP else IMPLAUSIBLE
                code = AMBIGUOUS if spread > vague_std else code
                code = INCONSISTENT if is_hidden else code
                code = code if inside_limits else OUT_OF_RANGE
                code = AMBIGUOUS if vaguer else code
                code = code if dd[x] == dd[x] else NO_MATCH
                code = DARK if (light[x] < min_signal) & (not bright) else code
                code = SATURATED if bright else code
                code = OUTSIDE_IMAGE if outside else code
                hopeless = (outside | vaguer | (not inside_limits) | (odds_row[x] < -HIGHEST_ODDS)
                            | ((light[x] < UNLIT) & (not bright)))
                spreads[x] = spread
                sums[x] = HOPELESS_ODDS if hopeless else (
                    odds_row[x] + (hidden_odds if is_hidden else F4(0)))
                codes[x] = F4(code)
            for x in range(count):
                std[y, left + x] = spreads[x]
                odds[y, left + x] = sums[x]
                reason[y, left + x] = np.uint8(codes[x])
        odds[y, PAD - 1] = odds[y, PAD]
        odds[y, PAD + columns] = odds[y, PAD + columns - 1]


@banded(fastmath=FAST)
def rescale_std(k, std, apart, assumed, variance):
    """
    Change standard deviations, px, of `settle` from assumed variances of planes to true ones.

    std and variance are framed, apart, the evidence APART, and assumed are (rows, columns); all
    float32, variances in px^2. Where assumed is not a positive number the standard deviation
    stays.

    """
    rows, columns = apart.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y = row + PAD
        aparts, befores = apart[row], assumed[row]
        afters, out = variance[y, PAD:PAD + columns], std[y, PAD:PAD + columns]
        for x in range(columns):
            distance = STD_PER_DISTANCE * aparts[x] * aparts[x]
            other = distance * distance / VARIANCE_FACTOR
            before = befores[x]
            known = (before > F4(0)) & (before < F4(np.inf))
            ratio = (afters[x] + other) / (before + other)
            out[x] *= math.sqrt(ratio if known else F4(1))
