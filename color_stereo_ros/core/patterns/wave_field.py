# SPDX-License-Identifier: Apache-2.0
"""Superposed waves of random direction and color (paper, sec. 2.1)."""

import numpy as np

from .pattern import Pattern, Repeats

WAVES = 96       # superposed, chosen: their sum looks random in every direction
WAVE_SPAN = 4.0  # longest over shortest wave, chosen: two octaves
WAVE_CLIP = 2.0  # standard deviations from middle to full intensity, chosen: 5 % are clipped


def make(settings):
    """
    Return superposed two-dimensional waves of random direction and color, (height, width, 3).

    Half waves are feature_size to WAVE_SPAN times as long.

    """
    rng = np.random.default_rng(settings.seed)
    half_waves = settings.feature_size * WAVE_SPAN ** rng.random(WAVES)
    direction, start = 2.0 * np.pi * rng.random((2, WAVES))
    wave_numbers = np.pi / half_waves
    along_x = np.exp(1j * np.outer(np.arange(settings.width), wave_numbers * np.cos(direction)))
    along_y = np.exp(1j * np.outer(np.arange(settings.height), wave_numbers * np.sin(direction)))
    strengths = rng.standard_normal((3, WAVES)) * np.exp(1j * start)
    # cos(u x + v y + start) = Re[exp(i v y) exp(i start) exp(i u x)]: a product of matrices.
    field = np.stack([((along_y * strength) @ along_x.T).real for strength in strengths], axis=-1)
    deviation = field.std(axis=(0, 1))
    return np.clip(0.5 + 0.5 * field / (WAVE_CLIP * deviation), 0.0, 1.0)


PATTERN = Pattern('2-D random color waves', make, Repeats.NEVER)
