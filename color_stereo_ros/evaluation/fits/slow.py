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
"""Fit what log-odds lose under patterns whose colors change slowly (models/slow.yaml)."""

import numpy as np

from .nodes import gathered, pattern_tuning
from .pairs import simulated
from .regression import equal_shares, logistic_fit
from ...core import PatternSettings
from ...core.constants import replaced
from ...core.surface.tuning import TUNING

PATTERNS = 'sine', 'sweep'
HOLD = 1e-9     # keeps the equations solvable
TAME = TUNING.trust.odds_limits[1]  # log-odds beyond which a node counts as certain


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under one sine and under one sweep."""
    return [simulated(name, PatternSettings(type=kind), options.cache, options.seed,
                      options.quick)
            for name in options.progress(scenes) for kind in PATTERNS]


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns `odds_offset`."""
    nodes = [gathered(pair, replaced(pattern_tuning(pair), {'trust.odds_offset': 0.0}))
             for pair in options.progress(pairs)]
    offset = fitted_offset(nodes)
    confidence, share = calibration(nodes, offset)
    return ({'odds_offset': round(offset, 3)},
            [f'with this offset: mean confidence {confidence:.3f}, share right {share:.3f}'])


def fitted_offset(pairs):
    """Return what is to be added to the log-odds of all nodes; each pair counts alike."""
    odds = np.concatenate([nodes.log_odds for nodes in pairs])
    right = np.concatenate([nodes.right for nodes in pairs])
    share = equal_shares([len(nodes.right) for nodes in pairs])
    doubtful = np.abs(odds) < TAME
    return float(logistic_fit(np.ones((np.count_nonzero(doubtful), 1)), right[doubtful],
                              share[doubtful], HOLD, odds[doubtful])[0])


def calibration(pairs, offset):
    """Return mean confidence and share right of the doubtful nodes."""
    odds = np.concatenate([nodes.log_odds for nodes in pairs])
    right = np.concatenate([nodes.right for nodes in pairs])
    share = equal_shares([len(nodes.right) for nodes in pairs])
    doubtful = np.abs(odds) < TAME
    weights = share[doubtful] / share[doubtful].sum()
    return (float(weights @ (1 / (1 + np.exp(-odds[doubtful] - offset)))),
            float(weights @ right[doubtful]))
