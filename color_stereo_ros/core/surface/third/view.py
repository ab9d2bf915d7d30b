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
"""The pattern as a view: measures where the right camera sees nothing, and bears witness."""

from dataclasses import dataclass
import math

import cv2
import numpy as np

from .colors import (
    explained, fitted_colors, Light, local_light, middle, resized, warm as warm_colors)
from .fitting import RegionSquares
from .fusion import Fusion
from .projected import Projected
from .region_kernels import find_known, find_region, reduce_firm, tiles_with
from .search import SweepSearch
from .sweep_kernels import (
    anchor_nodes, around_sparse, best_windows, count_nodes, linearize_sweep, list_nodes,
    places_of_nodes, put_nodes, seed_unknown, shorten_list, sparse_misfits, sweep_misfits,
    take_best)
from .tuning import TUNING
from ..grid_kernels import F4, SILENT_VARIANCE
from ..pair_model import PairModel
from ..planes import PlaneField
from ...compiled import Arena
from ...projector.model import COUNT, ProjectorModel

WARM = 8, 8  # size of a pattern that nobody sees, px
NEIGHBORS = np.array([(0, -1), (0, 1), (-1, 0), (1, 0)], np.int64)
HERE = np.zeros_like(NEIGHBORS[:1])


@dataclass(frozen=True, eq=False)
class Found:
    """What the third view makes of a pair; framed arrays of the nodes."""

    planes: PlaneField
    """Of the third view; tiles that need none keep those of the two cameras."""
    firm: np.ndarray
    """bool, the two cameras know the place and the third view agrees."""
    witness: np.ndarray
    """float32, mean misfit of the third view around a node at the place of the two cameras."""
    treated: np.ndarray
    """bool, planes hold a measurement of the third view."""
    geometry: np.ndarray
    """float32 (rows, columns), variance of the disparity by the projector's geometry, px^2."""
    dim: np.ndarray
    """float32 (rows, columns), log of how much brighter the known surroundings are, 0 .. 5."""
    projected: Projected


class NodeList:
    """
    Nodes that are compared with the pattern, and what does not change while their planes do.

    Parameters
    ----------
    grid : HalfGrid
    arena : Arena

    """

    def __init__(self, grid, arena):
        """Allocate as many entries as there are nodes."""
        most = grid.shape[0] * grid.shape[1]
        self.all_nodes = arena.zeros((most,), np.int32)
        self.all_told = arena.zeros((8 * most,), F4)
        self.take(0)

    def take(self, count):
        """Take room for so many nodes; contiguous also if there is none: kernels know one kind."""
        self.nodes = self.all_nodes[:count]
        self.told = self.all_told[:8 * count].reshape(8, count)

    def fill(self, region, left, light):
        """List the nodes of a region, bool framed, whose color says something; return self."""
        counts = np.empty(len(region), np.int64)
        count_nodes(region, left.variance, counts)
        starts = np.cumsum(counts) - counts
        self.take(int(starts[-1] + counts[-1]))
        list_nodes(region, starts, left.u, left.v, left.variance, light.local, light.unrest,
                   light.scale, self.nodes, self.told)
        return self

    def shorten(self, listed, wanted):
        """List those of a NodeList that are wanted, bool framed; return self."""
        self.take(shorten_list(listed.nodes, listed.told, wanted.reshape(-1), self.all_nodes,
                               self.all_told))
        return self


