# SPDX-License-Identifier: Apache-2.0
"""Trust: how far each node can be believed, how precise it is, and why some have no range."""

from dataclasses import dataclass
import math

import cv2
import numpy as np

from ..compiled.bands import BANDS
from ..status import Status
from .grid_kernels import F4
from .trust_kernels import brightness_balance, find_hidden, judge, remove_islands, settle

# Log-odds of being right within 1 px: a quadratic form of one and the evidence that
# `_trust_kernels.judge` lists. Fitted on simulated scenes, see docs/surface_method.md.
MODEL = np.array([
    [12.516, -0.863, -0.749, -16.460, -8.159, -5.095],
    [0, -0.002, -0.044, 0.104, 0.272, 0.545],
    [0, 0, -0.031, 0.661, 0.815, 0.208],
    [0, 0, 0, 10.139, -1.186, 1.850],
    [0, 0, 0, 0, 1.705, 2.141],
    [0, 0, 0, 0, 0, -4.752]], F4)
HIDDEN_ODDS = F4(-4.0)  # more than the fit (-1): there is no cheaper way to fewer false ranges
ODDS_SLOW = F4(-1.0)  # of all nodes under a pattern whose colors change slowly
VAGUE = 0.7         # px: standard deviation of a plane that is too uncertain to publish
VAGUE_SLOW = 1.0    # px: likewise under a pattern whose colors change slowly
CONTINUOUS = F4(1.0)     # px between neighbors on one surface
BRIGHT = F4(48.0)   # DN of summed channels: of darker nodes more must agree to be no island
SEPARATE = F4(1.0)  # px between two surfaces that claim one place of the right image
BALANCE_STEP = 4    # nodes between samples of the brightness that two views of a surface have
BALANCE_SURROUNDINGS = 5, 5  # samples: several, but hardly more than one surface
THINNED = 2         # nodes between samples
SURROUNDINGS = 15, 15  # samples: here some planes of real surfaces lie closer to their neighbors
APART = F4(0.3)     # than this (px^0.5); where a larger share than this contradicts them,
DISCORD = F4(0.65)  # matches are chance,
DISCORD_ODDS = F4(20.0)  # and lose up to these log-odds
# Share of clear nodes around a node under a pattern that repeats, and log-odds that its period
# is the right one: measured on simulated scenes under 16 sines, see docs/surface_method.md.
PERIOD_ODDS = ((0.0, 0.1, 0.3, 0.5, 0.7, 0.85, 0.99, 1.0),
               (-0.6, -0.4, 0.4, 1.1, 2.1, 4.2, 5.5, 14.0))
ROBUST = F4(9.0)
WRONG_PERIOD_REASONS = (Status.NO_MATCH, Status.INCONSISTENT, Status.OUT_OF_RANGE,
                        Status.IMPLAUSIBLE)  # what a wrong period looks like


@dataclass(frozen=True, eq=False)
class Verdict:
    """What is held of every node; framed arrays that the next pair overwrites."""

    std: np.ndarray
    """float32, standard deviation of the disparity, px."""
    log_odds: np.ndarray
    """float32, of being right within 1 px; HOPELESS where no range is possible."""
    reason: np.ndarray
    """uint8, a `Status` code: why there may be no range."""


