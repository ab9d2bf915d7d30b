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
"""Kernels of the fusion: what tells how far planes of the third view can be trusted."""

import math

from .tuning import TUNING
from ..grid_kernels import F4, FAST, PAD
from ..pixel_kernels import logistic
from ..trust_kernels import HOPELESS_ODDS
from ...compiled import band, banded, LENGTH, part, serial, stack_array, stack_row
from ...status_codes import IMPLAUSIBLE, VALID

# Constants of `tuning`, compiled into the kernels.
MISFIT_CAP = F4(TUNING.use.misfit_cap)
VARIANCE_CAP = F4(TUNING.use.variance_cap)
DISTANCE_CAP = F4(TUNING.use.distance_cap)
LOWEST, HIGHEST = (F4(limit) for limit in TUNING.use.odds_limits)
AGREEMENT = F4(TUNING.use.agreement)
KEPT_ODDS = F4(TUNING.use.kept_odds)
SURE_ODDS = F4(TUNING.use.sure_odds)
INFINITE = F4(math.inf)
MOST_EVIDENCE = 8
stack_evidence = stack_array(F4, MOST_EVIDENCE, LENGTH)
NOTHING, AGREE, FIRM, APART = range(4)  # kinds of nodes, see `fusion.Inputs`
RIGHT_CAMERA, PROJECTOR = 1, 2  # bits of `RangeResult.views`


@part(fastmath=FAST)
def bounded_distance(away):
    """Return a distance of two planes within -DISTANCE_CAP .. DISTANCE_CAP; unknown: the cap."""
    return max(min(away, DISTANCE_CAP), -DISTANCE_CAP) if away == away else DISTANCE_CAP


@part()
def any_is(values, value):
    """Return whether any entry is a value."""
    found = False
    for x in range(values.size):
        found |= values[x] == value
    return found


@part()
def any_above_0(values):
    """Return whether any entry, uint8, is not 0."""
    found = False
    for x in range(values.size):
        found |= values[x] > 0
    return found


@banded(fastmath=FAST)
def spread_planes(k, distance, variance, geometry, share, factor, per_distance, std):
    """
    Write standard deviations of planes of the third view, see `fusion.Fusion.std`.

    distance, float32 (rows, columns), is the square root of that of the neighbors; geometry,
    float32 (rows, columns), of which a share counts. variance and std are framed.

    """
    rows, columns = distance.shape
    first, last = band(k, rows)
    for row in range(first, last):
        away, far = distance[row], geometry[row]
        noise = variance[row + PAD, PAD:PAD + columns]
        out = std[row + PAD, PAD:PAD + columns]
        for x in range(columns):
            rough = per_distance * (away[x] * away[x])
            out[x] = math.sqrt(factor * noise[x] + rough * rough + share * far[x])


@banded(fastmath=FAST)
def gather_evidence(k, d, a, b, cost, variance, misfit, treated, own, steps):
    """
    Write what tells how far planes of the third view can be trusted, at treated nodes.

    own, float32 (4, rows, columns): square roots of the cost of the best shifted window, of the
    mean misfit of 3 x 3 nodes, each capped, of the standard deviation (px), and of the mean
    distance of the four neighbors from the plane (px). steps, float32 (2, rows, columns), at all
    nodes: square roots of how far, px, the nearest and the farthest of the neighbors lie before
    and behind the plane. All planes and misfits are framed.

    """
    rows, columns = treated.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y = row + PAD
        for column in range(columns):
            x = column + PAD
            here, along, down = d[y, x], a[y, x], b[y, x]
            right = bounded_distance(d[y, x + 1] - here - along)
            left = bounded_distance(d[y, x - 1] - here + along)
            below = bounded_distance(d[y + 1, x] - here - down)
            above = bounded_distance(d[y - 1, x] - here + down)
            nearer = max(max(right, left), max(below, above))
            farther = min(min(right, left), min(below, above))
            steps[0, row, column] = math.sqrt(max(nearer, F4(0)))
            steps[1, row, column] = math.sqrt(max(-farther, F4(0)))
            if treated[row, column]:
                mean = F4(0.25) * (abs(right) + abs(left) + abs(below) + abs(above))
                own[0, row, column] = math.sqrt(min(cost[y, x], MISFIT_CAP))
                total = F4(0)
                for j in range(y - 1, y + 2):
                    for i in range(x - 1, x + 2):
                        total += misfit[j, i] if misfit[j, i] < MISFIT_CAP else MISFIT_CAP
                own[1, row, column] = math.sqrt(F4(1 / 9) * total)
                own[2, row, column] = math.sqrt(math.sqrt(min(variance[y, x], VARIANCE_CAP)))
                own[3, row, column] = math.sqrt(mean)


