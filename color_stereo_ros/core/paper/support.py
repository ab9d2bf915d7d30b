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
"""Whether matches are those of a surface or of chance: neighboring windows tell."""

import math

import cv2
import numpy as np

from . import support_kernels
from .tuning import TUNING


class Support:
    """
    Compares matches with those of neighboring windows.

    Windows without a common pixel find their matches independently. On a surface their
    disparities lie on a line; matches by chance agree no more often than random numbers.

    Parameters
    ----------
    shape : (int, int)
        Height and width of the images.
    settings : Settings

    """

    def __init__(self, shape, settings):
        """Allocate the counts."""
        self._step = window_step(settings)
        self._counts = np.zeros((3, *shape), np.int32)
        self._around = np.zeros((3, *shape), np.int32)

    def judge(self, match, right, first, low, high):
        """
        Refuse matches by chance and write the confidence of the others.

        Parameters
        ----------
        match : Match
            Changed.
        right : numpy.ndarray, float32, shape (H, W, 4)
            Corrected colors of the right image.
        first : int
            Disparity of index 0.
        low, high : numpy.ndarray, int32, shape (H, W)
            First index that was searched, and the one after the last.

        """
        step_x, step_y = self._step
        agreeing, known, expected = self._counts
        support_kernels.count_agreements(match.disparity, right, first, low, high, step_x, step_y,
                                         agreeing, known, expected)
        size = tuple(TUNING.support.surroundings * step for step in self._step)
        for counts, around in zip(self._counts, self._around):
            cv2.boxFilter(counts, -1, size, dst=around, normalize=False,
                          borderType=cv2.BORDER_CONSTANT)
        support_kernels.judge(agreeing, known, *self._around, step_x * step_y,
                              match.disparity, match.disparity_std, match.confidence,
                              match.status)


def window_step(settings):
    """
    Return how far apart windows are that have no noise in common, columns and rows, px.

    Smoothing and demosaicing spread the noise of a pixel over its neighbors.

    """
    deviation = math.hypot(settings.color.smoothing, TUNING.search.mosaic_blur)
    margin = round(TUNING.support.blur_reach * deviation)
    return settings.matching.window_width + margin, settings.matching.window_height + margin
