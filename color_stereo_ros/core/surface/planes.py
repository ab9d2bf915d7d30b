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
"""The planes of all nodes: seeded by the coarse search, fitted by least squares."""

from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .coarse_kernels import seed_planes
from .grid_kernels import F4, PAD
from .plane_kernels import find_smooth_tiles, fit_planes, linearize, RADIUS, WIDE_RADIUS


class Planes(NamedTuple):
    """A plane d + a i + b j at every node; framed float32 arrays."""

    d: np.ndarray
    """Disparity, px; NaN = unknown."""
    a: np.ndarray
    """Slope along the rows, px per node."""
    b: np.ndarray
    """Slope along the columns, px per node."""


class PlaneField:
    """
    A plane d + a i + b j at every node, and what is known of it; all arrays framed float32.

    Planes are written into other arrays than they are read from. `rewriting` owns that rule.

    Parameters
    ----------
    grid : HalfGrid
    seed_variance : float
        Variance of d before any fit, px^2.
    compared : bool
        Nodes will be linearized; where they are not, seeds count as fitting.
    arena : Arena

    Attributes
    ----------
    d : numpy.ndarray
        Disparities, px; NaN = unknown.
    a, b : numpy.ndarray
        Slopes along rows and along columns, px per node.
    variance : numpy.ndarray
        Of d, px^2, for noise of unit misfit; inf = no information.
    misfit : numpy.ndarray
        Of single nodes, see `plane_kernels.linearize`; NaN = unknown.
    cost : numpy.ndarray
        Misfit of the best shifted window, see `neighbors`; 1 where planes were not compared.

    """

    def __init__(self, grid, seed_variance, compared, arena):
        """Allocate planes, all unknown."""
        self.grid = grid
        self.seed_variance = F4(seed_variance)
        self.tiles = grid.tiles
        self._planes = Planes(*(arena.full(grid.shape, value, F4) for value in (np.nan, 0, 0)))
        self._spare = Planes(*(arena.empty(grid.shape, F4) for _ in self._planes))
        self._copy()
        self.variance, self.cost = (arena.zeros(grid.shape, F4) for _ in range(2))
        self.misfit = arena.full(grid.shape, np.nan if compared else 1.0, F4)

    @property
    def d(self):
        """Return the disparities of the nodes, px, NaN = unknown."""
        return self._planes.d

    @property
    def a(self):
        """Return the slopes along the rows, px per node."""
        return self._planes.a

    @property
    def b(self):
        """Return the slopes along the columns, px per node."""
        return self._planes.b

    def seed(self, seeds):
        """
        Give every node the plane of its coarse node.

        Writes d, a, b, variance and cost; misfit stays as the last pair left it.

        Parameters
        ----------
        seeds : Seeds
            The disparities of the coarse search.

        Returns
        -------
        planes : PlaneField
            This one.

        """
        self.clear_beyond()
        seed_planes(seeds.disparity, seeds.factor, F4(seeds.offset), *self.grid.nodes, self.d,
                    self.a, self.b)
        self.cost.fill(1.0)
        self.variance.fill(self.seed_variance)
        return self

    def clear_beyond(self):
        """Forget planes beyond the nodes: tiles reach there, and the last pair has left some."""
        rows, columns = (PAD + count for count in self.grid.nodes)
        for plane, nothing in zip(self._planes, (np.nan, 0, 0)):
            plane[rows:] = nothing
            plane[:, columns:] = nothing

    @contextmanager
    def rewriting(self, keep_unwritten):
        """
        Lend the planes to read and those to write in a `with` block.

        The new planes hold from the end of the block on; after an error the old ones do.

        Parameters
        ----------
        keep_unwritten : bool
            Copy all planes first, so that nodes that the block does not write keep theirs.

        Yields
        ------
        old, new : Planes

        """
        if keep_unwritten:
            self._copy()
        yield self._planes, self._spare
        self._planes, self._spare = self._spare, self._planes

    def _copy(self):
        for plane, spare in zip(self._planes, self._spare):
            np.copyto(spare, plane)

    def smooth(self, tiles, views, halo, step):
        """
        Return which tiles one surface fills.

        Parameters
        ----------
        tiles : numpy.ndarray, int32, shape (N, 2)
            Row and column of the tiles, in nodes.
        views : Views
            Both views as the method sees them.
        halo : int
            Nodes around a tile that the surface must fill, too.
        step : numpy.float32
            Distance from the plane of a node SPAN away from which there is a step, px.

        Returns
        -------
        smooth : numpy.ndarray, bool, shape (N,)

        """
        smooth = np.empty(len(tiles), bool)
        find_smooth_tiles(self.d, self.a, self.b, views.left.variance, tiles, halo, step, smooth)
        return smooth


