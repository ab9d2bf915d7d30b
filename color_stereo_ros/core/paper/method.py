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
"""The correspondence search of the paper (sec. 2.2 and 3), exhaustive over the disparities."""

from dataclasses import dataclass
import math

import cv2
import numpy as np

from . import kernels
from .color import ColorCorrection
from .support import Support
from .tuning import TUNING
from ..results import Measurement
from ..triangulation import depth_from_disparity, search_interval

SUBPIXEL_CODES = {'none': 0, 'parabola': 1, 'weighted': 2}
TILE = TUNING.search.tile


class PaperMethod:
    """The paper's steps: rectify, correct and search, triangulate."""

    def __init__(self, settings, calibration, limits, rectifier):
        """Allocate the search."""
        self._rectifier = rectifier
        self._matcher = PaperMatcher(settings, calibration.geometry, limits)

    def measure(self, left, right, clock):
        """Measure one pair; see `Method.make`."""
        pair = self._rectifier.rectify(left, right)
        clock.lap('rectify')
        match = self._matcher.match(pair)
        clock.lap('match')
        depth = depth_from_disparity(match.disparity, pair.geometry)
        clock.lap('triangulate')
        return Measurement(**vars(match), depth=depth)


@dataclass(frozen=True, eq=False)
class Match:
    """What a matching method finds for one rectified pair, in pixels of the left image."""

    disparity: np.ndarray
    """float32 (H, W), x_left - x_right in px, NaN = unknown."""
    disparity_std: np.ndarray
    """float32 (H, W), standard deviation of the disparity in px, NaN = unknown."""
    confidence: np.ndarray
    """float32 (H, W), 0..1: the probability of being right within 1 px; 0 = unknown."""
    status: np.ndarray
    """uint8 (H, W), a `Status` code; 0 exactly where the disparity is finite."""


class PaperMatcher:
    """
    Finds for each left pixel the right pixel of the same row whose window has the least Q.

    Q is the sum of the color differences of two windows (paper, sec. 2.2). Images are rectified,
    uint8 (H, W, 3); the match has their H x W, disparities in px.

    Parameters
    ----------
    settings : Settings
    geometry : RectifiedGeometry
    limits : (float, float)
        Smallest and largest disparity, px.

    """

    def __init__(self, settings, geometry, limits):
        """Allocate the buffers of the search."""
        self._settings = settings.matching
        self._limits = tuple(np.float32(limits))
        self._correction = ColorCorrection(settings.color)
        first, last = np.clip(search_interval(limits), 1 - geometry.width, geometry.width - 1)
        self._first = int(first) - 1  # one more at each end distinguishes a minimum from a limit
        self._count = int(last - first) + 3
        self._independent = independent_pixels(settings)
        self._buffers = _Buffers(geometry, self._count, settings.matching)
        self._support = Support((geometry.height, geometry.width), settings)

    def match(self, pair):
        """
        Match one pair.

        Parameters
        ----------
        pair : RectifiedPair
            The rectified images.

        Returns
        -------
        match : Match

        """
        (left, reason), (right, _) = self._correction.correct(pair)  # sec. 2.2, correction
        buffers = self._buffers
        match = self._searched(left, right, reason, buffers.low, buffers.high)  # sec. 2.2, search
        if self._settings.local_limit > 0:
            low, high = self._local_limits(match.disparity)
            match = self._searched(left, right, reason, low, high)
        return match

    def _local_limits(self, disparity):
        """Return limits around the median disparity of the surroundings (paper, sec. 2.2)."""
        center = surrounding_median(disparity) - self._first
        reach = self._settings.local_limit
        low, high = self._buffers.low.copy(), self._buffers.high.copy()
        known = np.isfinite(center)
        low[known] = np.clip(np.floor(center[known] - reach), 0, self._count - 3)
        high[known] = np.clip(np.ceil(center[known] + reach) + 1, 3, self._count)
        return low, high

    def _searched(self, left, right, reason, low, high):
        """Return the Match of one search between limits for each pixel."""
        settings, buffers = self._settings, self._buffers
        kernels.search(
            left, right, self._first, self._count, settings.window_width // 2,
            settings.window_height // 2, low, high, buffers.ring, buffers.sums, buffers.total,
            buffers.ratios, buffers.right_cost, buffers.right_index, buffers.winner,
            buffers.costs)
        match = Match(disparity=np.empty(reason.shape, np.float32),
                      disparity_std=np.empty(reason.shape, np.float32),
                      confidence=np.empty(reason.shape, np.float32),
                      status=np.empty(reason.shape, np.uint8))
        kernels.accept_winners(
            buffers.winner, buffers.costs, reason, right, self._first, self._count, low, high,
            settings.left_right_tolerance, settings.uniqueness_ratio,
            SUBPIXEL_CODES[settings.subpixel], self._independent, *self._limits,
            match.disparity, match.disparity_std, match.status)
        self._support.judge(match, right, self._first, low, high)
        return match