@banded(fastmath=FAST)
def weigh_forms(k, evidence, kind, forms, out):
    """
    Write x . forms[n - 1] x of x = (1, evidence) at the nodes of kind n; others stay.

    evidence float32 (K, rows, columns), K at most MOST_EVIDENCE; kind uint8 (rows, columns), 0 =
    none; forms float32 (N, K + 1, K + 1), upper triangular; out float32 (rows, columns).

    """
    count, rows, columns = evidence.shape
    first, last = band(k, rows)
    total, inner, told = stack_row(), stack_row(), stack_evidence()
    for row in range(first, last):
        for start in range(0, columns, LENGTH):
            size = min(LENGTH, columns - start)
            kinds, result = kind[row, start:start + size], out[row, start:start + size]
            if not any_above_0(kinds):
                continue
            for i in range(count):
                each = evidence[i, row, start:start + size]
                for x in range(size):
                    told[i, x] = each[x]
            for which in range(forms.shape[0]):
                if not any_is(kinds, which + 1):
                    continue
                # loops of a constant length: entries beyond the size are not used
                for x in range(LENGTH):
                    total[x] = forms[which, 0, 0]
                for i in range(count):
                    constant = forms[which, 0, i + 1]
                    for x in range(LENGTH):
                        inner[x] = constant
                    for j in range(i, count):
                        factor = forms[which, i + 1, j + 1]
                        for x in range(LENGTH):
                            inner[x] += factor * told[j, x]
                    for x in range(LENGTH):
                        total[x] += told[i, x] * inner[x]
                for x in range(size):
                    if kinds[x] == which + 1:
                        result[x] = total[x]


@banded()
def find_treated(k, region, d, variance, treated):
    """
    Write which nodes of a region have a plane and a variance.

    treated, bool (rows, columns); all others are framed: region bool, d and variance float32.

    """
    rows, columns = treated.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y, out = row + PAD, treated[row]
        inside, here = region[y, PAD:PAD + columns], d[y, PAD:PAD + columns]
        spread = variance[y, PAD:PAD + columns]
        for x in range(columns):
            out[x] = inside[x] & (abs(here[x]) < INFINITE) & (abs(spread[x]) < INFINITE)


@banded(fastmath=FAST)
def bound_odds(k, treated, odds):
    """Keep log-odds, float32 (rows, columns), within their limits; lowest where not treated."""
    rows, columns = odds.shape
    first, last = band(k, rows)
    for row in range(first, last):
        there, out = treated[row], odds[row]
        for x in range(columns):
            value = min(max(out[x], LOWEST), HIGHEST)
            out[x] = value if there[x] else LOWEST


@serial(fastmath=FAST)
def expected_wrong(odds, step):
    """Return which share of the nodes of positive log-odds is wrong, from every step-th node."""
    rows, columns = odds.shape
    count, wrong = F4(0), F4(0)
    for row in range(0, rows, step):
        for column in range(0, columns, step):
            told = odds[row, column]
            if told > F4(0):
                count += F4(1)
                wrong += logistic(-told)
    return wrong / max(count, F4(1))


