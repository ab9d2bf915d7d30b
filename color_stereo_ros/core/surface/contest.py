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
"""Contest: beside steps of the disparity, small windows tell which plane a node belongs to."""

import cv2
import numpy as np

from .contest_kernels import contest, OWN
from .grid_kernels import F4

NOWHERE = np.finfo(np.float16).min  # px, less than any disparity


class Contest:
    """
    Gives nodes beside steps the plane around them that fits their own surroundings best.

    Windows of the least squares hold two surfaces there, and so do the surroundings that
    brightness is compared with. Plain colors of 3 x 3 nodes do not.

    Parameters
    ----------
    grid : HalfGrid
    tuning : Tuning
    arena : Arena

    Attributes
    ----------
    winner : numpy.ndarray, uint8, shape (rows, columns)
        Whose plane each node has since the last contest, see `contest_kernels`.

    """

    def __init__(self, grid, tuning, arena):
        """Allocate what changes hands."""
        self.grid, self.tuning = grid, tuning.contest
        self.seed_variance = F4(tuning.brightness.disputed_std ** 2)
        self.nothing = arena.full(grid.shape, np.nan, F4)
        self.variance = arena.zeros(grid.shape, F4)
        self.winner = arena.zeros(grid.nodes, np.uint8)

    def hold(self, planes, images, balance, seed=None):
        """
        Hold the contest; write d, a, b and variance of planes, and `winner`.

        Parameters
        ----------
        planes : PlaneField
            The planes of the nodes so far.
        images : (numpy.ndarray, numpy.ndarray), uint8, shape (rows, columns or more, C)
            Left and right, one row per node; the left one has a column per node.
        balance : numpy.ndarray, float32, shape (rows, columns)
            Brightness left against right around each node, see `Trust.usual_balance`.
        seed : numpy.ndarray, float32, framed, optional
            Disparities of a search, px, NaN = none.

        """
        left, right = images
        channels, tuning = left.shape[2], self.tuning
        seed = self.nothing if seed is None else seed
        window = (2 * tuning.reach + 1) ** 2
        limit = F4(tuning.largest_gain)
        gain = np.clip((F4(1) + balance) / (F4(1) - balance), 1 / limit, limit)
        with planes.rewriting(keep_unwritten=True) as (old, new):
            contest(left, right, gain, self.wanted(old.d, seed), seed, self.seed_variance,
                    F4(tuning.cap * channels), F4(tuning.margin * channels * window), old.d,
                    old.a, old.b, planes.variance, new.d, new.a, new.b, self.variance,
                    self.winner)
        inner = self.grid.inner
        planes.variance[inner] = self.variance[inner]

    @property
    def changed(self):
        """Return the nodes that have changed hands in the last contest, bool."""
        return self.winner != OWN

    def wanted(self, d, seed):
        """Return the nodes beside steps, and those whose seed is another match; bool."""
        inner, size = self.grid.inner, (2 * self.tuning.step_reach + 1,) * 2
        d, seed, window = d[inner], seed[inner], np.ones(size, np.uint8)
        low, high = (cv2.dilate(np.nan_to_num(sign * d, nan=NOWHERE), window)
                     for sign in (F4(-1), F4(1)))
        steps = high + low > F4(self.tuning.step)
        return steps | (np.abs(seed - d) >= F4(1)) | (np.isnan(d) & np.isfinite(seed))
