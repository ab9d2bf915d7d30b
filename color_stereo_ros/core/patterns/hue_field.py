# SPDX-License-Identifier: Apache-2.0
"""A random field of hues at constant brightness: the default pattern."""

import numpy as np

from ...errors import SettingsError
from .colors import constant_sum_colors
from .pattern import Pattern, Repeats

# Hue units, standard deviation; the circle has 3. Derived: the field wraps around, and all hues
# are equally frequent within 2 exp(-(2 pi 1.6 / 3)^2 / 2) = 0.7 %.
HUE_FIELD_DEVIATION = 1.6
LEAST_DEVIATION = 1e-9  # of the filtered noise; below it rounding is all that is left


def make(settings):
    """Return an aperiodic two-dimensional hue field of uniform brightness, (height, width, 3)."""
    return constant_sum_colors(random_phase(settings))


def random_phase(settings):
    """Return the hue of each pixel, (height, width): white noise behind a Gaussian filter."""
    shape = (settings.height, settings.width)
    noise = np.random.default_rng(settings.seed).standard_normal(shape)
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    # The Fourier transform of a Gaussian of standard deviation s is exp(-2 (pi s f)^2).
    blur = np.exp(-2.0 * (np.pi * settings.feature_size * frequency) ** 2)
    smooth = np.fft.irfft2(np.fft.rfft2(noise) * blur, s=shape)
    smooth -= smooth.mean()
    deviation = smooth.std()
    if deviation < LEAST_DEVIATION:
        raise SettingsError(f'pattern.feature_size = {settings.feature_size} px is too large for '
                            f'a pattern of {settings.width} x {settings.height} px')
    return HUE_FIELD_DEVIATION * smooth / deviation


PATTERN = Pattern('aperiodic 2-D hue, uniform brightness', make, Repeats.NEVER,
                  uniform_brightness=True)
