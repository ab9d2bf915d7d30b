# SPDX-License-Identifier: Apache-2.0
"""The correspondence search of the paper (sec. 2.2 and 3), exhaustive over the disparities."""

import numba
import numpy as np

from . import _kernels
from .color import ColorCorrection
from .triangulation import search_interval
from .types import Match, Status


class PaperMatcher:
    """
    Finds for each left pixel the right pixel of the same row whose window has the least Q.

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
        self._correction = ColorCorrection(settings.color)
        first, last = search_interval(limits)
        self._first = first - 1  # one more at each end tells a minimum from a limit
        self._count = last - first + 3
        self._buffers = _Buffers(geometry, self._count, settings.matching)

    def match(self, pair):
        """
        Match one pair.

        Parameters
        ----------
        pair : RectifiedPair

        Returns
        -------
        match : Match

        """
        (left, left_reason), (right, _) = self._correction.correct(pair)
        winner, costs = self._search(left, right)
        return self._judged(winner, costs, left_reason, right)

    def _search(self, left, right):
        """Return winners and costs of the search between the global limits."""
        buffers = self._buffers
        _kernels.search(
            left, right, self._first, self._settings.window_width // 2,
            self._settings.window_height // 2, buffers.low, buffers.high, buffers.ring,
            buffers.sums, buffers.total, buffers.ratios, buffers.right_cost, buffers.right_index,
            buffers.winner, buffers.costs)
        return buffers.winner, buffers.costs

    def _judged(self, winner, costs, reason, right):
        """Return the Match: sub-pixel disparities where the winner passes every test."""
        index = winner[..., 0]
        before, best, after, second = (costs[..., i].astype(np.float32) for i in range(4))
        height, width = index.shape
        columns = np.arange(width) - index - self._first
        hits = (columns >= 0) & (columns < width)
        usable = np.take_along_axis(right[..., 3], np.clip(columns, 0, width - 1), 1) > 0
        status = reason.copy()

        def refuse(where, code):
            status[(status == Status.VALID) & where] = code

        refuse(~(hits & usable), Status.NO_MATCH)
        refuse((index == 0) | (index == self._count - 1), Status.OUT_OF_RANGE)
        tolerance = self._settings.left_right_tolerance
        if tolerance > 0:
            refuse(np.abs(winner[..., 1] - index) > tolerance, Status.INCONSISTENT)
        refuse(second < best * (1 + self._settings.uniqueness_ratio), Status.AMBIGUOUS)
        bend = before - 2 * best + after
        refuse(bend <= 0, Status.AMBIGUOUS)
        with np.errstate(all='ignore'):
            shift = 0.5 * (before - after) / bend
            pixels = self._settings.window_width * self._settings.window_height
            std = np.sqrt(best / (pixels * 0.5 * bend) * 12)
        valid = status == Status.VALID
        nan = np.float32(np.nan)
        disparity = np.where(valid, (index + self._first + shift).astype(np.float32), nan)
        std = np.where(valid, std.astype(np.float32), nan)
        confidence = np.where(valid, np.exp(-std), 0).astype(np.float32)
        return Match(disparity, std, confidence, status)


class _Buffers:
    """Memory of the search, one set per band of rows."""

    def __init__(self, geometry, count, settings):
        bands = numba.get_num_threads()
        height, width = geometry.height, geometry.width
        self.ring = np.zeros((bands, settings.window_height, width, count), np.uint16)
        self.sums = np.zeros((bands, width, count), np.int32)
        self.total = np.zeros((bands, count), np.int32)
        self.ratios = np.zeros((bands, 2, 3, width + count - 1), np.float32)
        self.right_cost = np.zeros((bands, width + count - 1), np.int32)
        self.right_index = np.zeros((bands, width + count - 1), np.int32)
        self.winner = np.zeros((height, width, 2), np.int32)
        self.costs = np.zeros((height, width, 4), np.int32)
        self.low = np.zeros((height, width), np.int32)
        self.high = np.full((height, width), count, np.int32)
