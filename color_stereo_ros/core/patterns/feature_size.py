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
"""How large the smallest structures of a pattern are in an image."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from .making import make_pattern
from ..settings import PatternSettings

FIELDS = 'hue_field', 'wave_field', 'pseudo_noise'
"""Types whose structures have the size `pattern.feature_size` in both directions."""
PATCHES = 'pseudo_noise',
"""Those of even patches: their autocorrelation is a triangle, and blur does not move its half."""
REFERENCE = PatternSettings(width=512, height=512, feature_size=8.0)
LAGS = 32  # px; chosen: structures above 60 px are large enough
STEP = 8  # px; chosen: 60 rows and 80 columns of 640 x 480 px
LEAST_LIGHT = 48  # DN; chosen: as `trust.full_brightness`
LEAST_PIXELS = 2000  # chosen: some tens of structures
LEAST_VARIANCE = 0.01  # chosen: the chromaticity of a gray object has less
# px^2; derived: linear demosaicing 1/2, a pixel 1/12, bilinear rectification 1/6
BLUR = 0.75
HALF = 2 * np.log(2.0)  # a Gaussian falls to a half at the root of (HALF variance)


def feature_size_in(image, settings):
    """
    Return the size of the smallest structures of the pattern in an image, px.

    The distance at which the autocorrelation of the colors falls to a half is compared with that
    in the pattern itself.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.
    settings : PatternSettings
        Of the pattern that is projected.

    Returns
    -------
    size : float or None
        None where the type has no such structures or too little is seen.

    """
    if settings.type not in FIELDS:
        return None
    length = half_length(image)
    if length is None:
        return None
    if settings.type not in PATCHES:
        # a camera widens the autocorrelation by twice the variance of its blur
        length = np.sqrt(max(length ** 2 - 2 * BLUR * HALF, 0.0))
    return float(length * REFERENCE.feature_size / reference_length(settings.type))


@lru_cache
def reference_length(kind):
    """Return the half length of a pattern of the reference, px."""
    return half_length(make_pattern(replace(REFERENCE, type=kind)))


def half_length(image):
    """
    Return where the autocorrelation of the chromaticity of an image is a half, px, or None.

    image: uint8 (H, W, 3). Rows and columns count alike.

    """
    sums = np.zeros((2, LAGS + 1))
    for lines in (image[STEP // 2::STEP], image[:, STEP // 2::STEP].swapaxes(0, 1)):
        sums += lag_sums(lines)
    products, counts = sums
    if counts[0] < LEAST_PIXELS or products[0] < LEAST_VARIANCE * counts[0]:
        return None
    correlation = products / np.maximum(counts, 1) * counts[0] / products[0]
    below = np.flatnonzero(correlation < 0.5)
    if below.size == 0:
        return None
    high, low = correlation[below[0] - 1:below[0] + 1]
    return below[0] - 1 + (high - 0.5) / (high - low)


def channel_sum(image):
    """Return the sum of the channels of an image, (H, W); faster than to reduce an axis of 3."""
    return image[..., 0] + image[..., 1] + image[..., 2]


def lag_sums(lines):
    """Return sums and counts of products of chromaticities at all lags, (2, LAGS + 1)."""
    light = lines.astype(np.float32)
    total = channel_sum(light)
    lit = total >= LEAST_LIGHT
    if not lit.any():
        return np.zeros((2, LAGS + 1))
    color = light / np.maximum(total, 1)[..., None]
    color -= color[lit].mean(axis=0)
    color[~lit] = 0
    sums = np.zeros((2, LAGS + 1))
    for lag in range(min(LAGS + 1, lines.shape[1])):
        end = lines.shape[1] - lag
        sums[0, lag] = np.einsum('yxc,yxc->', color[:, :end], color[:, lag:])
        sums[1, lag] = np.count_nonzero(lit[:, :end] & lit[:, lag:])
    return sums