@dataclass(frozen=True, eq=False)
class Linearized:
    """Nodes as terms of normal equations, see `plane_kernels.linearize`; framed float32."""

    weight: np.ndarray
    """What a node tells about its disparity, px^-2; 0 = nothing."""
    moment: np.ndarray
    """weight times the disparity that the node asks for, less a reference, px^-1."""


class LeastSquares:
    """
    Fits planes to the colors of the nodes around, linearized at the planes of the last round.

    Parameters
    ----------
    grid : HalfGrid
    limits : (float, float)
        Smallest and largest disparity, px.
    settings : MatchingSettings
    tuning : PlaneTuning
    arena : Arena

    """

    def __init__(self, grid, limits, settings, tuning, arena):
        """Allocate the linearized nodes."""
        self.linearized = Linearized(*(arena.zeros(grid.shape, F4) for _ in range(2)))
        self.reference = F4(np.mean(limits))
        self.settings = settings
        self.suit(tuning)

    def suit(self, tuning):
        """Fit by the constants of a PlaneTuning from here on."""
        self.tuning, settings = tuning, self.settings
        self.robust_misfit, self.steepest = F4(tuning.robust_misfit), F4(tuning.steepest)
        self.ridge = F4(tuning.ridge if settings.slanted else tuning.rigid_ridge)
        self.gates = np.array(tuning.gates, F4)
        self.smooth_steps = np.array(tuning.smooth_steps, F4)
        self.correlation = F4(tuning.noise_correlation if settings.refinements else 1)

    def linearize(self, views, planes, pair, tiles, lines=(0, 1)):
        """
        Compare the nodes of some tiles with the places that their disparities point to.

        Writes planes.misfit and the linearized nodes in these tiles only; all others keep theirs.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            What the two views of the pair differ by.
        tiles : numpy.ndarray, int32, shape (N, 2)
            Row and column of the tiles, in nodes.
        lines : (int, int)
            The first line of nodes of a tile that is compared, and their distance.

        Returns
        -------
        linearized : Linearized

        """
        left, right = views.left, views.right
        linearize(left.u, left.v, left.variance, right.u, right.v, right.variance, views.psf,
                  pair.matrix, planes.d, planes.a, planes.b, tiles, *lines, self.robust_misfit,
                  pair.scale, self.reference, self.linearized.weight, self.linearized.moment,
                  planes.misfit)
        return self.linearized

    def fit(self, linearized, views, planes, pair, tiles, turn):
        """
        Fit planes to the linearized nodes of some tiles.

        Writes planes.d, a, b and variance in these tiles only.

        Parameters
        ----------
        linearized : Linearized
            The slopes of the misfit at the planes.
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            What the two views of the pair differ by.
        tiles : numpy.ndarray, int32, shape (N, 2)
            Row and column of the tiles, in nodes.
        turn : int
            Number of the round, from 0.

        Returns
        -------
        narrow : numpy.ndarray, int32, shape (N, 2)
            The tiles that got no wide windows.

        """
        at = min(turn, len(self.gates) - 1)
        step = self.smooth_steps[at]
        reach = np.zeros(len(tiles), np.int8)
        smooth = np.flatnonzero(planes.smooth(tiles, views, RADIUS, step))
        reach[smooth] = RADIUS
        if turn > 0:  # planes of seeds are too rough to tell how far a surface goes
            wide = planes.smooth(tiles[smooth], views, WIDE_RADIUS, step)
            reach[smooth[wide]] = WIDE_RADIUS
        stride = self.tuning.row_stride if turn == 0 else 1
        self.solve(linearized, planes, pair, tiles, reach, self.gates[at], stride)
        return tiles[reach < WIDE_RADIUS]

    def polish(self, linearized, views, planes, pair, tiles):
        """
        Fit again, with wide windows, the tiles that became smooth in this round.

        Before the fit, a single noisy node makes a tile and its surroundings rough. Writes
        planes.d, a, b and variance. tiles, int32 (N, 2): those that `fit` returned.

        """
        smooth = tiles[planes.smooth(tiles, views, WIDE_RADIUS, self.smooth_steps[-1])]
        if smooth.size:
            reach = np.full(len(smooth), WIDE_RADIUS, np.int8)  # no window with a gate
            self.solve(linearized, planes, pair, smooth, reach, self.gates[-1], 1)

    def solve(self, linearized, planes, pair, tiles, reach, gate, stride):
        """
        Replace the planes of some tiles, see `plane_kernels.fit_planes`.

        stride: of the window rows near depth edges, nodes.

        """
        with planes.rewriting(keep_unwritten=len(tiles) < len(planes.tiles)) as (old, new):
            fit_planes(linearized.weight, linearized.moment, old.d, old.a, old.b, tiles, reach,
                       gate, stride, pair.noise_weight, self.ridge, self.steepest, self.reference,
                       new.d, new.a, new.b, planes.variance)

    def correct_variance(self, planes):
        """Multiply planes.variance by what it lacks where averaged colors share their noise."""
        if self.correlation != 1:
            planes.variance *= self.correlation
