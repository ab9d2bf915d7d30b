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
"""Fit the log-odds that a node is right, from its evidence (models/trust.yaml)."""

import numpy as np

from .nodes import gathered, pattern_tuning
from .pairs import simulated
from .regression import equal_shares, logistic_fit
from ...core.constants import replaced

ROUNDS = 3      # the trust decides who hides whom, and that is evidence again
FIRM = 1e-3     # per variance of a product: the form stays tame where no scene has been
HOLD = 2e-6     # of all weights: keeps the equations solvable
CONFIDENCES = 0.5, 0.6, 0.7, 0.8, 0.9


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under the default pattern."""
    return [simulated(name, cache=options.cache, seed=options.seed, quick=options.quick)
            for name in options.progress(scenes)]


def fit(pairs, options):
    """
    Fit to pairs.

    Parameters
    ----------
    pairs : list of Pair
        With truth.
    options : Options
        Of the fit.

    Returns
    -------
    fitted : dict
        `form` and `hidden_odds`.
    report : list of str
        What the fit achieves on these pairs.

    """
    weights = None
    for _ in range(1 if options.quick else ROUNDS):
        nodes = [gathered(pair, tuning_with(pair, weights)) for pair in options.progress(pairs)]
        weights = fitted_weights(nodes)
    return ({'form': np.round(quadratic_form(weights[:-1]), 3).tolist(),
             'hidden_odds': round(float(weights[-1]), 3)},
            [operating_point(nodes, weights, confidence) for confidence in CONFIDENCES])


def tuning_with(pair, weights):
    """Return the tuning for a pair, with the model of these weights if there are any."""
    tuning = pattern_tuning(pair)
    if weights is None:
        return tuning
    form = tuple(map(tuple, quadratic_form(weights[:-1]).tolist()))
    return replaced(tuning, {'trust.form': form, 'trust.hidden_odds': float(weights[-1])})


def inputs_of(nodes):
    """Return all products of one and the evidence, and hidden, float64 (N, 22)."""
    return np.concatenate([products(nodes.evidence), nodes.hidden[:, None]], axis=1)


def products(evidence):
    """Return all products of two of one and the evidence (N, K), (N, (K + 1) (K + 2) / 2)."""
    inputs = np.concatenate([np.ones((len(evidence), 1)), evidence], axis=1)
    return np.stack([inputs[:, i] * inputs[:, j]
                     for i, j in zip(*np.triu_indices(inputs.shape[1]))], axis=1)


def quadratic_form(weights):
    """Return the upper triangular matrix of the weights of `products`."""
    size = int((2 * len(weights)) ** 0.5)
    form = np.zeros((size, size))
    form[np.triu_indices(size)] = weights
    return form


def fitted_weights(pairs):
    """
    Return the weights, float64 (22,), of a logistic regression; each pair counts alike.

    Parameters
    ----------
    pairs : list of Nodes
        Products of two pieces of evidence are held towards zero, see FIRM.

    """
    inputs = np.concatenate([inputs_of(nodes) for nodes in pairs])
    right = np.concatenate([nodes.right for nodes in pairs])
    share = equal_shares([len(nodes.right) for nodes in pairs])
    first, second = np.triu_indices(pairs[0].evidence.shape[1] + 1)
    joint = np.append((first > 0) & (second > 0), False)
    return logistic_fit(inputs, right, share, HOLD + FIRM * joint * inputs.var(axis=0))


def operating_point(pairs, weights, confidence):
    """Return in one line density and shares of wrong and false ranges at a min_confidence."""
    least = np.log(confidence / (1 - confidence))
    points = []
    for nodes in pairs:
        kept = inputs_of(nodes) @ weights > least
        answered = np.count_nonzero(kept & ~nodes.alone)
        points.append((answered / max(nodes.visible_count, 1),
                       1 - np.count_nonzero(kept & nodes.right) / max(answered, 1),
                       np.count_nonzero(kept & nodes.alone) / max(np.count_nonzero(kept), 1)))
    return ('min_confidence {:.1f}: density {:.4f}, wrong by more than 1 px {:.4f}, '
            'ranges where only the left camera sees {:.4f}'.format(
                confidence, *np.mean(points, axis=0)))
