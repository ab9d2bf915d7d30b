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
"""Compiled loops that compare each match with those of neighboring windows."""

import math

import numpy as np

from .tuning import TUNING
from ..compiled import parallel, prange, serial
from ..status_codes import NO_MATCH, VALID

# Constants of `tuning`, compiled into the kernels.
TOLERANCE = TUNING.support.tolerance
SLOPE = TUNING.support.slope
SHARE_UNIT = TUNING.support.share_unit
LEAST_EVIDENCE = TUNING.support.least_evidence
LEAST_PROBABILITY = TUNING.support.least_probability
PRECISION = TUNING.support.precision
OFFSET, BY_DEVIATION, BY_SUPPORT = TUNING.support.odds

# Directions to neighboring windows, and the steps to the two neighbors of a triple.
DIRECTIONS = ((1, 0), (0, 1), (1, 1), (1, -1))
PLACES = ((-1, 1), (1, 2), (-1, -2))


@serial(error_model='python')
def _candidates(right, first, low, high, before, counts):
    """Write how many usable right pixels each left pixel of one row is compared with."""
    width = counts.shape[0]
    before[0] = 0
    for x in range(width):
        before[x + 1] = before[x] + (1 if right[x, 3] > 0 else 0)
    for x in range(width):
        start = min(max(x - first - high[x] + 1, 0), width)
        stop = min(max(x - first - low[x] + 1, 0), width)
        counts[x] = max(before[stop] - before[start], 1)


@serial(error_model='python')
def _compare(own, near, far, middle, reach, chance, agreeing, known, expected):
    """
    Compare one row of disparities with two neighbors each, add what is found.

    The three lie on a line. They agree if the surface is straight: the one in the middle is the
    mean of the others. near, far (W,): neighbors; middle: whether `own` lies between them.

    """
    tolerance = np.float32(TOLERANCE)
    for x in range(own.shape[0]):
        outer = near[x] + far[x] - own[x] - own[x]
        line = near[x] + near[x] - far[x] - own[x]
        misfit = outer if middle else line
        is_known = misfit == misfit
        agrees = (abs(misfit) <= tolerance) & (abs(near[x] - own[x]) <= reach)
        known[x] += np.int32(1) if is_known else np.int32(0)
        agreeing[x] += np.int32(1) if agrees else np.int32(0)
        expected[x] += chance[x] if is_known else np.int32(0)


@serial(error_model='python')
def _chances(counts, reach, chance):
    """Write the probability that three matches by chance agree, in SHARE_UNIT; (W,)."""
    one = np.float32(1.0)
    for x in range(counts.shape[0]):
        near = min(one, np.float32(2.0) * reach / counts[x])
        straight = min(one, np.float32(2.0 * TOLERANCE) / counts[x])
        chance[x] = np.int32(math.ceil(near * straight * np.float32(SHARE_UNIT)))


@parallel(error_model='python')
def count_agreements(disparity, right, first, low, high, step_x, step_y, agreeing, known,
                     expected):
    """
    Count the pairs of neighboring windows whose disparities agree with that of each pixel.

    Reads disparity (H, W), NaN = unknown, right colors (H, W, 4), the limits of the search and
    the distance of windows that have no pixel in common; writes agreeing, known (both are known)
    and expected (of them, by chance, in SHARE_UNIT), int32 (H, W). All are 0 for unknown pixels.

    """
    height, width = disparity.shape
    for y in prange(height):
        before = np.empty(width + 1, np.int32)
        counts = np.empty(width, np.float32)
        chance = np.empty(width, np.int32)
        agreeing[y] = 0
        known[y] = 0
        expected[y] = 0
        _candidates(right[y], first, low[y], high[y], before, counts)
        for i, j in DIRECTIONS:
            length = math.sqrt(np.float32((i * step_x) ** 2 + (j * step_y) ** 2))
            reach = np.float32(SLOPE) * np.float32(length) + np.float32(TOLERANCE)
            _chances(counts, reach, chance)
            for one, two in PLACES:
                rows = y + one * j * step_y, y + two * j * step_y
                near, far = one * i * step_x, two * i * step_x
                start = max(0, -near, -far)
                stop = min(width, width - near, width - far)
                if min(rows) >= 0 and max(rows) < height and start < stop:
                    _compare(disparity[y, start:stop],
                             disparity[rows[0], start + near:stop + near],
                             disparity[rows[1], start + far:stop + far], one == -two, reach,
                             chance[start:stop], agreeing[y, start:stop], known[y, start:stop],
                             expected[y, start:stop])


@serial(error_model='python')
def _evidence(share, chance, enough):
    """
    Return the evidence of one trial against chance (Chernoff bound, -log of probability).

    Where a lower bound (Pinsker's inequality) is enough, it is returned: it needs no logarithm.

    """
    if share <= chance:
        return np.float32(0.0)
    bound = np.float32(2.0) * (share - chance) * (share - chance)
    if bound >= enough:
        return bound
    evidence = share * math.log(share / chance)
    if share < 1:
        evidence += (1 - share) * math.log((1 - share) / (1 - chance))
    return np.float32(evidence)


def _support_odds():
    """Return the log-odds of agreement for all counts, float32 (pairs + 1, pairs + 1)."""
    pairs = len(DIRECTIONS) * len(PLACES)
    agreeing, known = np.indices((pairs + 1, pairs + 1), np.float32)
    return np.log((agreeing + 0.5) / (np.maximum(known - agreeing, 0) + 0.5)).astype(np.float32)


SUPPORT_ODDS = _support_odds()


@serial(error_model='python')
def _confidence(deviation, agreeing, known):
    """Return the probability that a match is right within 1 px: the more support, the more."""
    one = np.float32(1.0)
    precision = math.log(deviation + np.float32(PRECISION))
    support = SUPPORT_ODDS[agreeing, known]
    odds = (np.float32(OFFSET) + np.float32(BY_DEVIATION) * precision
            + np.float32(BY_SUPPORT) * support)
    return one / (one + math.exp(-np.float32(odds)))


@parallel(error_model='python')
def judge(agreeing, known, agreeing_around, known_around, expected_around, places,
          disparity, deviation, confidence, status):
    """
    Refuse matches in surroundings that agree no better than chance, rate the others.

    Reads the counts of each pixel and their sums over its surroundings, int32 (H, W), and
    places, the number of pixels from one independent window to the next; changes disparity,
    deviation and status, writes confidence, (H, W).

    """
    height, width = status.shape
    places = np.float32(places)
    for y in prange(height):
        for x in range(width):
            confidence[y, x] = 0.0
            if status[y, x] == VALID:
                whole = np.float32(known_around[y, x])
                share = np.float32(agreeing_around[y, x]) / max(whole, np.float32(1.0))
                chance = np.float32(expected_around[y, x]) / max(
                    whole * np.float32(SHARE_UNIT), np.float32(1.0))
                chance = min(max(chance, np.float32(LEAST_PROBABILITY)),
                             np.float32(1.0) - np.float32(LEAST_PROBABILITY))
                enough = np.float32(LEAST_EVIDENCE) * places / max(whole, np.float32(1.0))
                if whole == 0 or _evidence(share, chance, enough) < enough:
                    status[y, x] = NO_MATCH
                    disparity[y, x] = np.nan
                    deviation[y, x] = np.nan
                else:
                    confidence[y, x] = _confidence(
                        deviation[y, x], agreeing[y, x], known[y, x])