class Trust:
    """Judges the planes of one rig."""

    def __init__(self, grid, limits, settings, slow, arena):
        """Allocate the evidence."""
        self.grid, self.settings, self.slow = grid, settings, slow
        self.limits = limits + np.array([-0.5, 0.5], F4)
        self.vague = F4(VAGUE_SLOW if slow else VAGUE)
        self.model = MODEL
        if slow:
            self.model = MODEL.copy()
            self.model[0, 0] += ODDS_SLOW
        self.log_odds = arena.zeros(grid.shape, F4)
        self.evidence = arena.empty((len(MODEL) - 1, *grid.nodes), F4)
        samples = (max(1, count // BALANCE_STEP) for count in grid.nodes)
        self.balance = arena.zeros((2, *samples), F4)
        self.hidden = arena.zeros(grid.shape, bool)
        self.owners = arena.empty((BANDS, grid.width), np.int32), arena.empty(
            (BANDS, grid.width), F4)
        self.segments = arena.empty((4, grid.rows * grid.columns), np.int32)
        self.verdict = Verdict(arena.zeros(grid.shape, F4), arena.zeros(grid.shape, F4),
                               arena.zeros(grid.shape, np.uint8))

    def judge(self, views, planes, misfit, seeds):
        """
        Find out how far each node can be trusted, and why some cannot.

        Parameters
        ----------
        views : Views
        planes : PlaneField
        misfit : numpy.ndarray, float32, framed
            Of the nodes under their planes.
        seeds : Seeds

        Returns
        -------
        verdict : Verdict

        """
        self.weigh(views, planes, misfit)
        if not self.slow:
            self.distrust_discord(planes)
        self.remove_islands(views, planes)
        self.find_hidden(planes)
        verdict = self.settle(views, planes)
        if seeds.clear_share is not None:
            self.doubt_repetitions(seeds.clear_share, verdict)
        return verdict

    def weigh(self, views, planes, misfit):
        """Write the evidence of every node, and the log-odds that follow from it."""
        usual = self.usual_balance(views, planes, misfit)
        judge(*planes, planes.cost, misfit, planes.variance, views.left.s, views.right.s, usual,
              *self.grid.nodes, self.model, self.evidence, self.log_odds)

    def usual_balance(self, views, planes, misfit):
        """Return the brightness left against right around each node, float32 (rows, columns)."""
        brightness_balance(planes.d, misfit, views.left.s, views.right.s, BALANCE_STEP, ROBUST,
                           *self.balance)
        balance, weight = (cv2.blur(each, BALANCE_SURROUNDINGS) for each in self.balance)
        return self.at_all_nodes(balance / np.maximum(weight, F4(1e-3)))

    def at_all_nodes(self, samples):
        """Return samples of a coarser grid at all nodes, linearly interpolated."""
        return cv2.resize(samples, self.grid.nodes[::-1], interpolation=cv2.INTER_LINEAR)

    def distrust_discord(self, planes):
        """
        Trust nodes less where most planes around them contradict their neighbors.

        Noise, or two images of different things, match by chance here and there. A single such
        node looks as good as a true one; its surroundings do not.

        """
        inner = self.grid.inner
        thinned = np.s_[::THINNED, ::THINNED]  # a share needs no more samples
        known = (planes.variance[inner][thinned] < F4(0.25)).view(np.uint8)
        apart = (self.evidence[3][thinned] > APART).view(np.uint8) & known
        # border pixels are repeated, by both counts alike
        counts = [cv2.boxFilter(each, cv2.CV_32F, SURROUNDINGS, normalize=False)
                  for each in (apart, known)]
        share = counts[0] / np.maximum(counts[1], F4(1))
        excess = np.maximum(share - DISCORD, F4(0))
        if excess.any():
            excess = self.at_all_nodes(excess)
            cv2.scaleAdd(excess, -float(DISCORD_ODDS / (F4(1) - DISCORD)), self.log_odds[inner],
                         dst=self.log_odds[inner])

    def remove_islands(self, views, planes):
        """Distrust surfaces that are smaller than `matching.min_segment`."""
        least_nodes = self.settings.matching.min_segment // 4
        if least_nodes > 1:
            remove_islands(*planes, self.log_odds, views.left.s, BRIGHT, *self.grid.nodes,
                           CONTINUOUS, least_nodes, *self.segments)

    def find_hidden(self, planes):
        """Mark nodes whose place in the right image shows a more trusted surface."""
        if self.settings.matching.occlusion_test:
            d, a, _ = planes
            find_hidden(d, a, self.log_odds, *self.grid.nodes, self.grid.width, SEPARATE,
                        self.hidden, *self.owners)

    def settle(self, views, planes):
        """Return standard deviation, final log-odds and reason of every node."""
        color, verdict = self.settings.color, self.verdict
        settle(planes.d, planes.variance, self.evidence, planes.cost, self.log_odds, self.hidden,
               views.left.peak, views.left.s, *self.grid.nodes, self.limits,
               F4(color.saturation_level - 1), F4(color.min_signal), HIDDEN_ODDS, self.vague,
               verdict.std, verdict.log_odds, verdict.reason)
        return verdict

    def doubt_repetitions(self, clear_share, verdict):
        """
        Trust no node more than that no repetition of the pattern was taken for its match.

        That is decided for whole surfaces: where a repetition costs about as much at many nodes,
        it may have won at all of them.

        """
        odds = np.interp(self.at_all_nodes(clear_share), *PERIOD_ODDS).astype(F4)
        rows, columns = self.grid.inner
        framed = np.s_[rows, columns.start - 1:columns.stop + 1]  # `settle` repeats the borders
        np.minimum(verdict.log_odds[framed], np.pad(odds, ((0, 0), (1, 1)), 'edge'),
                   out=verdict.log_odds[framed])
        # nodes that have no range because the pattern repeats get that reason
        reason = verdict.reason[self.grid.inner]
        reason[(odds < log_odds(self.settings.matching.min_confidence))
               & np.isin(reason, WRONG_PERIOD_REASONS)] = Status.AMBIGUOUS


def log_odds(probability):
    """Return the log-odds of a probability 0..1, float32, finite."""
    p = min(max(probability, 1e-6), 1 - 1e-6)
    return F4(math.log(p / (1 - p)))
