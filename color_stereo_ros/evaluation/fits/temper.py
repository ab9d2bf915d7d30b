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
"""Fit the log-odds of surfaces that no aperiodic colors tell apart (models/temper.yaml)."""

import numpy as np

from . import disturbed
from .nodes import method_with, pattern_tuning
from .regression import equal_shares, logistic_fit
from ...core.pipeline import KERNELS, Stopwatch

SCENES = QUICK_SCENES = ('casting', 'effector_bin', 'airplane', 'effector_nut', 'printed',
                         'tilt_30')
CASES = disturbed.DETAILED + disturbed.SLOW
LEAST = 0.0   # log-odds: lower ones stay as they are
HOLD = 1e-6   # keeps the equations solvable
RIGHT = 1.0   # px
SURE = np.log(9)  # a confidence of .9


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under every pattern of CASES."""
    return disturbed.lit_pairs(scenes, CASES, options)


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns the constants of `Trust.temper`."""
    samples = [samples_of(pair) for pair in options.progress(pairs)]
    weights = fitted_weights(samples)
    odds, factor, rough = (round(float(weight), 2) for weight in weights * (1, 1, -1))
    return ({'tempered_odds': odds, 'tempered_factor': factor, 'rough_odds': rough},
            [f'{pair.name}: wrong of the sure nodes {wrong_of_sure(each, (0, 1, 0)):.2%} -> '
             f'{wrong_of_sure(each, weights):.2%}' for pair, each in zip(pairs, samples)])


def samples_of(pair):
    """
    Return (inputs, right) of the nodes of a pair, float64 (N, 3) and bool (N,).

    The inputs are 1, the log-odds before they are tempered, and the logarithm of the second
    difference around. A pair that is not tempered has no nodes.

    """
    method = method_with(pair, pattern_tuning(pair))
    trust, planes, found = method.trust, method.planes, []
    inner = trust.grid.inner

    def temper(uneven):
        found[:] = trust.log_odds[inner].copy(), uneven

    trust.temper = temper  # of this object: the log-odds stay as they are
    with KERNELS:
        method.measure(pair.left, pair.right, Stopwatch())
    if not found:
        return np.empty((0, 3)), np.empty(0, bool)
    odds, uneven = found
    rows, columns = trust.grid.nodes
    at_nodes = np.s_[:2 * rows:2, :2 * columns:2]
    d, a, b = (plane[inner] for plane in (planes.d, planes.a, planes.b))
    error = d - 0.25 * (a + b) - pair.disparity[at_nodes]
    used = (pair.visible | pair.alone)[at_nodes] & (odds > LEAST)
    right = (np.abs(error) <= RIGHT) & pair.visible[at_nodes]
    inputs = np.stack([np.ones_like(odds), odds, uneven], axis=-1)
    return inputs[used].astype(float), right[used]


def fitted_weights(samples):
    """Return the weights of a logistic regression on `samples_of`; each pair counts alike."""
    inputs = np.concatenate([each for each, _ in samples])
    right = np.concatenate([each for _, each in samples])
    if not len(right):
        return np.array([0.0, 1.0, 0.0])
    return logistic_fit(inputs, right, equal_shares([len(each) for _, each in samples]), HOLD)


def wrong_of_sure(samples, weights):
    """Return the share of wrong nodes among those above a confidence of .9; 0 without any."""
    inputs, right = samples
    sure = inputs @ np.asarray(weights, float) > SURE
    return float(np.mean(~right[sure])) if sure.any() else 0.0
