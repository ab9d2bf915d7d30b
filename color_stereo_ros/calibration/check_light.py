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
"""What the images themselves say: exposure, balance and contrast of the colors, sharpness."""

from dataclasses import dataclass

import numpy as np

from ..core.account import exposure_of
from ..core.patterns.feature_size import feature_size_in

LIT = 24  # DN of the brightest channel; chosen: above the noise of a dark image
GRID = 3  # fields along each direction
LEAST_LIT = 0.3  # of a field; chosen


@dataclass(frozen=True, eq=False)
class Light:
    """Figures of one pair."""

    exposure: object
    """Of `core.account`."""
    gains: np.ndarray
    """float64 (3,): R, G, B of the left image over those of the right, in the mean."""
    balance: np.ndarray
    """float64 (2, 3): R, G, B of left and right over their mean."""
    contrast: np.ndarray
    """float64 (2, 3): (bright - dark) / (bright + dark) of each channel, 0..1."""
    feature_px: float
    """Size of the smallest structures of the pattern, px; NaN where it has none."""
    sharpness: np.ndarray
    """float64 (3, 3): contrast of the colors in fields of the left image, 1 = the best field."""


def light_of(left, right, rectified, settings):
    """
    Return the Light of a pair.

    Parameters
    ----------
    left, right, rectified : numpy.ndarray, uint8, shape (H, W, 3)
        Raw images and the rectified left one, RGB.
    settings : Settings
        Of the core.

    """
    lit = [image[image.max(axis=2) > LIT].astype(np.float64) for image in (left, right)]
    if not all(len(each) for each in lit):
        nothing = np.full(3, np.nan)
        return Light(exposure_of(left, right, settings.color.saturation_level), nothing,
                     np.tile(nothing, (2, 1)), np.tile(nothing, (2, 1)), float('nan'),
                     np.full((GRID, GRID), np.nan))
    means = np.array([each.mean(axis=0) for each in lit])
    dark, bright = np.array([np.percentile(each, (5, 95), axis=0) for each in lit]).transpose(
        1, 0, 2)
    feature = feature_size_in(rectified, settings.pattern)
    return Light(exposure_of(left, right, settings.color.saturation_level), means[0] / means[1],
                 means / means.mean(axis=1, keepdims=True),
                 (bright - dark) / np.maximum(bright + dark, 1),
                 float('nan') if feature is None else feature, _sharpness(rectified))


def _sharpness(image):
    """Return the steepness of the colors in the fields of an image, as a share of the best."""
    light = image.astype(np.float32)
    total = light.sum(axis=2, keepdims=True)
    colors = light / np.maximum(total, 1)
    steep = (np.abs(np.diff(colors, axis=1))[:-1].sum(axis=2)
             + np.abs(np.diff(colors, axis=0))[:, :-1].sum(axis=2))
    lit = image.max(axis=2)[:-1, :-1] > LIT
    found = np.full((GRID, GRID), np.nan)
    for row, column in np.ndindex(GRID, GRID):
        field, bright = (np.array_split(np.array_split(part, GRID)[row], GRID, axis=1)[column]
                         for part in (steep, lit))
        if bright.mean() > LEAST_LIT:
            found[row, column] = np.mean(field[bright])
    best = np.nanmax(found, initial=0)
    return found / best if best > 0 else np.full_like(found, np.nan)
