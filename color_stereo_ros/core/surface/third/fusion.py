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
"""One verdict of two cameras and projector: which plane a node gets, and how far it is trusted."""

from dataclasses import dataclass

import numpy as np

from .fusion_kernels import (
    bound_odds, decide, expected_wrong, find_treated, gather_evidence, PROJECTOR, sort_nodes,
    spread_planes, spread_views, weigh_forms)
from .sweep_kernels import cells_of_nodes, claim_cells, find_contested
from .tuning import TUNING
from ..grid_kernels import F4
from ..trust import Verdict
from ..trust_kernels import HOPELESS_ODDS as HOPELESS
from ...status import Status


@dataclass(frozen=True, eq=False)
class Fused:
    """What is held of every node after the third view has spoken; framed, kept for one pair."""

    planes: object
    """FusedPlanes."""
    verdict: Verdict
    views: np.ndarray
    """uint8, bits: 1 right camera, 2 projector."""
    beyond: np.ndarray
    """bool, the place in the right image does not matter: the third view sees the node."""

    def views_of(self, status):
        """Return `Measurement.views` at the pixels of a status image."""
        pixels = np.empty_like(status)
        spread_views(self.views, status, pixels)
        return pixels


class FusedPlanes:
    """Planes of the nodes from two sources."""

    def __init__(self, grid, d, a, b):
        """Keep them."""
        self.grid, self.d, self.a, self.b = grid, d, a, b


MODEL_NAMES = 'form', 'agree', 'two_apart', 'third_apart', 'firm'
EVIDENCE = ('two', 'third', 'witness', 'contested_two', 'contested_third', 'dim', 'nearer',
            'farther')
OWN_EVIDENCE = 'cost', 'misfit', 'sigma', 'apart'
APART_OF_NEIGHBORS = OWN_EVIDENCE.index('apart')


@dataclass(frozen=True, eq=False)
class Inputs:
    """What the log-odds of a node are made of; arrays (rows, columns)."""

    own: np.ndarray
    """float32 (4, rows, columns) of the plane of the third view, see `gather_evidence`."""
    evidence: np.ndarray
    """float32 (8, rows, columns), see EVIDENCE."""
    treated: np.ndarray
    """bool, the third view has a plane."""
    kind: np.ndarray
    """
    uint8, 0: none may have a range; AGREE: both planes say the same; FIRM: two cameras know the
    place, and the third view agrees; APART: the planes say different things, or one is missing.
    """
    possible: np.ndarray
    """bool, the two cameras may have a range."""


