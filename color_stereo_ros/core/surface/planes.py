# SPDX-License-Identifier: Apache-2.0
"""The planes of all nodes: seeded by the coarse search, fitted by least squares."""

from dataclasses import dataclass

import numpy as np

from .coarse_kernels import seed_planes
from .grid_kernels import F4, PAD
from .plane_kernels import find_smooth_tiles, fit_planes, linearize, RADIUS, WIDE_RADIUS


class PlaneField:
    """
    A plane d + a i + b j at every node, and what is known of it; all arrays framed float32.

    Iterating yields d (disparity, px), a and b (slopes, px per node): the arguments of kernels.
    They are written into other arrays than they are read from. `rewritten` owns that rule.

    Attributes
    ----------
    variance : numpy.ndarray
        Of d, px^2, for noise of unit misfit; inf = no information.
    misfit : numpy.ndarray
        Of single nodes, see `plane_kernels.linearize`; NaN = unknown.
    cost : numpy.ndarray
        Misfit of the best shifted window, see `neighbors`; 1 where planes were not compared.

    """

    def __init__(self, grid, seed_variance, compared, arena):
        """
        Allocate planes, all unknown.

        seed_variance (px^2): of d before any fit. compared: nodes will be linearized; where they
        are not, seeds count as fitting.

        """
        self.grid = grid
        self.seed_variance = F4(seed_variance)
        self.tiles = grid.tiles
        self._planes = [arena.full(grid.shape, value, F4) for value in (np.nan, 0, 0)]
        self._spare = [arena.empty(grid.shape, F4) for _ in self._planes]
        self._copy()
        self.variance, self.cost = (arena.zeros(grid.shape, F4) for _ in range(2))
        self.misfit = arena.full(grid.shape, np.nan if compared else 1.0, F4)

    def __iter__(self):
        """Yield d, a, b."""
        return iter(self._planes)

    @property
    def d(self):
        """Return the disparities of the nodes, px, NaN = unknown."""
        return self._planes[0]

    def seed(self, seeds):
        """
        Give every node the plane of its coarse node.

        Parameters
        ----------
        seeds : Seeds

        Returns
        -------
        planes : PlaneField
            This one.

        """
        # tiles reach beyond the nodes; there the last fit has left planes of the last pair
        rows, columns = (PAD + count for count in self.grid.nodes)
        for plane, nothing in zip(self._planes, (np.nan, 0, 0)):
            plane[rows:] = nothing
            plane[:, columns:] = nothing
        # right coarse nodes are averages of columns that lie half a pixel further right
        seed_planes(seeds.disparity, seeds.factor, F4(-0.5), *self.grid.nodes, *self._planes)
        self.cost.fill(1.0)
        self.variance.fill(self.seed_variance)
        return self

    def rewritten(self, tiles, passes=1, whole=True):
        """
        Yield the planes to read and those to write, once a pass; the new ones then hold.

        Parameters
        ----------
        tiles : numpy.ndarray, int32, shape (N, 2)
            Only these are written. All others keep their planes: they are copied first.
        passes : int
        whole : bool
            Every entry of these tiles is written.

        """
        if len(tiles) < len(self.tiles) or not whole:
            self._copy()
        for _ in range(passes):
            yield self._planes, self._spare
            self._planes, self._spare = self._spare, self._planes

    def _copy(self):
        for plane, spare in zip(self._planes, self._spare):
            np.copyto(spare, plane)

    def smooth(self, tiles, views, halo, step):
        """
        Return which tiles, with so many nodes around, one surface fills, bool (N,).

        step: px from the plane of a node SPAN away that are no step.

        """
        smooth = np.empty(len(tiles), bool)
        find_smooth_tiles(*self, views.left.variance, tiles, halo, step, smooth)
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
        self.tuning = tuning
        self.linearized = Linearized(*(arena.zeros(grid.shape, F4) for _ in range(2)))
        self.reference = F4(np.mean(limits))
        self.robust_misfit, self.steepest = F4(tuning.robust_misfit), F4(tuning.steepest)
        self.ridge = F4(tuning.ridge if settings.slanted else tuning.rigid_ridge)
        self.gates = np.array(tuning.gates, F4)
        self.steady = np.array(tuning.steadiness, F4)
        self.correlation = F4(tuning.noise_correlation if settings.refinements else 1)

    def linearize(self, views, planes, pair, tiles):
        """
        Compare the nodes of some tiles with the places that their disparities point to.

        Writes the misfit of these planes.

        Returns
        -------
        linearized : Linearized

        """
        left, right = views.left, views.right
        linearize(left.u, left.v, left.variance, right.u, right.v, right.variance, views.psf,
                  pair.matrix, *planes, tiles, self.robust_misfit, pair.scale, self.reference,
                  self.linearized.weight, self.linearized.moment, planes.misfit)
        return self.linearized

    def fit(self, linearized, views, planes, pair, tiles, turn):
        """
        Fit planes to the linearized nodes of some tiles.

        turn counts the rounds, from 0.

        Returns
        -------
        rough : numpy.ndarray, int32, shape (N, 2)
            The tiles that got no wide windows.

        """
        at = min(turn, len(self.gates) - 1)
        step = self.steady[at]
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
        Fit those tiles once more, in wide windows, that only this round has shown to be smooth.

        A single noisy node of the round before keeps a tile and its surroundings from it.

        """
        smooth = tiles[planes.smooth(tiles, views, WIDE_RADIUS, self.steady[-1])]
        if smooth.size:
            reach = np.full(len(smooth), WIDE_RADIUS, np.int8)  # no window with a gate
            self.solve(linearized, planes, pair, smooth, reach, self.gates[-1], 1)

    def solve(self, linearized, planes, pair, tiles, reach, gate, stride):
        """
        Replace the planes of some tiles, see `plane_kernels.fit_planes`.

        stride: of the window rows near depth edges.

        """
        for old, new in planes.rewritten(tiles):
            fit_planes(linearized.weight, linearized.moment, *old, tiles, reach, gate, stride,
                       pair.noise_weight, self.ridge, self.steepest, self.reference, *new,
                       planes.variance)

    def correct(self, planes):
        """Give the variance of planes its true size where neighbors share their noise."""
        if self.correlation != 1:
            planes.variance *= self.correlation
