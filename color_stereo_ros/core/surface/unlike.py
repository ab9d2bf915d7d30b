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
"""
By how much the two views of a pair differ in blur and color, measured at matched nodes.

A matched node sees the same point in both views. What is left of the difference of its
chromaticities is explained by a linear model: the bend (second differences) of the color shows
unequal blur, and each kind of unequal color has a pattern of its own over the colors. The model is
fitted robustly. The part of a difference along the gradient of the color may come from an error of
the disparity; it counts for less.

"""

import copy
from dataclasses import dataclass

import cv2
import numpy as np

from .grid_kernels import F4, PAD, SILENT_VARIANCE
from .tuning import TUNING

LEAST_FORESHORTENING = F4(TUNING.pair.least_foreshortening)
DIM_VARIANCE, BRIGHT_SHARE = F4(TUNING.pair.dim_variance), TUNING.pair.bright_share
LEAST_SAMPLES = TUNING.unlike.least_samples
ROOT3 = F4(np.sqrt(3.0))
GAUGES = np.array([[2.0, -1.0, -1.0], [0.0, 1.0, -1.0]], F4)
GAUGES /= np.linalg.norm(GAUGES, axis=1, keepdims=True)
"""Two log gains of (r, g, b) that chromaticities can tell; the third is brightness."""
REACH = 4
"""Columns of the right view beside a place that are read."""
LINEAR = 3
"""Terms of a linear polynomial over the image."""
DIRECTIONS = [(0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)]
"""Rows and columns from a node to its eight neighbors."""
QUADRATIC = 6
"""Terms of a quadratic one."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Matched nodes; arrays of N, or (2, N) for u and v."""

    rows: np.ndarray
    """In the framed grid."""
    columns: np.ndarray
    """Of the left view, in the framed grid."""
    place: np.ndarray
    """Column in the right view."""
    error: np.ndarray
    """Left minus right chromaticity."""
    color: np.ndarray
    """Of the right view."""
    slope: np.ndarray
    """Of the right chromaticity along the rows, per px."""
    bends: np.ndarray
    """(3, 2, N): second derivative along rows, along columns, and along both, mean of both views,
    per px^2."""

    @property
    def count(self):
        """Return N."""
        return self.rows.size


def sampled(views, planes, step_y, step_x):
    """
    Return the matched nodes of every step_y-th row and step_x-th column.

    Parameters
    ----------
    views : Views
        Both views as the method sees them.
    planes : PlaneField
        The planes of the nodes so far.
    step_y, step_x : int
        Nodes.

    Returns
    -------
    samples : Samples

    """
    left, right = views.left, views.right
    rows, columns = views.grid.nodes
    width = right.u.shape[1]
    inner = np.s_[PAD + 1:PAD + rows - 1:step_y, PAD + 1:PAD + columns - 1:step_x]
    y, x = np.mgrid[inner]
    place = (2 * (x - PAD)).astype(F4) - planes.d[inner]
    with np.errstate(invalid='ignore'):
        known = (place >= REACH - 1) & (place < width - REACH - 1)
    known &= left.variance[inner] < SILENT_VARIANCE
    y, x, place = y[known], x[known], place[known]
    i = place.astype(np.int32)
    at = y * width + i
    flat = right.variance.ravel()
    lit = np.maximum(flat[at], flat[at + 1]) < SILENT_VARIANCE
    for step_down, step_right in DIRECTIONS:
        lit &= flat[at + (step_down * width + 2 * step_right)] < SILENT_VARIANCE
        lit &= left.variance[y + step_down, x + step_right] < SILENT_VARIANCE
    bright = lit & (left.variance[y, x] < DIM_VARIANCE)
    if LEAST_SAMPLES <= bright.sum() < BRIGHT_SHARE * lit.sum():
        lit = bright  # see `pair_model.mostly_dim`
    y, x, place, at = y[lit], x[lit], place[lit], at[lit]
    weights = cubic(place - np.floor(place))
    found = [compared(each_left, each_right.ravel(), y, x, at, weights, width)
             for each_left, each_right in ((left.u, right.u), (left.v, right.v))]
    error, color, slope, bend_x, bend_y, twist = (np.stack(each) for each in zip(*found))
    if views.psf > 0:
        error += F4(0.5) * foreshortened(planes.a[y, x], planes.b[y, x], views.psf) * bend_x
    return Samples(y, x, place, error, color, slope, np.stack([bend_x, bend_y, twist]))