class Fusion:
    """
    Weighs two cameras against the projector.

    Parameters
    ----------
    grid : HalfGrid
    model : dict, optional
        Fitted forms by their names; default: what ships.

    """

    def __init__(self, grid, model=None):
        """Take the fitted numbers."""
        odds = TUNING.odds
        if model is None:
            model = dict(zip(MODEL_NAMES, (odds.form, odds.agree, odds.two_apart,
                                           odds.third_apart, odds.firm)))
        self.grid = grid
        forms = {name: np.array(model[name], F4) for name in MODEL_NAMES}
        self.own_form = forms['form'][None]
        self.two_forms = np.stack([forms[name] for name in ('agree', 'firm', 'two_apart')])
        self.third_form = forms['third_apart'][None]
        self.doubts = np.array([0, *TUNING.use.doubts], F4)  # by kind
        self.fading = TUNING.use.expected_wrong
        self.kept_certainty = TUNING.use.kept_certainty
        self.own = np.zeros((len(OWN_EVIDENCE), *grid.nodes), F4)
        self.evidence = np.zeros((len(EVIDENCE), *grid.nodes), F4)
        self.odds, self.third_odds = np.zeros((2, *grid.nodes), F4)
        self.kind, self.only_third = np.zeros((2, *grid.nodes), np.uint8)
        self.possible, self.treated = np.zeros((2, *grid.nodes), bool)
        self.spread = np.full(grid.shape, np.nan, F4)
        self.cells = np.zeros((2, *grid.nodes), np.int32)
        self.claims = np.empty((2, 0), F4)
        self.fused = Fused(FusedPlanes(grid, *np.full((3, *grid.shape), np.nan, F4)),
                           Verdict(*np.zeros((2, *grid.shape), F4),
                                   np.zeros(grid.shape, np.uint8)),
                           np.zeros(grid.shape, np.uint8), np.zeros(grid.shape, bool))

    def inputs(self, found, verdict, planes):
        """Return the Inputs of a pair; see `fuse`."""
        evidence, treated = self.evidence, self.with_planes(found.planes, found.treated)
        self.own_odds(found.planes, treated)
        sort_nodes(planes.d, found.planes.d, verdict.log_odds, found.witness, found.firm, treated,
                   found.dim, evidence, self.kind, self.only_third, self.possible, self.odds,
                   self.third_odds)
        self.write_contested(found, planes)
        return Inputs(self.own, evidence, treated, self.kind, self.possible)

    def with_planes(self, planes, region):
        """
        Return which nodes of a region, bool framed, have a plane and a variance.

        bool (rows, columns); the array holds for one pair.

        """
        find_treated(region, planes.d, planes.variance, self.treated)
        return self.treated

    def own_odds(self, planes, treated):
        """
        Return the log-odds of planes of the third view alone, float32 (rows, columns).

        They are `evidence[1]`, and hold for one pair.

        """
        gather_evidence(planes.d, planes.a, planes.b, planes.cost, planes.variance,
                        planes.misfit, treated, self.own, self.evidence[6:])
        odds = self.evidence[1]
        weigh_forms(self.own, treated.view(np.uint8), self.own_form, odds)
        bound_odds(treated, odds)
        return odds

    def std(self, planes, geometry, share):
        """
        Return standard deviations of planes of the third view, px, float32 framed.

            sigma^2 = variance_factor v + (std_per_distance x)^2 + share geometry

        v is the variance of the least squares, x the distance of the neighbors; reads `own`. The
        array holds for one pair; its frame is NaN.

        Parameters
        ----------
        planes : PlaneField
            The planes of the nodes so far.
        geometry : numpy.ndarray, float32, shape (rows, columns)
            Variance by the projector's geometry, px^2.
        share : float
            Of the variance that both pairs of views have in common, 0..1.

        """
        tuning = TUNING.spread
        spread_planes(self.own[APART_OF_NEIGHBORS], planes.variance, geometry, F4(share),
                      F4(tuning.variance_factor), F4(tuning.std_per_distance), self.spread)
        return self.spread

    def alone(self, planes, odds, geometry, lit, left):
        """
        Return the Fused of left camera and projector alone.

        Parameters
        ----------
        planes : PlaneField
            The planes of the nodes so far.
        odds : numpy.ndarray, float32, shape (rows, columns)
            Log-odds of each node.
        geometry : numpy.ndarray, float32, shape (rows, columns)
            As for `std`.
        lit : numpy.ndarray, bool, framed
            Where the projector lights the surface.
        left : View
            The left view.

        Returns
        -------
        fused : Fused

        """
        grid, inner = self.grid, self.grid.inner
        log_odds = np.full(grid.shape, HOPELESS, F4)
        log_odds[inner] = np.where(self.with_planes(planes, lit), odds, HOPELESS)
        grid.repeat_columns(log_odds)
        reason = np.full(grid.shape, Status.IMPLAUSIBLE, np.uint8)
        reason[~lit] = Status.DARK
        reason[left.peak < 0] = Status.OUTSIDE_IMAGE
        views = np.full(grid.shape, PROJECTOR, np.uint8)
        return Fused(FusedPlanes(grid, planes.d, planes.a, planes.b),
                     Verdict(self.std(planes, geometry, 1), log_odds, reason), views,
                     np.ones(grid.shape, bool))

    def write_contested(self, found, planes):
        """Write for both planes the odds of another surface at the same place of the pattern."""
        use, projected, evidence = TUNING.use, found.projected, self.evidence
        cell = F4(2 * projected.scale * use.cell)
        height, width = (int(count / cell) + 1 for count in projected.size)
        if self.claims.size != 2 * height * width:
            self.claims = np.empty((2, height * width), F4)
        best, owner = self.claims
        cells = self.cells
        for each, out in zip((planes.d, found.planes.d), cells):
            cells_of_nodes(projected.sweep, each, cell, height, width, out)
        claim_cells(planes.d, found.planes.d, evidence, cells, best, owner)
        distance = F4(use.contest_distance)
        find_contested(planes.d, cells[0], distance, best, owner, evidence[3])
        find_contested(found.planes.d, cells[1], distance, best, owner, evidence[4])

    def fuse(self, found, verdict, planes):
        """
        Return the fused planes and verdict.

        Parameters
        ----------
        found : Found
            What left camera and projector have found.
        verdict : Verdict
            Of the two cameras; not changed.
        planes : PlaneField
            Of the two cameras; not changed.

        Returns
        -------
        fused : Fused

        """
        self.inputs(found, verdict, planes)
        weigh_forms(self.evidence, self.kind, self.two_forms, self.odds)
        weigh_forms(self.evidence, self.only_third, self.third_form, self.third_odds)
        fused, third = self.fused, found.planes
        std = self.std(third, found.geometry, TUNING.spread.geometry_share)
        demanding = self.demanding(verdict)
        decide(self.kind, self.possible, self.evidence, self.odds, self.third_odds,
               self.certainty(demanding), self.doubts * demanding, planes.d, planes.a, planes.b,
               verdict.std, verdict.reason, third.d, third.a, third.b, std, fused.planes.d,
               fused.planes.a, fused.planes.b, fused.verdict.std, fused.verdict.log_odds,
               fused.verdict.reason, fused.views, fused.beyond)
        return fused

    def certainty(self, demanding):
        """
        Return by which factor high log-odds count in a pair, float32 (4,), by kind.

        Both pairs of views share the left image. Its blur, noise and compression move both planes
        alike, so that they agree on wrong places, too. The third view therefore makes less certain
        where doubts have faded. Hardly any range is lost: log-odds up to `sure_odds` stay. What
        two cameras know for certain stays, too.

        """
        kept = 1 - (1 - demanding) * F4(1 - self.kept_certainty)
        return np.array([1, kept, 1, kept], F4)

    def demanding(self, verdict):
        """
        Return how much of the doubts counts in a pair, float32 0 .. 1.

        The doubts keep the share of wrong ranges as low as that of two cameras. These say how
        many of their own ranges they expect to be wrong. Under blur, noise or compression that
        is more, and doubts would only take right ranges away.

        """
        wrong = expected_wrong(verdict.log_odds[self.grid.inner], TUNING.use.told_step)
        return F4(np.interp(wrong, self.fading, (1, 0)))
