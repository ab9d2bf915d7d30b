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
"""Fit the log-odds that a node has the right period of the pattern (models/period.yaml)."""

import numpy as np

from .nodes import gathered, pattern_tuning
from .pairs import simulated
from .regression import equal_shares, logistic_fit
from ...core import PatternSettings
from ...core.constants import replaced
from ...core.surface.tuning import TUNING

SCENES = ('effector_bench', 'nut', 'solids', 'printed', 'thin', 'casting', 'prism', 'bin',
          'corner')
CYCLES = 16
SHARES = 0.0, 0.1, 0.3, 0.5, 0.7, 0.85, 1.0
RIGHT_PERIOD = 0.25  # of a period: errors below are no wrong period
HOLD = 1e-5          # towards log-odds of 0 where no node has been
CERTAIN = TUNING.trust.odds_limits[1]  # the largest log-odds of a node


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under 16 sines."""
    return [simulated(name, PatternSettings(type='sine', cycles=CYCLES), options.cache,
                      options.seed, options.quick) for name in options.progress(scenes)]


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns `shares` and `odds`."""
    samples = [samples_of(pair, gathered(pair, without_doubt(pair)))
               for pair in options.progress(pairs)]
    odds = fitted_odds(samples)
    return ({'shares': list(SHARES), 'odds': np.round(odds, 2).tolist()},
            [f'pairs: {len(samples)}, nodes: {sum(len(share) for share, _ in samples)}'])


def without_doubt(pair):
    """Return the tuning for a pair that trusts every period."""
    tuning = pattern_tuning(pair)
    certain = (CERTAIN,) * len(tuning.repetition.odds)
    return replaced(tuning, {f'repetition.{name}': certain
                             for name in ('odds', 'agreed_odds', 'contested_odds')})


def samples_of(pair, nodes):
    """Return the share of clear nodes around each range, and whether it has the right period."""
    period = pair.calibration.geometry.width / pair.settings.pattern.cycles
    used = nodes.visible & (nodes.log_odds >= nodes.least_odds)
    return nodes.clear_share[used], np.abs(nodes.error[used]) < RIGHT_PERIOD * period


def fitted_odds(samples):
    """
    Return the log-odds at SHARES, between which they are linear; each pair counts alike.

    Parameters
    ----------
    samples : list of (clear_share, right)
        Of pairs whose truth is known.

    """
    clear, right = (np.concatenate(part) for part in zip(*samples))
    share = equal_shares([len(each[0]) for each in samples])
    hats = np.stack([np.interp(clear, SHARES, row) for row in np.eye(len(SHARES))], axis=1)
    return np.clip(logistic_fit(hats, right, share, HOLD), -CERTAIN, CERTAIN)
