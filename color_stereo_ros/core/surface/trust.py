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
"""Trust: how far each node can be believed, how precise it is, and why some have no range."""

from dataclasses import dataclass
import math

import cv2
import numpy as np

from .grid_kernels import F4
from .trust_kernels import (
    APART, brightness_balance, distrust_islands, find_hidden, rescale_std, settle, weigh_evidence)
from ..compiled import BANDS
from ..status import Status


@dataclass(frozen=True, eq=False)
class Verdict:
    """What is held of every node; arrays of the shape of `HalfGrid.shape`, kept for one pair."""

    std: np.ndarray
    """float32, standard deviation of the disparity, px."""
    log_odds: np.ndarray
    """float32, of being right within 1 px, ln(p / (1 - p)); HOPELESS_ODDS where no range is."""
    reason: np.ndarray
    """uint8, a `Status` code: why there may be no range."""


class Trust:
    """
    Judges the planes of one rig.

    Parameters
    ----------
    grid : HalfGrid
    limits : numpy.ndarray, float32, shape (2,)
        Smallest and largest disparity, px.
    settings : Settings
    tuning : Tuning
    arena : Arena

    Attributes
    ----------
    limits : numpy.ndarray, float32, shape (2,)
        Of the disparity at a node, px: wider than that of pixels by `pixels.limit_margin`.
    log_odds : numpy.ndarray, float32, framed
        Of being right within 1 px, before nodes are rejected.
    evidence : numpy.ndarray, float32, shape (5, rows, columns)
        See `trust_kernels.weigh_evidence`.
    hidden : numpy.ndarray, bool, framed
        A more trusted surface claims the place in the right image.
    least_odds : numpy.float32
        Log-odds from which a pixel has a range.

    """

    def __init__(self, grid, limits, settings, tuning, arena):
        """Allocate the evidence."""
        self.grid, self.settings = grid, settings
        self.raw, self.unlike = tuning.raw, tuning.unlike
        margin = tuning.pixels.limit_margin
        self.limits = limits + np.array([-margin, margin], F4)
        self.suit(tuning)
        self.least_odds = log_odds(settings.matching.min_confidence,
                                   tuning.pixels.least_probability)
        self.log_odds = arena.zeros(grid.shape, F4)
        self.evidence = arena.empty((len(self.form) - 1, *grid.nodes), F4)
        samples = (max(1, count // self.tuning.balance_step) for count in grid.nodes)
        self.balance = arena.zeros((2, *samples), F4)
        self.hidden = arena.zeros(grid.shape, bool)
        self.owner = arena.empty((BANDS, grid.width), np.int32)
        self.owner_odds = arena.empty((BANDS, grid.width), F4)
        self.segments = arena.empty((4, grid.rows * grid.columns), np.int32)
        self.verdict = Verdict(arena.zeros(grid.shape, F4), arena.zeros(grid.shape, F4),
                               arena.zeros(grid.shape, np.uint8))

    def suit(self, tuning):
        """Judge by the constants of a Tuning from here on; those of the sizes stay."""
        self.tuning, self.repetition = tuning.trust, tuning.repetition
        self.alike_likeness = tuning.brightness.alike
        self.form = np.array(self.tuning.form, F4)
        self.form[0, 0] += F4(self.tuning.odds_offset)
        self.robust_misfit = F4(tuning.planes.robust_misfit)

    def judge(self, views, planes, seeds, balance, confirmed=None, light=None, uneven=None):
        """
        Find out how far each node can be trusted, and why some cannot.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            The planes of the nodes so far.
        seeds : Seeds
            The disparities of the coarse search.
        balance : numpy.ndarray, float32, shape (rows, columns)
            See `usual_balance`; of these planes.
        confirmed : numpy.ndarray, float32, shape (rows, columns), optional
            Added to the log-odds of the nodes.
        light : numpy.ndarray, float32, framed, optional
            Brightness that tells whether a node is lit, DN; default: its own.
        uneven : numpy.ndarray, float32, shape (rows, columns), optional
            See `temper`.

        Returns
        -------
        verdict : Verdict

        """
        self.weigh(views, planes, balance)
        if confirmed is not None:
            self.log_odds[self.grid.inner] += confirmed
            self.distrust_unsteady()
        if self.tuning.discord_odds:
            alike = None if confirmed is None else self.confirmed_alike(seeds, confirmed)
            self.distrust_discord(planes, self.discord_distance(views), alike)
        if uneven is not None:
            self.temper(uneven)
        self.distrust_islands(views, planes, self.log_odds)
        self.find_hidden(planes)
        verdict = self.settle(views, planes, views.left.s if light is None else light)
        if seeds.period_odds is not None:
            self.doubt_repetitions(self.at_all_nodes(seeds.period_odds), verdict)
        elif seeds.clear_share is not None:
            odds = np.interp(self.at_all_nodes(seeds.clear_share), self.repetition.clear_shares,
                             self.repetition.odds).astype(F4)
            self.doubt_repetitions(odds, verdict)
        if views.compressed:
            self.doubt_dark_places(views, verdict)
        excess = views.blur - self.unlike.discord_blurs[0]
        if excess > 0:
            self.doubt_blur(excess, verdict)
        return verdict

    def weigh(self, views, planes, balance):
        """Write the evidence of every node and, in log_odds, what follows from it."""
        rows, columns = self.grid.nodes
        weigh_evidence(planes.d, planes.a, planes.b, planes.cost, planes.misfit, planes.variance,
                       views.left.s, views.right.s, balance, rows, columns, self.form,
                       self.evidence, self.log_odds)

    def distrust_unsteady(self):
        """
        Lower high log_odds of nodes far from the planes of their neighbors.

        Where a search holds the planes, they fit by their brightness even beside their place. No
        node loses its range by that.

        """
        tuning, odds = self.tuning, self.log_odds[self.grid.inner]
        excess = np.maximum(self.evidence[APART] - F4(tuning.steady_distance), F4(0))
        lowered = np.maximum(odds - F4(tuning.unsteady_odds) * excess, F4(tuning.unsteady_floor))
        np.fmin(odds, lowered, out=odds)  # the distance is NaN where there is no plane

    def temper(self, uneven):
        """
        Make log-odds of surfaces true that no aperiodic colors tell apart.

        Wrong planes of slow colors and of texture fit as well as right ones. They are rough.
        A node keeps log-odds of `trust.kept_odds`, so that hardly any range is lost.
        uneven, float32 (rows, columns): see `Quality.uneven`.

        """
        tuning, odds = self.tuning, self.log_odds[self.grid.inner]
        true = (F4(tuning.tempered_odds) + F4(tuning.tempered_factor) * odds
                - F4(tuning.rough_odds) * uneven)
        true = np.maximum(true, np.minimum(odds, F4(tuning.kept_odds)))
        np.copyto(odds, true, where=odds > F4(tuning.island_odds))

    def usual_balance(self, views, planes):
        """Return the brightness left against right around each node, float32 (rows, columns)."""
        tuning = self.tuning
        balance, weight = self.balance
        brightness_balance(planes.d, planes.misfit, views.left.s, views.right.s,
                           tuning.balance_step, self.robust_misfit, balance, weight)
        around = (tuning.balance_surroundings,) * 2
        balance, weight = cv2.blur(balance, around), cv2.blur(weight, around)
        return self.at_all_nodes(balance / np.maximum(weight, F4(tuning.least_balance_weight)))

    def at_all_nodes(self, samples):
        """Return samples, float32 (h, w), at all nodes (rows, columns), linearly interpolated."""
        return cv2.resize(samples, self.grid.nodes[::-1], interpolation=cv2.INTER_LINEAR)

    def discord_distance(self, views):
        """Return the root of the distance from which nodes contradict their neighbors, px^.5."""
        distance, unlike, raw = self.tuning.discord_distance, self.unlike, self.raw
        if views.blur > unlike.discord_blurs[0]:
            distance = max(distance, np.interp(
                views.blur, unlike.discord_blurs, unlike.discord_distances))
        if views.compressed:
            distance = max(distance, np.interp(
                views.quantization, raw.quantizations, raw.discord_distances))
        return distance

    def confirmed_alike(self, seeds, confirmed):
        """Return the nodes that a search confirms, in surroundings that are alike, bool."""
        return (seeds.likeness > F4(self.alike_likeness)) & (confirmed > F4(0))

    def distrust_discord(self, planes, distance, alike=None):
        """
        Trust nodes less where most planes around them contradict their neighbors.

        Noise, or two images of different things, match by chance here and there. A single such
        node looks as good as a true one; its surroundings do not.

        Parameters
        ----------
        planes : PlaneField
            The planes of the nodes so far.
        distance : float
            Root of the distance from which they do, px^.5.
        alike : numpy.ndarray, bool, shape (rows, columns), optional
            Nodes whose large surroundings are alike in both views, which is no chance: where
            they fit well, they keep log-odds of `trust.alike_odds`.

        """
        tuning, inner = self.tuning, self.grid.inner
        thinned = np.s_[::tuning.discord_step, ::tuning.discord_step]
        known = (planes.variance[inner][thinned] < F4(tuning.discord_variance)).view(np.uint8)
        apart = self.evidence[APART][thinned] > F4(distance)
        apart = apart.view(np.uint8) & known
        # border pixels are repeated, by both counts alike
        around = (tuning.discord_surroundings,) * 2
        counts = [cv2.boxFilter(each, cv2.CV_32F, around, normalize=False)
                  for each in (apart, known)]
        share = counts[0] / np.maximum(counts[1], F4(1))
        most = F4(tuning.discord_share)
        excess = np.maximum(share - most, F4(0))
        if excess.any():
            loss = -float(F4(tuning.discord_odds) / (F4(1) - most))
            odds, kept = self.log_odds[inner], F4(tuning.alike_odds)
            held = None if alike is None else alike & (odds >= kept)
            cv2.scaleAdd(self.at_all_nodes(excess), loss, odds, dst=odds)
            if held is not None:
                np.maximum(odds, kept, out=odds, where=held)

    def distrust_islands(self, views, planes, log_odds):
        """
        Lower log_odds of surfaces that are smaller than `matching.min_segment`.

        Parameters
        ----------
        views : Views
            Dark nodes of the left one count less.
        planes : PlaneField or FusedPlanes
            Nodes whose planes meet belong to one surface.
        log_odds : numpy.ndarray, float32, framed
            Of these planes; also the columns beside the nodes are written.

        """
        least_nodes = self.settings.matching.min_segment // 4
        if least_nodes > 1:
            rows, columns = self.grid.nodes
            run_of, first, parent, size = self.segments
            distrust_islands(planes.d, planes.a, planes.b, log_odds, views.left.s,
                             F4(self.tuning.full_brightness), rows, columns,
                             F4(self.tuning.joined_distance), least_nodes, run_of, first, parent,
                             size)
            self.grid.repeat_columns(log_odds)

    def find_hidden(self, planes):
        """Mark in hidden the nodes whose place in the right image shows a more trusted surface."""
        if self.settings.matching.occlusion_test:
            rows, columns = self.grid.nodes
            find_hidden(planes.d, planes.a, self.log_odds, rows, columns, self.grid.width,
                        F4(self.tuning.hidden_distance), self.hidden, self.owner,
                        self.owner_odds)

    def settle(self, views, planes, light):
        """Return standard deviation, final log-odds and reason of every node."""
        color, verdict = self.settings.color, self.verdict
        rows, columns = self.grid.nodes
        settle(planes.d, planes.variance, self.evidence, planes.cost, self.log_odds, self.hidden,
               views.left.peak, light, rows, columns, self.limits,
               F4(color.saturation_level - 1), F4(color.min_signal), F4(self.tuning.hidden_odds),
               F4(self.tuning.vague_std), verdict.std, verdict.log_odds, verdict.reason)
        return verdict

    def rescale(self, verdict, assumed, variance):
        """
        Change verdict.std from assumed variances of planes to true ones.

        Parameters
        ----------
        verdict : Verdict
            What is believed of each node.
        assumed : numpy.ndarray, float32, shape (rows, columns)
            Variances as `judge` has taken them, px^2.
        variance : numpy.ndarray, float32, framed
            Variances as they are, px^2.

        """
        rescale_std(verdict.std, self.evidence[APART], assumed, variance)

    def doubt_dark_places(self, views, verdict):
        """Change the log-odds of compressed images by their light, and the deviation."""
        raw, odds = self.raw, verdict.log_odds
        low, high = np.log(raw.trusted_light)
        light = np.log(np.maximum(views.left.s, F4(1)))
        share = np.clip((light - F4(low)) * F4(1 / (high - low)), 0, 1)
        possible = odds > F4(self.tuning.island_odds)
        factor = F4(raw.dark_odds) + F4(1 - raw.dark_odds) * share
        changed = F4(raw.even_odds) + factor * (odds - F4(raw.even_odds))
        verdict.std[:] *= F4(np.interp(views.quantization, raw.quantizations, raw.std_factors))
        np.copyto(odds, changed + F4(raw.added_odds) * share, where=possible)

    def doubt_blur(self, excess, verdict):
        """
        Doubt matches by how much more blur both views share than clean pairs show, px^2.

        High log-odds fall, those of doubtful nodes rise: blur makes evidence weak, for and against
        a match.

        """
        unlike, odds = self.unlike, verdict.log_odds
        factor = F4(max(1 - unlike.doubt_per_blur * excess, unlike.least_factor))
        even = F4(unlike.even_odds)
        lift = F4(min(unlike.lift_per_blur * excess, unlike.largest_lift))
        np.copyto(odds, even + factor * (odds + lift - even),
                  where=odds > F4(self.tuning.island_odds))
        verdict.std[:] *= F4(1 + unlike.std_per_blur * excess)

    def doubt_repetitions(self, odds, verdict):
        """
        Limit the log-odds of each node to those of the right period.

        A repetition of the pattern may have been taken for the match. That is decided for whole
        surfaces: where a repetition costs about as much at many nodes, it may have won at all of
        them.

        """
        rows, columns = self.grid.inner
        framed = np.s_[rows, columns.start - 1:columns.stop + 1]  # `settle` repeats the borders
        np.minimum(verdict.log_odds[framed], np.pad(odds, ((0, 0), (1, 1)), 'edge'),
                   out=verdict.log_odds[framed])
        # nodes that have no range because the pattern repeats get that reason
        reason = verdict.reason[self.grid.inner]
        wrong_period = [Status[name] for name in self.repetition.reasons]
        reason[(odds < self.least_odds) & np.isin(reason, wrong_period)] = Status.AMBIGUOUS


def log_odds(probability, least):
    """Return the log-odds of a probability 0..1, float32; it counts as least .. 1 - least."""
    p = min(max(probability, least), 1 - least)
    return F4(math.log(p / (1 - p)))
