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
"""Fit the variance of planes to how well they fit around (models/quality.yaml)."""

import numpy as np

from . import disturbed
from .nodes import method_with, pattern_tuning
from ...core.constants import replaced
from ...core.pipeline import KERNELS, Stopwatch
from ...core.surface.trust_kernels import APART, STD_PER_DISTANCE, VARIANCE_FACTOR

SCENES = QUICK_SCENES = 'casting', 'effector_bin', 'airplane', 'printed'
CASES = 'none', *disturbed.APERIODIC, *disturbed.DETAILED
GAINS = np.geomspace(0.5, 50, 41)
POWERS = np.linspace(0, 1, 21)
SPREAD = 68      # %: 1 is an honest |error| / standard deviation there
RIGHT = 1.0      # px


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under every disturbance of CASES."""
    return disturbed.lit_pairs(scenes, CASES, options)


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns `pull_gain` and `uneven_power`."""
    samples = [samples_of(pair) for pair in options.progress(pairs)]
    gain, power = fitted_factor(samples)
    return ({'pull_gain': round(gain, 2), 'uneven_power': round(power, 2)},
            [f'{pair.name}: |error| / std at {SPREAD} % {spread(each, gain, power):.2f}'
             for pair, each in zip(pairs, samples) if len(each)])


def samples_of(pair):
    """
    Return what is known of the right ranges of a pair, float64 (N, 5).

    Error (px), variance of the plane before it is corrected (px^2), standard deviation by the
    distance of the neighbors (px), mean root pull and mean second difference (px) around.

    """
    method = method_with(pair, replaced(pattern_tuning(pair), {'quality.pull_gain': 0.0}))
    with KERNELS:
        method.measure(pair.left, pair.right, Stopwatch())
    planes, trust, quality = method.planes, method.trust, method.quality
    pull, bend, share = quality.averages()
    step, grid = quality.tuning.step, trust.grid
    inner = grid.inner
    h, w = share.shape
    thinned = np.s_[step // 2::step, step // 2::step]

    def at(nodes):
        return nodes[thinned][:h, :w].astype(float)

    rows, columns = grid.nodes
    at_nodes = np.s_[:2 * rows:2, :2 * columns:2]
    lean = at(planes.a[inner]) + at(planes.b[inner])
    error = at(planes.d[inner]) - 0.25 * lean - at(pair.disparity[at_nodes])
    used = (at(pair.visible[at_nodes]) > 0) & (np.abs(error) <= RIGHT)
    used &= at(trust.verdict.log_odds[inner]) >= trust.least_odds
    used &= (share >= quality.tuning.least_share) & np.isfinite(at(planes.variance[inner]))
    apart = STD_PER_DISTANCE * at(trust.evidence[APART]) ** 2
    bend = np.maximum(bend, quality.tuning.even)
    return np.stack([error, at(planes.variance[inner]), apart, pull, bend], axis=-1)[used]


def deviation(samples, gain, power):
    """Return the standard deviations, px, of `samples_of` under a factor of the variance."""
    _, variance, apart, pull, bend = samples.T
    return np.sqrt(VARIANCE_FACTOR * variance * gain * bend ** power * pull ** 2 + apart ** 2)


def fitted_factor(samples):
    """Return gain and power under which the spreads are nearest to 1, by ratio; pairs alike."""
    parts = [part for each in samples for part in halves(each) if len(part)]
    found = [(sum(np.log(spread(part, gain, power)) ** 2 for part in parts), gain, power)
             for gain in GAINS for power in POWERS]
    _, gain, power = min(found)
    return float(gain), float(power)


def halves(samples):
    """Return the samples of a pair where it is more even than usual, and where it is less so."""
    even = samples[:, 4] <= np.median(samples[:, 4]) if len(samples) else np.zeros(0, bool)
    return samples[even], samples[~even]


def spread(samples, gain, power):
    """Return |error| / standard deviation at SPREAD %."""
    return float(np.percentile(np.abs(samples[:, 0]) / deviation(samples, gain, power), SPREAD))
