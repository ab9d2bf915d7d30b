# SPDX-License-Identifier: Apache-2.0
"""One verdict of two cameras and projector: which plane a node gets, and how far it is trusted."""

from dataclasses import dataclass

import numpy as np

from ..grid_kernels import F4, PAD
from ..trust import Verdict
from ..tuning import TUNING as SURFACE
from ...status import Status
from .sweep_kernels import claim_places, find_contested, places_of_nodes
from .tuning import TUNING

RIGHT_CAMERA, PROJECTOR = 1, 2
HOPELESS = F4(SURFACE.trust.hopeless_odds)


@dataclass(frozen=True, eq=False)
class Fused:
    """What is held of every node after the third view has spoken; framed arrays."""

    planes: object
    """FusedPlanes."""
    verdict: Verdict
    views: np.ndarray
    """uint8, bits: 1 right camera, 2 projector."""
    beyond: np.ndarray
    """bool, the place in the right image does not matter."""

    def views_of(self, status):
        """Return `Measurement.views` at the pixels of a status image."""
        height, width = status.shape
        nodes = self.views[self.planes.grid.inner]
        rows = np.minimum(np.arange(height) // 2, nodes.shape[0] - 1)
        columns = np.minimum(np.arange(width) // 2, nodes.shape[1] - 1)
        return np.where(status == Status.VALID, nodes[rows][:, columns], np.uint8(0))


class FusedPlanes:
    """Planes of the nodes from two sources."""

    def __init__(self, grid, d, a, b):
        """Keep them."""
        self.grid, self.d, self.a, self.b = grid, d, a, b


def evidence_of(planes, misfit, grid):
    """
    Return what tells how far a plane of the third view can be trusted, float32 (4, rows, columns).

    Square roots of the cost of the best shifted window, of the mean misfit of 3 x 3 nodes, of the
    standard deviation (px), and of the mean distance of the four neighbors from the plane (px).

    """
    use = TUNING.use
    inner = grid.inner
    rows, columns = grid.nodes
    d, a, b = planes.d, planes.a, planes.b
    apart = np.zeros((rows, columns), F4)
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        there = np.s_[PAD + dy:PAD + dy + rows, PAD + dx:PAD + dx + columns]
        away = np.abs(d[there] - d[inner] - F4(dx) * a[inner] - F4(dy) * b[inner])
        apart += np.fmin(away, F4(use.distance_cap))
    cost = np.fmin(planes.cost[inner], F4(use.misfit_cap))
    around = np.fmin(misfit[inner], F4(use.misfit_cap))
    sigma = np.sqrt(np.fmin(planes.variance[inner], F4(use.variance_cap)))
    return np.sqrt(np.stack([cost, around, sigma, apart / 4]))


def quadratic(form, evidence):
    """Return x . form x of x = (1, evidence); form is upper triangular, float (n + 1, n + 1)."""
    form = np.asarray(form, F4)
    total = np.full(evidence.shape[1:], form[0, 0], F4)
    for i, one in enumerate(evidence, 1):
        inner = np.full(one.shape, form[0, i], F4)
        for j in range(i, len(form)):
            if form[i, j]:
                inner += form[i, j] * evidence[j - 1]
        total += one * inner
    return total


MODEL_NAMES = 'form', 'agree', 'two_apart', 'third_apart', 'firm'
EVIDENCE = 'two', 'third', 'witness', 'contested_two', 'contested_third', 'dim'


@dataclass(frozen=True, eq=False)
class Inputs:
    """What the log-odds of a node are made of; arrays (rows, columns)."""

    evidence: np.ndarray
    """float32 (6, rows, columns), see EVIDENCE."""
    treated: np.ndarray
    """bool, the third view has a plane."""
    agree: np.ndarray
    """bool, both planes say the same."""
    firm: np.ndarray
    """bool, two cameras know the place, and the third view agrees."""
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
        model = vars(TUNING.odds) if model is None else model
        self.grid = grid
        self.form, self.agree, self.two_apart, self.third_apart, self.firm = (
            np.array(model[name], F4) for name in MODEL_NAMES)
        self.contested = np.zeros((2, *grid.nodes), F4)

    def inputs(self, found, verdict, planes):
        """Return the Inputs of a pair; see `fuse`."""
        use, inner = TUNING.use, self.grid.inner
        third = quadratic(self.form, evidence_of(found.planes, found.around, self.grid))
        low, high = use.odds_limits
        treated = (np.isfinite(found.planes.d[inner]) & np.isfinite(found.planes.variance[inner])
                   & found.treated[inner])
        third = np.where(treated, np.clip(third, F4(low), F4(high)), F4(low))
        two = np.clip(verdict.log_odds[inner], F4(low), F4(high))
        apart = np.abs(found.planes.d[inner] - planes.d[inner])
        witness = np.sqrt(np.fmin(found.witness[inner], F4(use.misfit_cap)))
        contested = self.contested_places(found, two, third, planes)
        return Inputs(np.stack([two, third, witness, *contested, found.dim]), treated,
                      treated & (apart < F4(use.agreement)), found.firm[inner],
                      verdict.log_odds[inner] > HOPELESS / 2)

    def own_odds(self, planes, around):
        """Return the log-odds of planes of the third view alone, float32 (rows, columns)."""
        low, high = TUNING.use.odds_limits
        odds = quadratic(self.form, evidence_of(planes, around, self.grid))
        known = np.isfinite(planes.d[self.grid.inner]) & np.isfinite(
            planes.variance[self.grid.inner])
        return np.where(known, np.clip(odds, F4(low), F4(high)), HOPELESS)

    def alone(self, planes, odds, std, lit, left):
        """
        Return the Fused of left camera and projector alone.

        Parameters
        ----------
        planes : PlaneField
        odds : numpy.ndarray, float32, shape (rows, columns)
        std : numpy.ndarray, float32, framed
            px.
        lit : numpy.ndarray, bool, framed
        left : View

        Returns
        -------
        fused : Fused

        """
        grid, inner = self.grid, self.grid.inner
        log_odds = np.full(grid.shape, HOPELESS, F4)
        log_odds[inner] = np.where(lit[inner], odds, HOPELESS)
        log_odds[:, PAD - 1] = log_odds[:, PAD]
        log_odds[:, PAD + grid.columns] = log_odds[:, PAD + grid.columns - 1]
        reason = np.full(grid.shape, Status.IMPLAUSIBLE, np.uint8)
        reason[~lit] = Status.DARK
        reason[left.peak < 0] = Status.OUTSIDE_IMAGE
        views = np.full(grid.shape, PROJECTOR, np.uint8)
        return Fused(FusedPlanes(grid, planes.d, planes.a, planes.b),
                     Verdict(std, log_odds, reason), views, np.ones(grid.shape, bool))

    def contested_places(self, found, two, third, planes):
        """Return for both planes the odds of another surface at the same place of the pattern."""
        use, (rows, columns) = TUNING.use, self.grid.nodes
        projected = found.projected
        cell = F4(2 * projected.scale * use.cell)
        height, width = (int(count / cell) + 1 for count in projected.size)
        best, owner = np.empty((2, height, width), F4)
        both = [planes.d[self.grid.inner], found.planes.d[self.grid.inner]]
        places = np.empty((2, 2, rows, columns), F4)
        for each, out in zip((planes.d, found.planes.d), places):
            places_of_nodes(projected.sweep, each, 1, out)
        taken = third > two
        claim_places(np.where(taken, both[1], both[0]), np.maximum(two, third),
                     np.where(taken, places[1], places[0]), cell, best, owner)
        for d, place, out in zip(both, places, self.contested):
            find_contested(d, place, cell, F4(use.contest_distance), best, owner, out)
        return self.contested

    def fuse(self, found, verdict, planes):
        """
        Return the fused planes and verdict.

        Parameters
        ----------
        found : Found
        verdict : Verdict
            Of the two cameras; not changed.
        planes : PlaneField
            Of the two cameras; not changed.

        Returns
        -------
        fused : Fused

        """
        inner, use = self.grid.inner, TUNING.use
        given = self.inputs(found, verdict, planes)
        together = given.agree & ~given.firm
        apart = given.treated & ~given.agree & ~given.firm
        odds = verdict.log_odds[inner].copy()
        for nodes, form in ((together, self.agree), (given.firm, self.firm)):
            odds[nodes] = quadratic(form, given.evidence[:, nodes])
        evidence = given.evidence[:, apart]
        two = np.where(given.possible[apart], quadratic(self.two_apart, evidence), HOPELESS)
        third = quadratic(self.third_apart, evidence)
        odds[apart] = np.maximum(two, third)
        takes_third = together & (given.evidence[0] < F4(use.kept_odds))
        takes_third[apart] = third > two
        return self.assembled(found, verdict, planes, takes_third, given.agree | given.firm, odds)

    def assembled(self, found, verdict, planes, takes_third, agree, odds):
        """Return the Fused of the nodes that take the third plane, and of all log-odds."""
        inner, grid, use = self.grid.inner, self.grid, TUNING.use
        everywhere = np.zeros(grid.shape, bool)
        everywhere[inner] = takes_third
        d, a, b = (np.where(everywhere, third, two) for third, two in zip(
            (found.planes.d, found.planes.a, found.planes.b), (planes.d, planes.a, planes.b)))
        std, log_odds, reason = (each.copy() for each in (
            verdict.std, verdict.log_odds, verdict.reason))
        std[everywhere] = found.std[everywhere]
        log_odds[inner] = odds
        log_odds[:, PAD - 1] = log_odds[:, PAD]
        log_odds[:, PAD + grid.columns] = log_odds[:, PAD + grid.columns - 1]
        reason[everywhere] = Status.IMPLAUSIBLE
        views = np.zeros(grid.shape, np.uint8)
        views[inner] = (np.where(takes_third & ~agree, 0, RIGHT_CAMERA)
                        | np.where(takes_third | agree, PROJECTOR, 0))
        return Fused(FusedPlanes(grid, d, a, b), Verdict(std, log_odds, reason), views,
                     everywhere)

