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
"""Fit the standard deviation of a node to its error (models/spread.yaml)."""

import numpy as np

from .nodes import gathered, pattern_tuning
from .pairs import simulated
from .regression import equal_shares
from ...core.constants import ROBUST_STD
from ...core.surface.trust_kernels import APART

STEPS = 50       # of the scoring method: it converges in about ten
LEAST = 1e-8     # px^2, of a variance
OUTLIER = 3.0    # standard deviations
INSIDE = 0.9733  # variance of normal noise that is cut there


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under the default pattern."""
    return [simulated(name, cache=options.cache, seed=options.seed, quick=options.quick)
            for name in options.progress(scenes)]


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns `variance_factor` and `std_per_distance`."""
    samples = [samples_of(gathered(pair, pattern_tuning(pair)))
               for pair in options.progress(pairs)]
    factor, slope = fitted_spread(samples)
    scores = [robust_std(np.abs(error) / np.sqrt(factor * variance + (slope * apart) ** 2))
              for error, variance, apart in samples if len(error)]
    return ({'variance_factor': round(factor, 3), 'std_per_distance': round(slope, 3)},
            [f'robust standard deviation of error / std: {np.mean(scores):.2f} (1 is honest)'])


def samples_of(nodes):
    """Return error, variance (px^2) and distance of the neighbors (px) of right ranges."""
    used = nodes.right & (nodes.log_odds >= nodes.least_odds) & np.isfinite(nodes.variance)
    return (nodes.error[used], np.maximum(nodes.variance[used], LEAST),
            nodes.evidence[used, APART] ** 2)


def fitted_spread(samples):
    """
    Return variance_factor and std_per_distance; each pair counts alike.

    The fit is by maximum likelihood of normal errors. Their variance, variance_factor v +
    std_per_distance^2 x^2, is linear in variance_factor and std_per_distance^2. Every step of the
    scoring method is therefore a weighted least-squares fit of the squared errors. Errors beyond
    OUTLIER standard deviations do not count: they are no noise but wrong planes.

    Parameters
    ----------
    samples : list of (error, variance, distance) or (error, variance, distance, known)
        Known: variance from elsewhere, px^2.

    """
    error, variance, apart, *known = (np.concatenate(part) for part in zip(*samples))
    known = known[0] if known else np.zeros(len(error))
    share = equal_shares([len(each[0]) for each in samples])
    terms = np.stack([variance, apart ** 2], axis=1)
    found = np.ones(2)
    for _ in range(STEPS):
        model = np.maximum(terms @ found + known, LEAST)
        score = np.abs(error) / np.sqrt(model)
        noise = score <= OUTLIER * robust_std(score)
        weighted = terms * (share * noise / model ** 2)[:, None]
        found = np.linalg.solve(terms.T @ weighted, weighted.T @ (error ** 2 / INSIDE - known))
        found = np.maximum(found, LEAST)
    return float(found[0]), float(np.sqrt(found[1]))


def robust_std(scores):
    """Return the standard deviation of normal noise that has this median magnitude."""
    return max(ROBUST_STD * float(np.median(scores)), LEAST)