def independent_pixels(settings):
    """
    Return how many pixels of a window carry noise of their own.

    Demosaicing and smoothing spread the noise of a pixel over an area of 4 pi sigma^2.

    """
    pixels = settings.matching.window_width * settings.matching.window_height
    area = 4.0 * math.pi * (settings.color.smoothing ** 2 + TUNING.search.mosaic_blur ** 2)
    return max(1.0, pixels / area)


def surrounding_median(disparity):
    """
    Return the median disparity around each pixel: of 3 x 3 tiles of TILE px.

    Parameters
    ----------
    disparity : numpy.ndarray, float32, shape (H, W)
        px, NaN = unknown.

    Returns
    -------
    median : numpy.ndarray, float32, shape (H, W)
        px, NaN where all of the surroundings are unknown.

    """
    height, width = disparity.shape
    rows, columns = -(-height // TILE), -(-width // TILE)
    padded = np.full((rows * TILE, columns * TILE), np.nan, np.float32)
    padded[:height, :width] = disparity
    tiles = padded.reshape(rows, TILE, columns, TILE).swapaxes(1, 2).reshape(rows, columns, -1)
    medians = np.pad(_median(tiles), 1, constant_values=np.nan)
    around = np.stack([medians[y:y + rows, x:x + columns] for y in range(3) for x in range(3)],
                      axis=-1)
    return cv2.resize(_median(around), (columns * TILE, rows * TILE),
                      interpolation=cv2.INTER_NEAREST)[:height, :width]


def _median(values):
    """Return the (lower) median over the last axis, NaN ignored; np.nanmedian is far slower."""
    ordered = np.sort(values, axis=-1)  # NaN last
    known = np.isfinite(values).sum(axis=-1, keepdims=True)
    return np.take_along_axis(ordered, np.maximum(known - 1, 0) // 2, axis=-1)[..., 0]


class _Buffers:
    """
    Memory of the search; D is the number of disparities, P that rounded up to whole vectors.

    Attributes
    ----------
    ring : numpy.ndarray, uint16, shape (bands, window rows, W, P)
        Costs of the rows of the window, in stored units (`search.cost_unit`).
    sums : numpy.ndarray, int32, shape (bands, W, P)
        Their sums over the rows of the window.
    total : numpy.ndarray, int32, shape (bands, P + 2)
        Cost of the window of one pixel, with room for its neighbors.
    ratios : numpy.ndarray, float32, shape (bands, 2, 3, W + P - 1)
        Ratios of the color components of one right row, reversed.
    right_cost, right_index : numpy.ndarray, int32, shape (bands, W + P - 1)
        Least cost of each right pixel of a row, and the index of its disparity; reversed.
    low, high : numpy.ndarray, int32, shape (H, W)
        First disparity of each pixel and the one after the last, 0 .. D.
    winner : numpy.ndarray, int32, shape (H, W, 2)
        Index of the best disparity, and that of the right pixel it leads to; -1 = none.
    costs : numpy.ndarray, int32, shape (H, W, 4)
        Before, at and after the winner, and the best elsewhere, in stored units.

    """

    def __init__(self, geometry, count, settings):
        bands = kernels.band_count()
        padded = -(-count // kernels.LANES) * kernels.LANES
        height, width = geometry.height, geometry.width
        self.ring = np.zeros((bands, settings.window_height, width, padded), np.uint16)
        self.sums = np.zeros((bands, width, padded), np.int32)
        self.total = np.zeros((bands, padded + 2), np.int32)
        self.ratios = np.zeros((bands, 2, 3, width + padded - 1), np.float32)
        self.right_cost = np.zeros((bands, width + padded - 1), np.int32)
        self.right_index = np.zeros((bands, width + padded - 1), np.int32)
        self.low = np.zeros((height, width), np.int32)
        self.high = np.full((height, width), count, np.int32)
        self.winner = np.zeros((height, width, 2), np.int32)
        self.costs = np.zeros((height, width, 4), np.int32)
