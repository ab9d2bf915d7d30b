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
"""The coarse search of the surface method: semi-global, over all disparities, on few nodes."""

from dataclasses import dataclass
import math

import cv2
import numpy as np

from .coarse_kernels import (
    add_turned, cost_volume, count_rivals, reduce_colors, rival_gaps, sgm_paths, winners)
from .grid_kernels import F4, PAD
from ..compiled import BANDS
from ..curves import CostCurve
from ..triangulation import search_interval


@dataclass(frozen=True, eq=False)
class Seeds:
    """What the coarse search finds; arrays that the next pair overwrites."""

    disparity: np.ndarray
    """float32 (h, w), in coarse nodes; NaN where left and right disagree."""
    factor: int
    """Nodes of the half grid per coarse node, in rows and in columns."""
    clear_share: np.ndarray
    """float32 (h, w), share of the nodes around with one clear minimum; None: no repetitions."""
    offset: float
    """
    Added to the disparities, px. Right coarse nodes are averages of columns that lie half a pixel
    further right.
    """
    period_odds: np.ndarray = None
    """float32 (h, w) of the coarse grid, log-odds of the right period; None: not in doubt."""
    alike_share: float = float('nan')
    """Share of the nodes whose surroundings are alike in both views; NaN: nobody has asked."""
    likeness: np.ndarray = None
    """float32 (h, w), how alike they are, -1 .. 1, NaN where there is no match; None: unknown."""


