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
"""Steps: ranges beside steps of the disparity are doubted where a pair says little there."""

import cv2
import numpy as np

from .grid_kernels import F4, PAD
from .step_kernels import lower_beside_steps


class Steps:
    """
    Doubts ranges of the log-odds that wrong ranges beside steps have.

    A window that holds a step mixes two surfaces: its plane fits, and is off by a pixel or two.
    Blur, noise and compression widen what is mixed, and the log-odds of a single node do not show
    it. The pair as a whole does: its log-odds beside steps are low then.

    Parameters
    ----------
    grid : HalfGrid
    tuning : Tuning

    """

    def __init__(self, grid, tuning):
        """Keep the constants."""
        self.grid, self.tuning, self.step = grid, tuning.steps, tuning.quality.step

    def doubt(self, planes, verdict, rough, weak):
        """
        Lower verdict.log_odds beside steps, as far as the pair says little there.

        Parameters
        ----------
        planes : PlaneField
            The planes of the nodes so far.
        verdict : Verdict
            What is believed of each node.
        rough : numpy.ndarray, float32, shape (h, w)
            See `roughness`.
        weak : float
            See `weakness`.

        """
        if weak > 0:
            self.lower(planes, verdict, rough, weak * self.tuning.odds)

    def bound(self, verdict, nodes):
        """
        Let no node of some, bool (rows, columns), be surer than doubted ones may be.

        Those that have changed hands are judged by the misfit of the plane they had. With misfit
        and cost of the neighbor whose plane they took, and no bound, more of them are sure and
        wrong: of the ranges above a confidence of .9 in 18 stressed pairs .10 % more, at most
        .33 %; right ranges +.02 %.

        """
        odds = verdict.log_odds[self.grid.inner]
        np.minimum(odds, F4(self.tuning.kept_odds), out=odds, where=nodes)
        self.grid.repeat_columns(verdict.log_odds)

    def roughness(self, quality):
        """
        Return how far the surroundings of the samples of Quality are rough, float32 (h, w), 0..1.

        A steep plane has large differences, too, but no steps: its second differences are small.

        """
        return np.interp(quality.bend(), self.tuning.rough_bends, (0, 1)).astype(F4)

    def weakness(self, verdict, quality, rough):
        """Return how little a pair says beside its steps, 0 .. 1; 0 where it has few steps."""
        tuning, first = self.tuning, PAD + self.step // 2
        heights = quality.samples[3] * rough
        h, w = heights.shape
        odds = verdict.log_odds[first::self.step, first::self.step][:h, :w]
        lowest, _ = tuning.heights
        beside = odds[(odds > F4(tuning.least_odds)) & (heights > F4(lowest))
                      & (heights < F4(tuning.largest_height))]
        if beside.size < tuning.least_samples:
            return 0.0
        return float(np.interp(np.median(beside), tuning.usual_odds, (1, 0)))

    def lower(self, planes, verdict, rough, lost):
        """Lower verdict.log_odds beside steps by up to lost; rough: see `roughness`."""
        rows, columns = self.grid.nodes
        low, high = self.tuning.heights
        lower_beside_steps(
            planes.d, cv2.resize(rough, (columns, rows), interpolation=cv2.INTER_LINEAR), rows,
            columns, F4(low), F4(high), F4(lost), F4(self.tuning.kept_odds), verdict.log_odds)
