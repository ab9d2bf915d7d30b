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
"""Shared errors of colors: what a whole window has in common moves slow colors as one."""

import cv2
import numpy as np

from .grid_kernels import F4, SILENT_VARIANCE


class SharedErrors:
    """
    Widens the variance of planes by errors of colors that all nodes of a window share.

    Light that one surface throws on another, gloss and dark levels change the colors of a whole
    window. Where colors change slowly, such an error e moves the window by e / slope. The misfit
    does not show it: the window has moved to where colors agree. But colors have two components.
    The one across the direction in which colors change stays as wrong as it is, and tells.

    Brightness may hold a window in place. Texture of a surface does; mirror images and shading of
    bare surfaces do not. They have no depth of their own, and the planes that follow them are
    rough. Where most ranges of a pair are rough, brightness holds nothing.

    Parameters
    ----------
    grid : HalfGrid
    tuning : SharedTuning

    """

    def __init__(self, grid, tuning):
        """Keep the constants."""
        self.grid, self.tuning = grid, tuning

    def roughness(self, uneven, log_odds):
        """
        Return how surely the ranges of a pair are too rough for surfaces, 0..1.

        Parameters
        ----------
        uneven : numpy.ndarray, float32, shape (rows, columns)
            See `Quality.uneven`.
        log_odds : numpy.ndarray, float32, framed
            Nodes above 0 have a range.

        """
        known = uneven[log_odds[self.grid.inner] > 0]
        if known.size < self.tuning.least_nodes:
            return 0.0
        return float(np.interp(np.median(known), self.tuning.rough, (0, 1)))

    def widen(self, views, planes, pair, weight, rough=0.0):
        """
        Raise the variance of planes to that of shared errors, where the pair has slow colors.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            What the two views of the pair differ by.
        weight : numpy.ndarray, float32, framed, or None
            Of all carriers at each node, 1/px^2: colors take part with their share of it. None
            where colors alone count.
        rough : float
            See `roughness`.

        Returns
        -------
        slow : bool
            Whether the pair has slow colors.

        """
        left = [plane[self.grid.inner] for plane in (views.left.u, views.left.v)]
        lit = views.left.variance[self.grid.inner] < SILENT_VARIANCE
        near, wide = ([slope(plane, span) for plane in left]
                      for span in (self.tuning.near_span, self.tuning.wide_span))
        if not self.steady(near, wide, lit):
            return False
        variance = planes.variance[self.grid.inner]
        shared = self.variance(left, wide, lit, views, planes, pair, weight, rough)
        np.maximum(variance, shared, out=variance)
        return True

    def steady(self, near, wide, lit):
        """Return whether the slopes of lit nodes over a wide span are those over a near one."""
        if np.count_nonzero(lit) < self.tuning.least_nodes:
            return False
        near, wide = (np.median(np.hypot(*(each[lit] for each in slopes)))
                      for slopes in (near, wide))
        return bool(wide > self.tuning.steady * near)

    def variance(self, left, slopes, lit, views, planes, pair, weight, rough):
        """Return the variance of d by shared errors alone, px^2, float32 (rows, columns)."""
        tuning = self.tuning
        along = [self.mean(each) for each in slopes]
        steepness = np.maximum(np.hypot(*along), F4(tuning.least_slope))
        if rough:  # what is much steeper than usual is the edge of a mirror image
            steepest = F4(tuning.steepest) * np.median(steepness[lit])
            steepness = np.minimum(steepness, np.maximum(steepest, F4(1 - rough) * steepness))
        right, noise = self.matched(views, planes, pair.matrix)
        known = lit & (noise < SILENT_VARIANCE)
        rest = [np.where(known, mine - other, F4(0)) for mine, other in zip(left, right)]
        share = np.maximum(self.mean(known.astype(F4)), F4(tuning.least_share))
        across = np.abs(self.mean(rest[0]) * along[1] - self.mean(rest[1]) * along[0]) / (
            steepness * share)
        error = F4(tuning.gain) * self.root_mean(across, known) ** 4
        if weight is None:
            return error / (steepness * steepness)
        noise = F4(pair.scale) * (views.left.variance[self.grid.inner] + noise)
        informed = self.mean(np.nan_to_num(weight[self.grid.inner])) * noise
        part = steepness * steepness / np.maximum(informed, steepness * steepness)
        part += F4(rough) * (F4(1) - part)
        return error * (part / steepness) ** 2

    def root_mean(self, errors, known):
        """Return the mean of the roots of errors around a node: few large ones count less."""
        around = (self.tuning.surroundings,) * 2
        roots = cv2.blur(np.where(known, np.sqrt(errors), F4(0)), around)
        return roots / np.maximum(cv2.blur(known.astype(F4), around), F4(self.tuning.least_share))

    def matched(self, views, planes, matrix):
        """Return the colors of the right view at the matches, u and v, and their variance."""
        d = planes.d[self.grid.inner]
        rows, columns = d.shape
        x = np.nan_to_num(F4(2) * np.arange(columns, dtype=F4) - d, nan=-1).astype(F4)
        y = np.broadcast_to(np.arange(rows, dtype=F4)[:, None], x.shape).copy()
        u, v, variance = (cv2.remap(np.ascontiguousarray(plane[self.grid.inner[0]]), x, y,
                                    cv2.INTER_LINEAR)
                          for plane in (views.right.u, views.right.v, views.right.variance))
        variance[(x < 0) | (x > views.right.u.shape[1] - 1)] = SILENT_VARIANCE
        return [row[0] * u + row[1] * v + row[2] for row in matrix], variance

    def mean(self, plane):
        """Return means over the window of a plane."""
        return cv2.blur(plane, (self.tuning.window,) * 2)

    def cap(self, verdict, rough=0.0):
        """
        Lower verdict.log_odds to those of a normal error that stays within a pixel.

        In a rough pair the deviation of a node counts as at least the usual one of its ranges:
        single nodes look precise by chance. rough: see `roughness`.

        """
        stds, odds = self.tuning.capped_odds
        deviation = verdict.std
        if rough:
            usual = np.median(deviation[verdict.log_odds > 0])
            deviation = np.maximum(deviation, F4(rough) * usual)
        limits = np.interp(deviation, stds, odds).astype(F4)
        np.minimum(verdict.log_odds, limits, out=verdict.log_odds,
                   where=deviation > F4(stds[0]))


def slope(plane, span):
    """Return the change of a plane per px along its rows, over 2 span nodes; 0 at the border."""
    smooth, change = cv2.blur(plane, (3, 5)), np.zeros_like(plane)
    change[:, span:-span] = (smooth[:, 2 * span:] - smooth[:, :-2 * span]) / F4(4 * span)
    return change