@banded()
def spread_views(k, views, status, out):
    """
    Write who saw every pixel, uint8 (H, W), from who saw its node; 0 where there is no range.

    views, uint8, is framed; status, uint8 (H, W). Pixels after the last whole node take the
    nearest one.

    """
    height, width = status.shape
    rows, columns = height // 2, width // 2
    first, last = band(k, height)
    for v in range(first, last):
        y = PAD + min(v // 2, rows - 1)
        nodes, codes, told = views[y, PAD:PAD + columns], status[v], out[v]
        for x in range(columns):
            told[2 * x] = nodes[x] if codes[2 * x] == VALID else 0
            told[2 * x + 1] = nodes[x] if codes[2 * x + 1] == VALID else 0
        if width > 2 * columns:
            told[width - 1] = nodes[columns - 1] if codes[width - 1] == VALID else 0


@banded(fastmath=FAST)
def sort_nodes(k, two_d, third_d, odds, witness, firm, treated, dim, evidence, kind, only_third,
               possible, own_odds, third_odds):
    """
    Write of which kind nodes are, and what two cameras and witness say of them.

    two_d, third_d, odds, witness float32 and firm bool are framed, all others are not: treated
    bool; kind uint8, see `fusion.Inputs`; only_third uint8, 1 where the third view has a plane and
    does not agree; possible bool, the two cameras may have a range; evidence[0] takes the bounded
    log-odds of two cameras, evidence[2] the square root of the misfit of the witness, evidence[5]
    dim, float32 (rows, columns). own_odds and third_odds, float32 (rows, columns), take what holds
    where no form does: the log-odds of two cameras, and none.

    """
    rows, columns = treated.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y = row + PAD
        for column in range(columns):
            x = column + PAD
            two, told = odds[y, x], treated[row, column]
            evidence[0, row, column] = min(max(two, LOWEST), HIGHEST)
            misfit = witness[y, x]
            evidence[2, row, column] = math.sqrt(misfit if misfit < MISFIT_CAP else MISFIT_CAP)
            may = two > HOPELESS_ODDS / F4(2)
            which = APART if told | may else NOTHING
            which = AGREE if told & (abs(third_d[y, x] - two_d[y, x]) < AGREEMENT) else which
            which = FIRM if firm[y, x] else which
            kind[row, column] = which
            only_third[row, column] = 1 if told & (which == APART) else 0
            possible[row, column] = may
            evidence[5, row, column] = dim[row, column]
            own_odds[row, column], third_odds[row, column] = two, HOPELESS_ODDS


@banded(fastmath=FAST)
def decide(k, kind, possible, evidence, odds, third_odds, certainty, doubts, two_d, two_a, two_b,
           two_std, two_reason, third_d, third_a, third_b, third_std, d, a, b, std, log_odds,
           reason, views, beyond):
    """
    Write which plane nodes get, and how far it is trusted.

    kind and possible as `sort_nodes` writes them, evidence[0] too. odds, third_odds, float32
    (rows, columns): log-odds of the planes of two cameras and of the third view, HOPELESS_ODDS
    where there is none. certainty and doubts, float32 (4,), by kind: factor of what log-odds
    have above SURE_ODDS, and what log-odds lose. All others are framed, those after third_std
    are written: float32, reason and views uint8, beyond bool. Where both agree, a node keeps at
    least the log-odds that the two cameras give it. A node that the third view measures or
    confirms may lie beyond the right image: at its border one pixel of a node does.

    """
    rows, columns = kind.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y = row + PAD
        for column in range(columns):
            x, which = column + PAD, kind[row, column]
            # nothing of two cameras was there to be lost
            alone = (which == APART) & (not possible[row, column])
            two = HOPELESS_ODDS if alone else odds[row, column]
            third = third_odds[row, column]
            doubted = (which == AGREE) & (evidence[0, row, column] < KEPT_ODDS)
            takes = (third > two) | doubted
            agree = (which == AGREE) | (which == FIRM)
            best = max(two, third)
            sure = max(best - SURE_ODDS, F4(0))
            best += (certainty[which] - F4(1)) * sure
            best = max(best, evidence[0, row, column]) if which == AGREE else best
            log_odds[y, x] = best - (F4(0) if alone else doubts[which])
            d[y, x] = third_d[y, x] if takes else two_d[y, x]
            a[y, x] = third_a[y, x] if takes else two_a[y, x]
            b[y, x] = third_b[y, x] if takes else two_b[y, x]
            std[y, x] = third_std[y, x] if takes else two_std[y, x]
            reason[y, x] = IMPLAUSIBLE if takes else two_reason[y, x]
            views[y, x] = (0 if takes & (not agree) else RIGHT_CAMERA) | (
                PROJECTOR if takes | agree else 0)
            beyond[y, x] = takes | agree
        log_odds[y, PAD - 1] = log_odds[y, PAD]
        log_odds[y, PAD + columns] = log_odds[y, PAD + columns - 1]