class ThirdView:
    """
    Measures with left camera and projector.

    Parameters
    ----------
    method : SurfaceMethod
        Whose grid, limits, coarse search and settings are shared.
    arena : Arena

    """

    def __init__(self, method, arena):
        """Allocate the planes."""
        self.views, self.geometry, self.limits = method.views, method.geometry, method.limits
        self.coarse, self.settings = method.coarse, method.settings
        grid = self.grid = method.views.grid
        self.arena = arena
        self.planes = PlaneField(grid, method.tuning.coarse.seed_variance, True, arena)
        self.seen = arena.zeros(grid.shape, F4)
        self.seen.fill(TUNING.use.misfit_cap)
        self.solver = RegionSquares(grid, method.limits, method.settings.matching,
                                    method.tuning.planes, arena)
        self.costs = arena.zeros((len(NEIGHBORS), *grid.shape), F4)
        self.local = np.ones((4, *grid.shape), F4)
        self.firm, self.region = (arena.zeros(grid.shape, bool) for _ in range(2))
        self.dimness = arena.zeros(grid.nodes, F4)
        self.listed, self.few = (NodeList(grid, arena) for _ in range(2))
        self.tried = arena.zeros((len(NEIGHBORS) * self.seen.size,), F4)
        self.sparse = arena.zeros(tuple(count // 2 + 1 for count in grid.nodes), F4)
        self.projected = self.prepared = self.search = self.found = self.last_light = None
        self.fusion = Fusion(grid)

    def adopt(self, model, prepared, pattern):
        """
        Measure with a projector from here on.

        Parameters
        ----------
        model : ProjectorModel
            Geometry of the projector.
        prepared : ProjectorModel
            Decides how the pattern is straightened and blurred; see `sweep.prepared_for`.
        pattern : callable
            Returns what the projector shows, uint8 (H, W, 3), linear light.

        """
        if self.projected is None or self.prepared is not prepared:
            self.prepare(prepared, pattern())
            self.prepared = prepared
        self.projected = self.projected.moved(model, self.geometry)

    def prepare(self, model, pattern):
        """Make what a model and a pattern say; see `adopt`."""
        known = self.views.left.psf_variance
        variance = float(np.nanmedian(known)) if np.isfinite(known).any() else 0.0
        step = 2 * self.coarse.factor
        self.projected = Projected(model, pattern, self.geometry, float(np.mean(self.limits)),
                                   variance, step)
        spacing = TUNING.search.spacing * step / max(self.projected.per_disparity,
                                                     TUNING.search.least_ratio)
        self.search = SweepSearch(self.coarse, self.limits, float(spacing), Arena())
        self.last_light = None

    def measure(self, planes, verdict, linearized, pair):
        """
        Measure the pair that the views hold.

        Parameters
        ----------
        planes : PlaneField
            Of the two cameras.
        verdict : Verdict
            Of the two cameras.
        linearized : Linearized
            Of the two cameras, at about these planes.
        pair : PairModel
            What the two views of the pair differ by.

        Returns
        -------
        found : Found or None
            None: the pattern does not explain what the left camera sees.

        """
        use, (rows, columns), firm, region = TUNING.use, self.grid.nodes, self.firm, self.region
        light = self.light(planes, verdict.log_odds[self.grid.inner])
        if light is None:
            return None
        witness = self.witness(planes, light)
        counts = np.empty((rows, 2), F4)
        find_known(verdict.log_odds, witness, columns, F4(use.firm_odds), F4(use.firm_misfit),
                   firm, counts)
        some, agreeing = counts.sum(axis=0)
        if agreeing < use.least_agreement * some:
            return None
        dim = self.dim(firm, region)
        self.fill(planes, firm, witness, light, linearized, pair, region)
        return Found(self.planes, firm, witness, region, self.geometry_variance(), dim,
                     self.projected)

    def witness(self, planes, light):
        """Return the mean misfit around the nodes at planes, from a quarter of them, float32."""
        left, projected = self.views.left, self.projected
        sparse_misfits(left.u, left.v, left.variance, light.local, light.unrest, light.scale,
                       light.pattern.image, projected.size, light.colors, projected.sweep,
                       planes.d, self.phase, F4(TUNING.use.misfit_cap), self.sparse)
        around_sparse(self.sparse, *self.grid.nodes, self.seen)
        return self.seen

    def misfits(self, planes, light, steps, listed):
        """
        Return the misfits of listed nodes under planes of nodes around, float32 (M, N).

        steps, int64 (M, 2), see `sweep_misfits`. The array holds until the next call.

        """
        projected, shape = self.projected, (len(steps), listed.nodes.size)
        misfits = self.tried[:shape[0] * shape[1]].reshape(shape)
        sweep_misfits(listed.nodes, listed.told, light.pattern.image, projected.size, light.colors,
                      projected.sweep, *(each.reshape(-1) for each in (planes.d, planes.a,
                                                                       planes.b)),
                      steps, self.grid.shape[1], self.phase, F4(TUNING.use.misfit_cap), misfits)
        return misfits

    def lit(self):
        """Return the nodes whose color says something, bool framed."""
        lit, nothing = np.zeros((2, *self.grid.shape), bool)
        nodes, left = self.grid.nodes, self.views.left
        find_region(np.ones(nodes, F4), left.s, left.variance, nothing,
                    F4(TUNING.use.shadow_dim), np.empty(nodes, F4), lit)  # none is dim
        return lit

    def fused(self, planes, verdict, linearized, pair):
        """Return the Fused of two cameras and the pattern, None where it explains nothing."""
        found = self.found = self.measure(planes, verdict, linearized, pair)
        return None if found is None else self.fusion.fuse(found, verdict, planes)

    def neutral_light(self):
        """Return the Light of a camera that sees the pattern on white surfaces."""
        shape = self.grid.shape
        self.coarse_light = np.ones((3, *self.coarse.disparity.shape), F4)
        return Light(self.projected.blurred(0), np.eye(3, 4, dtype=F4),
                     np.ones((3, *shape), F4), np.ones(shape, F4), F4(1))

    def warm(self, planes, verdict):
        """
        Run all kernels once, so that the first pair with a projector is not late.

        Parameters
        ----------
        planes : PlaneField
            Of the two cameras; not changed.
        verdict : Verdict
            What is believed of each node.

        """
        self.prepare(some_projector(self.geometry), np.zeros((*WARM, 3), np.uint8))
        nothing, light = np.zeros(self.grid.shape, bool), self.neutral_light()
        warm_colors(self.coarse.disparity.shape)
        places_of_nodes(self.projected.sweep, planes.d, self.coarse.factor,
                        np.empty((2, 1, 1), F4))
        witness = self.witness(planes, light)
        self.fill(planes, nothing, witness, light, self.solver.linearized,
                  PairModel.neutral(self.views), nothing)
        find_known(verdict.log_odds, witness, self.grid.columns, F4(0), F4(0), self.firm,
                   np.empty((self.grid.rows, 2), F4))
        self.fusion.fuse(Found(self.planes, nothing, witness, nothing,
                               self.geometry_variance(), self.dim(nothing, self.region),
                               self.projected), verdict, planes)
        self.projected = self.prepared = self.last_light = None

    def thin(self):
        """Return distance, number and slices of the nodes at which the light is measured."""
        step = TUNING.color.thin * self.coarse.factor
        h, w = (max(1, count // TUNING.color.thin) for count in self.coarse.disparity.shape)
        return step, (h, w), np.s_[:h * step:step, :w * step:step]

    def dim(self, firm, region):
        """
        Return the log of how much brighter firm nodes around are, float32 (rows, columns).

        Also writes the region, bool framed, see `region_kernels.find_region`.

        """
        use, left, inner = TUNING.use, self.views.left, self.grid.inner
        _, _, thin = self.thin()
        level = cv2.log(np.maximum(left.s[inner][thin], F4(1)))
        known = firm[inner][thin].astype(F4)
        size = (2 * use.dim_radius + 1,) * 2
        share = cv2.blur(known, size, borderType=cv2.BORDER_CONSTANT)
        level *= known
        wide = cv2.blur(level, size, borderType=cv2.BORDER_CONSTANT)
        overall = np.sum(level) / max(np.sum(known), 1)
        hold = F4(TUNING.color.least_share)
        usual = (wide + hold * F4(overall)) / (share + hold)
        find_region(cv2.resize(cv2.exp(-usual), self.grid.nodes[::-1]), left.s, left.variance,
                    firm, F4(use.shadow_dim), self.dimness, region)
        return self.dimness

    def geometry_variance(self):
        """Return the variance of disparities by the geometry, px^2, float32 (rows, columns)."""
        thin = 4 * self.coarse.factor
        d = self.planes.d[self.grid.inner][::thin, ::thin]
        known = d[np.isfinite(d)]
        typical = float(middle(known) if known.size else np.mean(self.limits))
        return self.projected.spread(self.geometry, typical, self.grid.nodes)

    def measure_alone(self, pair):
        """
        Measure the left view with the pattern, without the right camera.

        Parameters
        ----------
        pair : PairModel
            What the two views of the pair differ by.

        Returns
        -------
        fused : Fused

        """
        left, coarse, grid = self.views.left, self.coarse, self.grid
        coarse.fill_colors(left, self.views.right)
        light = self.neutral_light() if self.last_light is None else self.last_light
        lit, nothing = self.lit(), np.zeros(grid.shape, bool)
        for _ in range(TUNING.use.alone_rounds):
            self.fill(self.planes, nothing, self.seen, light, self.solver.linearized, pair, lit)
            odds = self.fusion.own_odds(self.planes, self.fusion.with_planes(self.planes, lit))
            better = self.light(self.planes, odds)
            light = light if better is None else better
        return self.fusion.alone(self.planes, odds, self.geometry_variance(), lit, left)

    def light(self, planes, odds):
        """
        Return the Light that known nodes show, None where there are too few.

        odds, float32 (rows, columns): log-odds of the planes.

        """
        tuning, inner, left = TUNING.color, self.grid.inner, self.views.left
        step, shape, thin = self.thin()
        place = np.empty((2, *shape), F4)
        places_of_nodes(self.projected.sweep, planes.d, step, place)
        u, v, variance = (np.ascontiguousarray(each[inner][thin])
                          for each in (left.u, left.v, left.variance))
        known = odds[thin] > F4(TUNING.use.firm_odds)
        used = known & self.projected.inside(*place) & (variance < SILENT_VARIANCE)
        count = np.count_nonzero(used)
        if count * tuning.thin ** 2 < tuning.least_samples:
            return None
        some = np.flatnonzero(used)[::-(-count // tuning.samples)]
        pattern, colors, share = self.sharpest(*(each.ravel()[some] for each in (
            u, v, variance, *place)))
        if share < TUNING.use.least_explained:
            return None
        sampled = self.projected.light_at(pattern, *place)
        local, error = local_light(u, v, sampled, colors, variance, used)
        errors = error[used][::max(1, count // tuning.scale_samples)]
        scale = F4(max(middle(errors, 0.25) / tuning.quartile, tuning.least_scale))
        size = (2 * tuning.unrest_radius + 1,) * 2
        share = cv2.blur(used.astype(F4), size)
        unrest = cv2.blur(np.minimum(error, F4(tuning.unrest_limit) * scale), size) / np.maximum(
            share, F4(tuning.least_share))
        unrest = np.where(share > F4(tuning.least_share), unrest / (2 * scale), 1)
        unrest = np.clip(unrest, 1, F4(tuning.unrest_limit)).astype(F4)
        self.coarse_light = np.stack([resized(each, self.coarse.disparity.shape[::-1])
                                      for each in local])
        for samples, out in zip((*local, unrest), self.local):
            cv2.resize(samples, self.grid.nodes[::-1], out[inner], interpolation=cv2.INTER_LINEAR)
        self.last_light = Light(pattern, colors, self.local[:3], self.local[3], scale)
        return self.last_light

    def sharpest(self, u, v, variance, column, row):
        """
        Return the pattern as blurred as the left view, the map of its colors, what it explains.

        Parameters
        ----------
        u, v, variance : numpy.ndarray, float32, shape (N,)
            Of the left view, at nodes of known places.
        column, row : numpy.ndarray, float32, shape (N,)
            Places of the pattern, px.

        """
        best = None
        for level in range(len(TUNING.color.blurs)):
            pattern = self.projected.blurred(level)
            seen = self.projected.light_at(pattern, column, row)
            colors = fitted_colors(u, v, seen, 1 / variance.astype(np.float64))
            share = explained(u, v, seen, colors)
            if best is not None and share <= best[2]:
                break
            best = pattern, colors, share
            if share > TUNING.color.sharp:
                break
        return best

    def linearize(self, listed, light):
        """Write the linearized nodes and the misfit of listed nodes at the planes; return them."""
        mine, projected, own = self.planes, self.projected, self.solver.linearized
        linearize_sweep(listed.nodes, listed.told, light.pattern.image, projected.size,
                        light.colors, projected.sweep, mine.d.reshape(-1),
                        F4(TUNING.use.robust_misfit), self.phase, self.solver.reference,
                        own.weight.reshape(-1), own.moment.reshape(-1), mine.misfit.reshape(-1))
        return own

    @property
    def phase(self):
        """Return the variance of a place as a variance of the disparity, px^2."""
        return F4(TUNING.use.phase_variance / self.projected.per_disparity ** 2)

    def tiles_with(self, nodes):
        """Return the tiles that hold some of the nodes, int32 (N, 2)."""
        tiles = self.grid.tiles
        some = np.empty(len(tiles), bool)
        tiles_with(nodes, tiles, some)
        return tiles[some]

    def fill(self, planes, firm, witness, light, linearized, pair, region):
        """Search and fit the nodes of a region without firm ones; firm nodes anchor them."""
        mine, solver, own = self.planes, self.solver, self.solver.linearized
        self.seed(planes, firm, light, region)
        anchor_nodes(firm, witness, planes.d, planes.a, planes.b, linearized.weight,
                     linearized.moment, F4(TUNING.use.misfit_cap), mine.d, mine.a, mine.b,
                     own.weight, own.moment, mine.misfit)
        listed, tiles = self.listed.fill(region, self.views.left, light), self.tiles_with(region)
        solver.region = region
        for turn, steps in enumerate(TUNING.use.steps):
            for step in steps:
                self.propagate(light, listed, region, step)
            solver.fit(self.linearize(listed, light), self.views, mine, pair, tiles, turn)
        # the misfit stays that before the last fit

    def seed(self, planes, firm, light, region):
        """Search the coarse nodes that two cameras do not know, and take their planes."""
        mine, coarse = self.planes, self.coarse
        shape, factor = coarse.disparity.shape, coarse.factor
        known, (wanted, whole) = np.empty(shape, F4), np.empty((2, *shape), bool)
        reduce_firm(firm, region, planes.d, factor, least_firm(factor), known, wanted, whole)
        seeds = self.search.search(
            light.pattern, self.projected.size, light.colors, self.coarse_light, known, wanted,
            self.projected.sweep)
        mine.clear_beyond()
        seed_unknown(seeds.disparity, whole, factor, *self.grid.nodes, mine.d, mine.a, mine.b)

    def propagate(self, light, listed, region, step):
        """Let the nodes of a region try the planes of their neighbors, unless theirs fits."""
        mine, settled = self.planes, F4(TUNING.use.settled_misfit)
        best, cost = mine.cost, mine.misfit.reshape(-1)
        put_nodes(listed.nodes, self.misfits(mine, light, HERE, listed)[0], cost)
        best_windows(mine.misfit, region, best)
        open_nodes = (best > settled) & region
        around = cv2.dilate(open_nodes.view(np.uint8), np.ones((5, 5), np.uint8)).view(bool)
        few = self.few.shorten(listed, around)
        for misfits, out in zip(self.misfits(mine, light, step * NEIGHBORS, few), self.costs):
            put_nodes(few.nodes, misfits, cost)
            best_windows(mine.misfit, open_nodes, out)
        with mine.rewriting(keep_unwritten=False) as (old, new):
            take_best(old.d, old.a, old.b, step, self.costs, best, open_nodes, new.d, new.a,
                      new.b)


def least_firm(factor):
    """Return how many of factor x factor nodes must be firm for their coarse node to be known."""
    return F4(math.ceil(TUNING.use.known_share * factor ** 2))


def some_projector(geometry):
    """Return a projector that stands where the right camera does, for those who need any."""
    focal = geometry.focal_x
    camera = np.array([[focal, 0, geometry.center_x_right], [0, focal, geometry.center_y],
                       [0, 0, 1]])
    return ProjectorModel(camera, 0.0, np.eye(3), np.array([-geometry.baseline, 0, 0]), WARM,
                          np.zeros((COUNT, COUNT)))
