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
"""Pairs of images that come while a projector shows one frame after the other."""

import json

import numpy as np

from .color import FRAMES

SETTLE = 0.5  # s; chosen: projectors are late by up to 100 ms, cameras by some frames
COUNT = 4     # pairs of a frame; chosen: halves their noise


class FrameStream:
    """
    Sorts pairs by the frame that pattern_node says it shows.

    Parameters
    ----------
    settle : float
        So long after a change pairs belong to no frame, s.
    count : int
        Pairs of a frame that are averaged; more are left out.

    """

    def __init__(self, settle=SETTLE, count=COUNT):
        self.settle, self.count = settle, count
        self._shown = None, 0.0
        self._sums = {}

    def shown(self, text, at):
        """Take the JSON text of pattern/info, said at a time in s; other texts end a frame."""
        try:
            name = json.loads(text)['frame']
        except (ValueError, KeyError, TypeError):
            name = None
        self._shown = name, at

    def take(self, left, right, at):
        """
        Take a pair of RGB images, uint8 (H, W, 3), at a time in s; return whether it counts.

        Pairs of another size than the first one of their frame do not count.

        """
        name, since = self._shown
        if name not in FRAMES or at < since + self.settle or self.has(name):
            return False
        number, sums = self._sums.get(name, (0, None))
        pair = [np.asarray(image, np.float64) for image in (left, right)]
        if sums is None:
            sums = [np.zeros_like(image) for image in pair]
        if any(image.shape != total.shape for image, total in zip(pair, sums)):
            return False
        for image, total in zip(pair, sums):
            total += image
        self._sums[name] = number + 1, sums
        return True

    def has(self, name):
        """Return whether a frame has all its pairs."""
        return self._sums.get(name, (0, None))[0] >= self.count

    @property
    def missing(self):
        """Return the frames without any pair, a list of names."""
        return [name for name in FRAMES if name not in self._sums]

    def images(self):
        """
        Return the mean images of the frames.

        Returns
        -------
        left, right : dict
            Names of frames to float64 (H, W, 3), RGB, DN.

        """
        return tuple({name: sums[side] / number for name, (number, sums) in self._sums.items()}
                     for side in (0, 1))