def foreshortened(a, b, psf):
    """
    Return by how much the right view of planes is wider along the rows than the left one, px^2.

    a, b: slopes, px per node; psf: variance of the point spread, px^2. See `linearize`.

    """
    width = np.maximum(1 - a / 2, LEAST_FORESHORTENING)
    return psf * ((1 + b * b / 4) / width ** 2 - 1)


def cubic(t):
    """Return the weights of four columns around a place, (4, N), see `linearize`."""
    return np.stack([t * (t * (3 - t) - 2) / 6, 1 + t * (t * (t - 2) - 1) / 2,
                     t * (2 + t * (1 - t)) / 2, t * (t * t - 1) / 6])


def compared(left, right, y, x, at, weights, width):
    """
    Return error, color, slope and bends of one chromaticity, see `Samples`.

    left: framed; right: flat, of so many columns; at: flat index left of the places.

    """
    def interpolated(step):
        return sum(weight * right[at + (step + k)] for k, weight in enumerate(weights, -1))

    here, there = left[y, x], interpolated(0)
    before, after = interpolated(-2), interpolated(2)
    bend_x = before + after - 2 * there + left[y, x - 1] + left[y, x + 1] - 2 * here
    bend_y = (interpolated(-width) + interpolated(width) - 2 * there
              + left[y - 1, x] + left[y + 1, x] - 2 * here)
    twist = sum(down * to_right * (interpolated(down * width + 2 * to_right)
                                   + left[y + down, x + to_right])
                for down, to_right in DIRECTIONS if down * to_right)
    return here - there, there, (after - before) / 4, bend_x / 8, bend_y / 8, twist / 32


def shares(color):
    """Return the shares of r, g, b, (3, N), of chromaticities (2, N)."""
    red = (color[0] + 1) / 3
    green = (1 - red + color[1] / ROOT3) / 2
    return np.stack([red, green, 1 - red - green])


def regained(share, log_gain):
    """Return by how much chromaticities change with small log gains of the channels, (2, N)."""
    change = share * (log_gain - (share * log_gain).sum(axis=0))
    return np.stack([3 * change[0], ROOT3 * (change[1] - change[2])])


def polynomial(x, y, terms):
    """Return the first terms of a polynomial over the image; x, y: -1 .. 1."""
    return [np.ones_like(x), x, y, x * x - F4(1 / 3), x * y, y * y - F4(1 / 3)][:terms]


@dataclass(frozen=True, eq=False)
class Unlikeness:
    """What makes the right view like the left one; log gains of (r, g, b)."""

    blur: np.ndarray
    """(2, LINEAR or QUADRATIC): variance that blurs the right view along rows and columns, px^2;
    below 0 the left view is the sharper one."""
    oblique: float
    """Covariance of this blur between rows and columns, px^2; 0 where it lies along them."""
    gain: np.ndarray
    """(2, QUADRATIC): of the gauges, over the right view."""
    gamma: float
    """What is added to the exponent of the right channels."""
    matrix: np.ndarray
    """(2, 2): what is added to the unit matrix that maps right chromaticities."""
    blur_limits: np.ndarray
    """(2, 2): smallest and largest blur at the samples, per axis, px^2."""
    gain_limits: np.ndarray
    """(2, 2): smallest and largest log gain at the samples, per gauge."""
    bands: tuple
    """Log gains (bins, 3) of the raw rows of the left and of the right view; () = none."""
    shift: float
    """Usual disparity, px."""
    blurred: bool
    """The blur is significant."""
    recolored: bool
    """The colors are significantly different."""
    size: float
    """Largest difference in units of one that the search bears well; 1: search again."""


