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
"""What the surface method knows of its nodes beside the truth: the data of all fits."""

from dataclasses import dataclass

import numpy as np

from ...core.patterns.expectation import Expectation
from ...core.pipeline import KERNELS, Stopwatch
from ...core.surface.method import SurfaceMethod
from ...core.surface.trust_kernels import ISLAND_ODDS
from ...core.surface.tuning import tuning_for
from ...core.triangulation import disparity_limits

RIGHT = 1.0  # px: what confidence means


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of one pair that a surface, or its absence, can judge; arrays of N nodes."""

    evidence: np.ndarray
    """float64 (N, 5), see `trust_kernels.weigh_evidence`."""
    hidden: np.ndarray
    """bool (N,), a more trusted surface claims the place in the right image."""
    log_odds: np.ndarray
    """float64 (N,), final log-odds of being right."""
    variance: np.ndarray
    """float64 (N,), of the plane, px^2."""
    clear_share: np.ndarray
    """float64 (N,), share of the coarse nodes around without a rival; 1 without repetitions."""
    error: np.ndarray
    """float64 (N,), px, the disparity against the truth of the node's upper left pixel."""
    visible: np.ndarray
    """bool (N,), seen by both cameras and lit."""
    alone: np.ndarray
    """bool (N,), seen by the left camera only."""
    visible_count: int
    """Visible nodes of the pair, with a disparity or without."""
    least_odds: float
    """Log-odds from which a node has a range."""

    @property
    def right(self):
        """Return which nodes are right within 1 px, bool (N,)."""
        return self.visible & (np.abs(self.error) <= RIGHT)


def pattern_tuning(pair):
    """Return the tuning that ships for the pattern of a pair."""
    return tuning_for(Expectation.of(pair.settings.pattern), pair.calibration.geometry.width)


def method_with(pair, tuning):
    """Return the surface method for a pair under a tuning."""
    limits = disparity_limits(pair.calibration.geometry, pair.settings.range)
    return SurfaceMethod(pair.settings, pair.calibration, limits, tuning=tuning)


def gathered(pair, tuning):
    """
    Measure a pair and return what is known of its nodes.

    Parameters
    ----------
    pair : Pair
        Images with their truth.
    tuning : Tuning
        Constants of the method.

    Returns
    -------
    nodes : Nodes

    """
    method = method_with(pair, tuning)
    with KERNELS:
        method.measure(pair.left, pair.right, Stopwatch())
    planes, trust, grid = method.planes, method.trust, method.planes.grid
    lowest, highest = trust.limits
    area = grid.inner
    at_nodes = np.s_[:2 * grid.rows:2, :2 * grid.columns:2]
    d, a, b = (plane[area].astype(float) for plane in (planes.d, planes.a, planes.b))
    visible, alone = pair.visible[at_nodes], pair.alone[at_nodes]
    judged = ((visible | alone) & (trust.log_odds[area] > ISLAND_ODDS)
              & (method.views.left.s[area] > tuning.trust.unlit)
              & (d >= lowest) & (d <= highest))
    seeds = method.coarse.seeds
    share = (np.ones(grid.nodes) if seeds.clear_share is None
             else trust.at_all_nodes(seeds.clear_share))
    error = d - 0.25 * (a + b) - pair.disparity[at_nodes]
    return Nodes(trust.evidence[:, judged].T.astype(float), trust.hidden[area][judged],
                 trust.verdict.log_odds[area][judged].astype(float),
                 planes.variance[area][judged].astype(float), share[judged].astype(float),
                 error[judged], visible[judged], alone[judged],
                 int(np.count_nonzero(visible)), float(trust.least_odds))
