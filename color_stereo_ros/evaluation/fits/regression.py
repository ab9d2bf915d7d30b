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
"""Logistic regression, as all fits of log-odds need it."""

import numpy as np

STEPS = 30           # of Newton's method: it converges in about ten
LARGEST_ODDS = 50.0  # beyond, exp overflows and probabilities are 0 and 1


def equal_shares(counts):
    """Return the weight of every sample, float64, so that each pair counts alike; sum 1."""
    counts = list(counts)
    used = sum(count > 0 for count in counts)
    return np.concatenate([np.full(count, 1 / max(count, 1) / max(used, 1)) for count in counts])


def logistic_fit(inputs, right, share, hold, offset=0.0):
    """
    Return the weights of a logistic regression, float64 (K,).

    Parameters
    ----------
    inputs : numpy.ndarray, float64, shape (N, K)
        What the probability depends on.
    right : numpy.ndarray, bool, shape (N,)
        Whether the sample is right.
    share : numpy.ndarray, float64, shape (N,)
        Weight of every sample.
    hold : float or numpy.ndarray, shape (K,)
        How firmly each weight is held towards 0 (ridge).
    offset : float or numpy.ndarray, shape (N,)
        Log-odds that are known already.

    """
    weights = np.zeros(inputs.shape[1])
    hold = np.broadcast_to(hold, weights.shape)
    for _ in range(STEPS):  # Newton's method
        odds = np.clip(inputs @ weights + offset, -LARGEST_ODDS, LARGEST_ODDS)
        probability = 1 / (1 + np.exp(-odds))
        gradient = inputs.T @ (share * (probability - right)) + hold * weights
        spread = share * probability * (1 - probability)
        curvature = inputs.T @ (inputs * spread[:, None]) + np.diag(hold)
        weights = weights - np.linalg.solve(curvature, gradient)
    return weights
