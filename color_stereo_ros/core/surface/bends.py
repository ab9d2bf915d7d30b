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
"""Bends: planes of surfaces that bend within a window are put in the right place."""

import numpy as np

from .bend_kernels import find_bent_tiles, unbend, write_pulls
from .grid_kernels import F4
from .plane_kernels import RADIUS


class Bends:
    """
    Corrects planes where the surface bends within the window of the fit.

    Parameters
    ----------
    grid : HalfGrid
    tuning : BendTuning
    arena : Arena

    """

    def __init__(self, grid, tuning, arena):
        """Allocate what nodes ask for."""
        self.tuning = tuning
        self.pull = arena.zeros(grid.shape, F4)

    def correct(self, linearized, views, planes, pair, solver, linearize):
        """
        Put the planes of bent tiles in the right place.

        Writes planes.d, a, b, variance and misfit in these tiles only.

        Parameters
        ----------
        linearized : Linearized
            At planes near those that are to be corrected.
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            What the two views of the pair differ by.
        solver : LeastSquares
            Of the fit of planes.
        linearize : callable
            Compares tiles in all carriers, see `SurfaceMethod.linearize`.

        """
        if not self.tuning.rounds:
            return
        tiles, noise = self.bent_tiles(planes)
        if len(tiles):
            self.unbend(linearized, views, planes, pair, solver, tiles, noise, linearize)

    def unbend(self, linearized, views, planes, pair, solver, tiles, noise, linearize):
        """
        Put the planes of some tiles in the right place.

        Parameters
        ----------
        linearized, views, planes, pair, solver, linearize
            As for `correct`.
        tiles, noise
            As of `bent_tiles`.

        """
        tuning, gate, ridge = self.tuning, solver.gates[-1], solver.ridge
        for _ in range(tuning.rounds):
            smooth = planes.smooth(tiles, views, RADIUS, solver.smooth_steps[-1])
            write_pulls(linearized.weight, linearized.moment, planes.d, solver.reference,
                        self.pull)
            with planes.rewriting(keep_unwritten=True) as (old, new):
                unbend(linearized.weight, self.pull, old.d, old.a, old.b, tiles, noise, smooth,
                       gate, pair.noise_weight, ridge, solver.steepest, F4(tuning.doubt), new.d,
                       new.a, new.b, planes.variance)
        linearize(views, planes, pair, tiles)

    def bent_tiles(self, planes):
        """Return the tiles that bend, int32 (N, 2), and the factor of their noise, float32."""
        tuning, tiles = self.tuning, planes.tiles
        bent, noise = np.empty(len(tiles), bool), np.empty(len(tiles), F4)
        find_bent_tiles(planes.d, planes.variance, planes.misfit, tiles, F4(tuning.least_bend),
                        F4(tuning.noise_ratio), F4(tuning.usual_misfit), F4(tuning.misfit_gain),
                        F4(tuning.least_share), bent, noise)
        return tiles[bent], noise[bent]