class Regression:
    """
    Fits the model of unequal views to samples.

    Parameters
    ----------
    samples : Samples
    views : Views
    tuning : UnlikeTuning
    blur, color : bool
        What is asked.
    turns : int
        Of the robust regression.
    blur_terms : int
        Of the polynomial of the blur.

    """

    def __init__(self, samples, views, tuning, blur, color, turns, blur_terms=LINEAR):
        """Build the terms and solve."""
        self.samples, self.tuning, self.views = samples, tuning, views
        self.turns = turns
        rows, columns = views.grid.nodes
        self.y = ((samples.rows - PAD) * F4(2 / rows) - 1).astype(F4)
        self.x = (samples.place * F4(1 / columns) - 1).astype(F4)
        self.share = np.clip(shares(samples.color), F4(tuning.least_share), 1)
        self.gauged = [regained(self.share, gauge[:, None]) for gauge in GAUGES]
        self.blur, self.colors = blur, list(self.color_terms()) if color else []
        steep = np.sqrt((samples.slope ** 2).sum(axis=0)) + F4(tuning.least_slope)
        along = samples.slope / steep
        self.axes = along, np.stack([-along[1], along[0]])
        self.place_variance = F4(tuning.place_std ** 2) * steep * steep
        self.explain(blur_terms)

    def again(self, blur_terms):
        """Return the Regression of the same samples whose blur has so many terms."""
        other = copy.copy(self)
        other.explain(blur_terms)
        return other

    def explain(self, blur_terms):
        """Fit the colors, and a blur of so many terms if it is asked."""
        blurs = list(self.blur_terms(blur_terms)) if self.blur else []
        self.names, terms, prior = zip(*blurs, *self.colors)
        self.prior = np.array(prior)
        self.solve(np.stack(terms))

    def blur_terms(self, count):
        """Yield names, terms of shape (2, N) and standard deviations of the prior."""
        bends, prior = self.samples.bends, self.tuning.blur_prior
        for axis in range(2):
            for k, factor in enumerate(polynomial(self.x, self.y, count)):
                yield ('blur', axis, k), 0.5 * bends[axis] * factor, prior
        yield ('blur', 2, 0), bends[2], prior

    def color_terms(self):
        """Yield the same of gains, gamma and matrix."""
        color, tuning = self.samples.color, self.tuning
        for gauge in range(2):
            for k, factor in enumerate(polynomial(self.x, self.y, QUADRATIC)):
                yield ('gain', gauge, k), self.gauged[gauge] * factor, tuning.gain_prior
        yield ('gamma', 0, 0), regained(self.share, np.log(self.share)), tuning.gamma_prior
        nothing = np.zeros_like(color[0])
        for row in range(2):
            for column in range(2):
                pair = [nothing, nothing]
                pair[row] = color[column]
                yield ('matrix', row, column), np.stack(pair), tuning.gain_prior

    def solve(self, terms):
        """Fit by robust least squares; write beta, std, explained and what `bands` needs."""
        along, across = self.axes
        error = self.samples.error
        count = error.shape[1]
        parts = np.concatenate([terms[:, 0] * along[0] + terms[:, 1] * along[1],
                                terms[:, 0] * across[0] + terms[:, 1] * across[1]], axis=1)
        self.error = np.concatenate([error[0] * along[0] + error[1] * along[1],
                                     error[0] * across[0] + error[1] * across[1]])
        rest = self.error
        for _ in range(self.turns):
            scale = max(F4(np.median(np.abs(rest[count:]))) * F4(self.tuning.robust_std),
                        F4(self.tuning.least_scale))
            inverse = np.concatenate([1 / (scale * scale + self.place_variance),
                                      np.full(count, 1 / (scale * scale), F4)])
            chi = rest * rest * inverse
            robust = 1 / (1 + (chi[:count] + chi[count:]) * F4(1 / self.tuning.robust))
            weight = np.concatenate([robust, robust]) * inverse
            weighted = parts * weight
            normal = np.einsum('ik,jk->ij', weighted, parts).astype(np.float64)
            normal[np.diag_indices_from(normal)] += self.prior ** -2
            covariance = np.linalg.inv(normal)
            self.beta = covariance @ np.einsum('ik,k->i', weighted, self.error)
            rest = self.error - np.einsum('i,ik->k', self.beta.astype(F4), parts)
        self.rest, self.weight = rest, weight
        self.std = np.sqrt(np.diag(covariance))
        left = error + self.samples.color
        spread = np.abs(left - left.mean(axis=1, keepdims=True)).mean()
        noise = np.median(np.abs(rest[count:])) * F4(self.tuning.robust_std)
        self.explained = 1 - noise / max(spread, F4(self.tuning.least_scale))

    def value(self, name, first, terms):
        """Return the coefficients of a name, zeros where it was not asked."""
        found = dict(zip(self.names, self.beta))
        return np.array([found.get((name, first, k), 0.0) for k in range(terms)], F4)

    def certain(self, name, first=0):
        """
        Return the largest ratio of a coefficient of a name to its standard deviation.

        first: the terms of a polynomial before that do not count.

        """
        return max((abs(value) / std for (each, _, term), value, std in zip(
            self.names, self.beta, self.std) if each == name and term >= first), default=0.0)

    def bands(self, raw_rows, bin_size, bins):
        """
        Return the log gains of raw rows of both cameras that explain what is left.

        Parameters
        ----------
        raw_rows : (numpy.ndarray, numpy.ndarray)
            Of the samples in the raw images of left and right.
        bin_size : int
            Raw rows per bin.
        bins : (int, int)
            Number of bins of left and right.

        Returns
        -------
        gains : tuple of two numpy.ndarray, float32, shape (bins, 3)

        """
        along, across = self.axes
        parts = [np.concatenate([(each * along).sum(axis=0), (each * across).sum(axis=0)])
                 for each in self.gauged]
        places = [np.concatenate([rows // bin_size] * 2).astype(np.int32) for rows in raw_rows]
        gains = [np.zeros((count, 2)) for count in bins]
        rest = self.rest.astype(np.float64)
        for turn in range(2 * self.tuning.band_turns):
            side = 1 - turn % 2
            at, count = places[side], bins[side]
            own = rest + sum(part * gains[side][at, k] for k, part in enumerate(parts))
            gains[side] = self.band_gains(parts, own, at, count)
            rest = own - sum(part * gains[side][at, k] for k, part in enumerate(parts))
        return tuple((each @ GAUGES).astype(F4) for each in gains)

    def band_gains(self, parts, own, at, count):
        """Return the gains of the gauges of each bin, (count, 2), by least squares."""
        def sums(values):
            found = np.bincount(at, self.weight * values, count)
            taps = cv2.getGaussianKernel(self.tuning.band_taps, self.tuning.band_smoothing)
            return np.convolve(found, taps.ravel(), mode='same')

        prior = self.tuning.gain_prior ** -2
        n00, n11 = (sums(part * part) + prior for part in parts)
        n01 = sums(parts[0] * parts[1])
        t0, t1 = (sums(part * own) for part in parts)
        determinant = n00 * n11 - n01 * n01
        return np.stack([(n11 * t0 - n01 * t1) / determinant,
                         (n00 * t1 - n01 * t0) / determinant], axis=1)

    def row_spread(self):
        """
        Return how much the gains differ from row to row, as standard deviation beyond noise.

        Returns
        -------
        spread, ratio : float
            Log gain; and the variance over that of noise.

        """
        along, across = self.axes
        _, row = np.unique(self.samples.rows, return_inverse=True)
        row = np.concatenate([row, row])
        squares, sums, count = 0.0, 0.0, 0
        for each in self.gauged:
            part = np.concatenate([(each * along).sum(axis=0), (each * across).sum(axis=0)])
            weight = np.bincount(row, self.weight * part * part)
            gain = (np.bincount(row, self.weight * part * self.rest)
                    / np.maximum(weight, self.tuning.least_row_weight))
            sure = weight > self.tuning.least_row_weight
            squares += (gain[sure] ** 2 * weight[sure]).sum()
            sums += (gain[sure] ** 2 - 1 / weight[sure]).sum()
            count += sure.sum()
        count = max(count, 1)
        return np.sqrt(max(sums / count, 0.0)), squares / count