class CoarseSearch:
    """
    Semi-global search over all disparities on the coarse grid.

    Parameters
    ----------
    nodes : (int, int)
        Rows and columns of the half grid.
    width : int
        Of the image, px.
    limits : (float, float)
        Smallest and largest disparity, px.
    matching : MatchingSettings
        Of which `texture` and `smoothness` are factors.
    tuning : Tuning
    arena : Arena

    """

    def __init__(self, nodes, width, limits, matching, tuning, arena):
        """Allocate the volumes."""
        coarse = self.tuning = tuning.coarse
        self.factor = 2 ** max(1, math.floor(math.log2(max(width, 1) / coarse.image_width)))
        while self.factor > 2 and self.factor > min(nodes):  # a wide, low strip
            self.factor //= 2
        h, w = (max(1, count // self.factor) for count in nodes)
        step = 2 * self.factor
        # no match lies outside the image, and `winners` counts up to 2047 nodes
        first, last = (int(np.clip(limit, 1 - w, w - 1)) for limit in search_interval(
            (limits[0] / step, limits[1] / step)))
        self.first, depth = first - 1, last - first + 3
        # four path costs, each at most eight capped nodes and one penalty, must fit into int16
        smoothness = min(coarse.smoothness * matching.smoothness, coarse.largest_smoothness)
        self.penalties = [np.int16(round(smoothness * penalty))
                          for penalty in (coarse.small_step, coarse.large_step)]
        self.least_gap = round(tuning.repetition.least_gap * coarse.large_step)
        self.repetition = tuning.repetition
        self.rivals = np.zeros((BANDS, 2), np.int64)
        self.region = 2 * (tuning.repetition.surroundings,)
        self.scale, self.full_trust = F4(coarse.color_scale), F4(coarse.full_trust)
        self.texture = F4(coarse.color_scale * (coarse.texture * matching.texture))
        self.softening = F4(tuning.views.softening)
        self.costs = np.int16(coarse.cost_cap), np.int16(coarse.neutral_cost)
        self.allocate(h, w, depth, arena)

    def allocate(self, h, w, depth, arena):
        """Allocate the volumes of a coarse grid of h x w nodes."""
        self.brightness = arena.zeros((h, w), F4)
        self.sums = arena.empty((BANDS, 3, 2 * self.factor * w), F4)
        self.colors = arena.empty((4, h, w), np.int16)
        self.margin = w + max(abs(self.first), abs(self.first + depth))
        self.upright = Volumes(h, w, depth, (0, self.margin), arena)
        # an even number of lanes, of which `add_turned` fetches two at a time
        self.turned = Volumes(w, h + h % 2, depth, (self.margin, 0), arena)
        self.pairs = self.turned.total.reshape(-1).view(np.int32)
        self.path_scratch = arena.empty(
            (2, 2 * depth + 3, max(each.cost.shape[2] for each in (self.upright, self.turned))),
            np.int16)
        self.disparity, self.clear = arena.empty((2, h, w), F4)
        self.clear_share = np.ones((h, w), F4) if self.least_gap > 0 else None
        self.seeds = Seeds(self.disparity, self.factor, self.clear_share, -0.5)
        self.best = arena.empty((BANDS, 2, w), np.int32)

    def search(self, views):
        """
        Search one pair.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.

        Returns
        -------
        seeds : Seeds

        """
        self.fill_colors(views.left, views.right)
        self.turn()
        self.aggregate()
        winners(self.upright.total, self.first, self.least_gap, self.disparity, self.clear,
                self.best)
        if self.least_gap > 0:
            cv2.blur(self.clear, self.region, dst=self.clear_share)
        return self.seeds

    def curve(self, column, row):
        """
        Return the CostCurve of a pixel in the pair that was searched last.

        column, row: in the rectified left image, px.

        """
        step, (lines, depth, lanes) = 2 * self.factor, self.upright.cost.shape
        line, lane = (min(int(at) // step, count - 1)
                      for at, count in ((row, lines), (column, lanes)))
        return CostCurve.of(
            step * np.arange(self.first, self.first + depth) + self.seeds.offset,
            self.upright.cost[line, :, lane], self.upright.total[line, :, lane], self.costs[0])

    def rival_share(self):
        """Return the share of the lit nodes with a match that match well at two places."""
        tuning = self.repetition
        count_rivals(self.upright.total, self.upright.left[3], np.int16(16),
                     round(tuning.noticed_cost * self.tuning.large_step),
                     round(tuning.noticed_gap * self.tuning.large_step), tuning.noticed_step,
                     self.rivals)
        lit, found = self.rivals.sum(axis=0)
        return float(found / lit) if lit else 0.0

    def period_odds(self, found):
        """
        Return the share of clear nodes, and the log-odds of the right period, float32 (h, w).

        The odds rise with that share, and where another search agrees. Where it agrees widely, and
        most nodes are clear, the period is right: two searches hardly slip alike. A bare
        surface without any depth edge around gets those of the coarse search alone.

        Parameters
        ----------
        found : Seeds
            Of the half grid, on the same pair.

        """
        tuning = self.repetition
        gap = self.least_gap or round(tuning.noticed_gap * self.tuning.large_step)
        winners(self.upright.total, self.first, gap, self.disparity, self.clear, self.best)
        clear = cv2.blur(self.clear, self.region)
        h, w = self.disparity.shape
        ours = (F4(2 * self.factor) * self.disparity - F4(0.5))
        theirs = F4(2) * found.disparity[self.factor // 2::self.factor,
                                         self.factor // 2::self.factor][:h, :w]
        agree = (np.abs(ours - theirs) < F4(2 * self.factor * tuning.agreement)).astype(F4)
        wide = cv2.blur(agree, self.region)
        agree = cv2.blur(agree, 2 * (tuning.agreement_surroundings,))
        alone, both, apart = (np.interp(clear, tuning.clear_shares, odds) for odds in (
            tuning.odds, tuning.agreed_odds, tuning.contested_odds))
        certain = np.interp(wide, tuning.wide_agreement, (0, 1))
        certain *= np.interp(clear, tuning.partly_clear, (0, 1))
        both += certain * (tuning.agreed_odds[-1] - both)
        known = apart + agree * (both - apart)
        found = alone + self.anchored(theirs) * (known - alone)
        firm, limit = np.interp(certain, tuning.firmly_certain, (0, 1)), self.odds_of_colors()
        limit += firm * (tuning.agreed_odds[-1] - limit)
        return clear, np.minimum(found, limit).astype(F4)

    def odds_of_colors(self):
        """
        Return the log-odds that colors around allow for the period, float32 (h, w).

        Along the paths of the search a period wins, too, since its surface lies near its
        neighbors. Colors that are alike at both places say nothing of it.

        """
        tuning = self.repetition
        rival_gaps(self.upright.cost, self.upright.total, self.clear)
        around, trust = 2 * (tuning.color_surroundings,), self.upright.left[3].astype(F4)
        weight = cv2.blur(trust, around)
        gap = cv2.blur(self.clear * trust, around) / np.maximum(weight, F4(1))
        odds = np.interp(gap / F4(self.tuning.large_step), tuning.color_gaps, tuning.color_odds)
        return np.where(weight < 1, F4(tuning.color_odds[-1]), odds).astype(F4)

    def anchored(self, disparity):
        """
        Return how far depth edges around tell the period of a disparity, float32 0 .. 1.

        Both sides of an edge must lie in the right view: a search invents edges at its border.

        """
        jumps = np.zeros(disparity.shape, F4)
        columns = F4(2 * self.factor) * np.arange(disparity.shape[1], dtype=F4)
        place = columns - disparity
        seen = (place >= 0) & (place < F4(2 * self.factor * disparity.shape[1]))
        step = np.abs(disparity[:, 1:] - disparity[:, :-1])
        jumps[:, 1:] = (step > F4(2 * self.factor * self.repetition.agreement)) & (
            seen[:, 1:] & seen[:, :-1])
        around = 2 * (self.repetition.anchor_surroundings,)
        share = cv2.blur(jumps, around) / F4(self.repetition.anchor_share)
        return np.minimum(share, F4(1))

    def aggregate(self):
        """
        Compare all nodes at all disparities; follow the semi-global paths through the costs.

        Reads the colors of both layouts, writes their costs and totals; the sum of all paths is
        upright.total.

        """
        upright, turned = self.upright, self.turned
        columns, lanes = upright.cost.shape[2], turned.cost.shape[2]
        # column x - d of the right image is stored at x - d + margin
        width, start = columns + 2 * self.margin, self.margin - self.first
        cost_volume(upright.left, upright.flat_right, start, width, 1, *self.costs,
                    upright.cost, upright.scratch)
        cost_volume(turned.left, turned.flat_right, start * lanes, lanes, lanes,
                    *self.costs, turned.cost, turned.scratch)
        sgm_paths(upright.cost, turned.cost, *self.penalties, upright.total, turned.total,
                  self.path_scratch)
        add_turned(self.pairs, columns, upright.total)

    def fill_colors(self, left, right):
        """
        Write u, v, texture and trust of both views, int16, into the upright layout.

        left, right : View

        """
        for view, first, step, out in ((left, PAD, self.factor, self.upright.left),
                                       (right, 0, 2 * self.factor, self.colors)):
            reduce_colors(view.u, view.v, view.s, PAD, first, step, self.factor,
                          self.softening, self.scale, self.full_trust, out[0], out[1],
                          self.brightness, out[3], self.sums)
            self.fill_texture(out[2])
        self.upright.inner[:2], self.upright.inner[2:4] = (
            half_way(self.colors[:2]) if self.least_gap > 0 else (self.colors[:2],) * 2)
        self.upright.inner[4:] = self.colors[2:]

    def turn(self):
        """Copy the colors of the upright layout, left and inner, into the turned one."""
        h = self.disparity.shape[0]
        for upright, turned in ((self.upright.left, self.turned.left),
                                (self.upright.inner, self.turned.inner)):
            for plane, turned_plane in zip(upright, turned):
                cv2.transpose(plane, dst=turned_plane[:, :h])
            turned[:, :, h:] = turned[:, :, h - 1:h]  # borders are repeated

    def fill_texture(self, out):
        """Write log brightness against its surroundings, int16: printed or natural texture."""
        level = np.log(self.brightness + F4(self.tuning.texture_offset))
        level -= cv2.blur(level, 2 * (self.tuning.texture_surroundings,))
        largest = self.tuning.largest_texture
        np.multiply(np.clip(level, -largest, largest), self.texture, out=out, casting='unsafe')


def half_way(colors):
    """
    Return the lowest and highest of colors, int16 (2, h, w), within half a node along the rows.

    A color between two nodes then costs nothing (Birchfield and Tomasi 1998). Otherwise a wrong
    period that lies upon a node would cost less than a true match between two nodes.

    """
    middle = (colors[..., 1:] + colors[..., :-1]) >> 1
    low, high = colors.copy(), colors.copy()
    for side in (np.s_[..., 1:], np.s_[..., :-1]):
        np.minimum(low[side], middle, out=low[side])
        np.maximum(high[side], middle, out=high[side])
    return low, high


class Volumes:
    """
    Colors, costs and path costs in one layout; see `coarse_kernels`.

    Parameters
    ----------
    lines, lanes : int
        Size of the coarse grid in this layout, nodes.
    depth : int
        Number of disparities.
    margin : (int, int)
        Lines and lanes without color around the right image.
    arena : Arena

    Attributes
    ----------
    left : numpy.ndarray, int16, shape (4, lines, lanes)
        u, v, texture and trust of the left view.
    right, flat_right, inner : numpy.ndarray, int16
        Lowest u and v, highest u and v, texture and trust of the right view: with margin, shape
        (6, lines + 2 margin[0], lanes + 2 margin[1]); the same as (6, N); without margin.
    cost, total : numpy.ndarray, int16, shape (lines, depth, lanes)
        Costs of the windows, and sums of path costs.
    scratch : numpy.ndarray, int16, shape (BANDS, 4, depth, lanes + 2)

    """

    def __init__(self, lines, lanes, depth, margin, arena):
        """Allocate."""
        self.left = arena.zeros((4, lines, lanes), np.int16)
        self.right = arena.zeros((6, lines + 2 * margin[0], lanes + 2 * margin[1]), np.int16)
        self.flat_right = self.right.reshape(6, -1)
        self.inner = self.right[:, margin[0]:margin[0] + lines, margin[1]:margin[1] + lanes]
        self.cost = arena.empty((lines, depth, lanes), np.int16)
        self.total = arena.empty((lines, depth, lanes), np.int16)
        self.scratch = arena.empty((BANDS, 4, depth, lanes + 2), np.int16)
