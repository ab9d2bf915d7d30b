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
"""Superposed waves of random direction and color (paper, sec. 2.1)."""

import numpy as np

from .blocks import PIECE, RowColors, slices
from .pattern import Pattern, Repeats

WAVES = 96       # superposed, chosen: their sum looks random in every direction
WAVE_SPAN = 4.0  # longest over shortest wave, chosen: two octaves
WAVE_CLIP = 2.0  # standard deviations from middle to full intensity, chosen: 5 % are clipped
ROWS = 64        # of a product of matrices that is worth its call
KEPT = 64 * PIECE  # numbers of a field that is kept; a larger one is made anew for each pass


def make(settings):
    """
    Return superposed two-dimensional waves of random direction and color, a `RowColors`.

    Half waves are feature_size to WAVE_SPAN times as long.

    """
    rng = np.random.default_rng(settings.seed)
    half_waves = settings.feature_size * WAVE_SPAN ** rng.random(WAVES)
    direction, start = 2.0 * np.pi * rng.random((2, WAVES))
    wave_numbers = np.pi / half_waves
    along_x = np.exp(1j * np.outer(np.arange(settings.width), wave_numbers * np.cos(direction)))
    along_y = np.exp(1j * np.outer(np.arange(settings.height), wave_numbers * np.sin(direction)))
    strengths = rng.standard_normal((3, WAVES)) * np.exp(1j * start)

    def field(rows):
        # cos(u x + v y + start) = Re[exp(i v y) exp(i start) exp(i u x)]: a product of matrices.
        return np.stack([((along_y[rows] * strength) @ along_x.T).real for strength in strengths],
                        axis=-1)

    size = 3 * settings.width
    if settings.height * size <= KEPT:
        field = field(slice(None)).__getitem__
    scale = WAVE_CLIP * _deviation(field, settings.height, settings.width)
    return RowColors(lambda rows: np.clip(0.5 + 0.5 * field(rows) / scale, 0.0, 1.0), ROWS)


def _deviation(field, height, width):
    """Return the standard deviation of each color over all pixels, (3,), as numpy.std adds it."""
    count = height * width

    def total(function):
        found = None
        for rows in slices(height, 3 * width, ROWS):
            values = function(field(rows)).reshape(-1, 3)
            # NumPy adds pixel by pixel along the first axis: go on from the sum so far
            found = np.add.reduce(values if found is None else np.vstack([found, values]), axis=0)
        return found

    mean = total(lambda values: values) / count
    return np.sqrt(total(lambda values: (values - mean) ** 2) / count)


PATTERN = Pattern('2-D random color waves', make, Repeats.NEVER)
