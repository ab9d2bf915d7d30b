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
Several results of a scene that stands still, fused to one by their variances.

The disparity of a pixel is the mean of those that agree, weighted by 1 / variance. What differs
from pair to pair averages out, what all pairs share does not: the variance of one pair is divided
accordingly. Only the sums are kept, so the memory does not grow with the number of pairs.

"""

import cv2
import numpy as np

from .results import RangeResult
from .status import Status
from .status_codes import VALID
from .triangulation import depth_from_disparity
from ..errors import ImageError

_AGREE = np.float32(1.0)
"""px by which values of a pixel may differ: a range is right within 1 px."""
_AGREE_STD = np.float32(4.0)
"""Or so many standard deviations of one pair."""
_NOISE_MOST = 0.9
"""
Share of the variance of one pair that averages out at most.

Errors that all pairs share do not show in their differences. On planes, where the noise alone
explains the variance, they raise z68 of 8 pairs from 1.1 to 1.4 without this limit.
"""
_MOVED = np.float32(6.0)
"""Variance between the pairs over that of one pair from which a pixel may have moved."""
_OTHERS = 0.25
"""So do this share of the pairs that give another value alike."""
_SPAN = 7
"""px; side of the window in which most pixels must have moved: noise has no such neighbors."""
_MOST = np.float32(0.5)
_NOTED = 0.005
"""Share of the pixels with a range from which a motion is reported."""


class _Cluster:
    """Values of every pixel that agree with each other: weighted sums."""

    def __init__(self, shape):
        self.count = np.zeros(shape, np.float32)
        self.weight = np.zeros(shape, np.float32)
        self.mean = np.zeros(shape, np.float32)
        self.scatter = np.zeros(shape, np.float32)
        self.confidence = np.zeros(shape, np.float32)

    def agrees(self, disparity, reach):
        """Tell where a value is close to the mean, bool (H, W)."""
        return (self.count > 0) & (np.abs(disparity - self.mean) <= reach)

    def add(self, where, disparity, weight, confidence):
        """Update the sums where told (West 1979)."""
        weight = np.where(where, weight, np.float32(0))
        deviation = np.where(where, disparity - self.mean, np.float32(0))
        self.weight += weight
        self.mean += deviation * weight / np.maximum(self.weight, np.finfo(np.float32).tiny)
        self.scatter += weight * deviation * np.where(where, disparity - self.mean, np.float32(0))
        self.count += where
        self.confidence += np.where(where, confidence, np.float32(0))


class Fusion:
    """
    Fuses the results of a scene that stands still.

    A pixel keeps its range where at least half of the pairs give values that agree. A pixel that
    moved between the pairs gets `Status.MOVED`.

    """

    def __init__(self):
        self.pairs = 0
        """Results that were added."""
        self._first = None

    def add(self, result):
        """
        Add a result.

        Parameters
        ----------
        result : RangeResult
            Of the pair.

        Raises
        ------
        ImageError
            If it belongs to another calibration than the first one.

        """
        if self._first is None:
            self._begin(result)
        elif result.geometry != self._first.geometry:
            raise ImageError('the calibration has changed between the pairs of one capture')
        known = np.isfinite(result.disparity)
        disparity = np.where(known, result.disparity, np.float32(0))
        std = np.where(np.isfinite(result.disparity_std) & known, result.disparity_std,
                       np.float32(0))
        self._has_std &= ~known | (std > 0)
        weight = 1 / np.where(std > 0, std * std, np.float32(1))
        self._note_change(known, disparity, weight)
        reach = np.maximum(_AGREE, _AGREE_STD * std)
        one, two = self._clusters
        first = known & ((one.count == 0) | one.agrees(disparity, reach))
        second = known & ~first & ((two.count == 0) | two.agrees(disparity, reach))
        for cluster, where in zip(self._clusters, (first, second)):
            cluster.add(where, disparity, weight, result.confidence)
        self._known += known
        self._latest = result
        self._status = np.where(known, self._status, result.status)
        self._views |= result.views
        self.pairs += 1

    def _begin(self, result):
        shape = result.disparity.shape
        self._first = result
        self._clusters = _Cluster(shape), _Cluster(shape)
        self._known = np.zeros(shape, np.float32)
        self._has_std = np.ones(shape, bool)
        self._status = result.status
        self._views = np.zeros(shape, np.uint8)
        self._before = np.full(shape, np.nan, np.float32)
        self._change = np.zeros(shape, np.float32)
        self._changes = np.zeros(shape, np.float32)

    def _note_change(self, known, disparity, weight):
        """Sum up how much a value differs from the one before it (von Neumann 1941)."""
        change = np.where(known, disparity - self._before, np.float32(np.nan))
        counts = np.isfinite(change)
        self._change += np.where(counts, weight * change * change / 2, np.float32(0))
        self._changes += counts
        self._before = np.where(known, disparity, self._before)

    def result(self):
        """
        Return what the pairs give together.

        Returns
        -------
        result : RangeResult
            `disparity_std` counts what the pairs share in full, and their noise by their number.
            `confidence` is the mean over all pairs, 0 where one has no range. The image, rows,
            projector and durations are those of the last pair.

        Raises
        ------
        ImageError
            If there is no pair.

        """
        if self._first is None:
            raise ImageError('no pair was added')
        chosen = self._chosen()
        moved = self._moved(chosen)
        valid = (2 * chosen.count >= self.pairs) & ~moved
        disparity = np.where(valid, chosen.mean, np.float32(np.nan))
        status = np.where(valid, np.uint8(Status.VALID), self._status_without(moved))
        return RangeResult(**{
            **_fields(self._latest), 'disparity': disparity,
            'depth': depth_from_disparity(disparity, self._first.geometry),
            'disparity_std': self._std(chosen, valid),
            'confidence': np.where(valid, chosen.confidence / np.float32(self.pairs),
                                   np.float32(0)),
            'status': status.astype(np.uint8),
            'views': np.where(valid, self._views, np.uint8(0))})

    def _chosen(self):
        """Return of every pixel the cluster with the more values, a _Cluster."""
        one, two = self._clusters
        second = two.count > one.count
        chosen = _Cluster(second.shape)
        for name in vars(chosen):
            setattr(chosen, name, np.where(second, getattr(two, name), getattr(one, name)))
        return chosen

    def _others(self):
        """Return of every pixel how many values agree with each other, but not with the chosen."""
        one, two = self._clusters
        return np.minimum(one.count, two.count)

    def _status_without(self, moved):
        """Return why the pixels without a range have none."""
        status = np.where(self._status == VALID, np.uint8(Status.INCONSISTENT),
                          self._status)
        return np.where(moved, np.uint8(Status.MOVED), status)

    @property
    def noise_share(self):
        """
        Return which share of the variance of one pair is noise that differs between the pairs.

        From the changes between pairs, over the whole image; at most 0.9.

        """
        counted = self._changes > 0
        if not counted.any():
            return _NOISE_MOST
        freedom = self._changes[counted]
        ratio = self._change[counted] / freedom
        # the median of chi-squared over its n degrees of freedom (Wilson and Hilferty 1931)
        return float(min(np.median(ratio / (1 - 2 / (9 * freedom)) ** 3), _NOISE_MOST))

    def _std(self, chosen, valid):
        count = np.maximum(chosen.count, 1)
        one_pair = count / np.maximum(chosen.weight, np.finfo(np.float32).tiny)
        noise = np.float32(self.noise_share)
        std = np.sqrt(one_pair * (1 - noise + noise / count))
        return np.where(valid & self._has_std, std, np.float32(np.nan))

    def _moved(self, chosen):
        """Return where most pixels around have other values than before, bool (H, W)."""
        often = 2 * self._known >= self.pairs
        other = (self._others() >= _OTHERS * self.pairs) | (2 * chosen.count < self.pairs)
        # scatter is a sum of squares over variances: chi-squared of count - 1 degrees of freedom
        vary = chosen.scatter > _MOVED * np.maximum(chosen.count - 1, 1)
        suspect = often & (other | vary)
        around, all_around = (cv2.blur(mask.astype(np.float32), (_SPAN, _SPAN))
                              for mask in (suspect, often))
        return often & (around > _MOST * all_around)

    @property
    def moved_share(self):
        """Return the share of the pixels that most pairs measured which moved, 0..1."""
        often = np.count_nonzero(2 * self._known >= self.pairs)
        return np.count_nonzero(self._moved(self._chosen())) / max(often, 1)

    def about_motion(self):
        """Say how much of the scene moved; empty if nothing did."""
        share = self.moved_share
        if share < _NOTED:
            return ''
        return (f'; the scene moved meanwhile: {share:.1%} of the ranges are left out '
                '(status MOVED)')


def _fields(result):
    """Return the fields of a RangeResult by name; what it caches is left out."""
    return {name: value for name, value in vars(result).items()
            if name in RangeResult.__dataclass_fields__}
