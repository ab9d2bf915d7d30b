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
"""A random field of hues at constant brightness: the default pattern."""

import math

import numpy as np

from .blocks import Bands, RowColors, slices
from .colors import constant_sum_colors
from .pattern import Pattern, Repeats
from ...errors import SettingsError

# Hue units, standard deviation; the circle has 3. Derived: the field wraps around, and all hues
# are equally frequent within 2 exp(-(2 pi 1.6 / 3)^2 / 2) = 0.7 %.
HUE_FIELD_DEVIATION = 1.6
LEAST_DEVIATION = 1e-9  # of the filtered noise; below it rounding is all that is left
CERTAIN = 0.01  # chosen: of LEAST_DEVIATION; no seed is so far from the expected deviation


def make(settings):
    """Return an aperiodic two-dimensional hue field of uniform brightness, a `RowColors`."""
    smooth, deviation = filtered_noise(settings)
    return RowColors(lambda rows: constant_sum_colors(
        HUE_FIELD_DEVIATION * smooth.rows(rows) / deviation))


def check(settings):
    """Raise SettingsError if nothing but rounding would be left of the noise, for any seed."""
    # Parseval: the expected variance is the mean of the squared filter, its constant left out
    rows, columns = (np.exp(-4.0 * (np.pi * settings.feature_size * np.fft.fftfreq(size)) ** 2)
                     for size in (settings.height, settings.width))
    expected = math.sqrt((rows.sum() * columns[1:].sum() + rows[1:].sum())
                         / (settings.height * settings.width))
    if expected < CERTAIN * LEAST_DEVIATION:
        raise too_smooth(settings)


def too_smooth(settings):
    """Return the error of a pattern whose features are larger than itself."""
    return SettingsError(f'pattern.feature_size = {settings.feature_size} px is too large for a '
                         f'pattern of {settings.width} x {settings.height} px')


def filtered_noise(settings):
    """
    Return white noise behind a Gaussian filter, and its standard deviation.

    This is irfft2(rfft2(noise) blur) minus its mean, step by step in the memory of the spectrum:
    8192 x 8192 px need 0.5 GB instead of 5.

    Parameters
    ----------
    settings : PatternSettings
        Of the pattern that is projected.

    Returns
    -------
    smooth : Bands
        Of mean zero.
    deviation : float

    """
    bands = _spectrum_of_noise(settings)
    _filter(bands, settings)
    _transform_back(bands, settings.width)
    count = settings.height * settings.width
    mean = bands.total(lambda values: values) / count
    bands.subtract(mean)
    # numpy.std subtracts the mean again, which is now almost zero
    mean = bands.total(lambda values: values) / count
    deviation = math.sqrt(bands.total(lambda values: (values - mean) ** 2) / count)
    if deviation < LEAST_DEVIATION:
        raise too_smooth(settings)
    return bands, deviation


def _spectrum_of_noise(settings):
    """Return the Fourier transform of each row of white noise, Bands of width // 2 + 1 numbers."""
    rng = np.random.default_rng(settings.seed)
    bands = Bands(settings.height, settings.width)
    for rows, part in bands.spectrum():
        for piece in slices(len(part), settings.width):
            noise = rng.standard_normal((piece.stop - piece.start, settings.width))
            part[piece] = np.fft.rfft(noise, axis=1)
    return bands


def _filter(bands, settings):
    """Transform all columns, blur, and transform them back, in place."""
    across, down = np.fft.rfftfreq(settings.width), np.fft.fftfreq(settings.height)[:, None]
    parts = [part for _, part in bands.spectrum()]
    for columns in slices(len(across), settings.height):
        frequency = np.hypot(down, across[columns])
        # The Fourier transform of a Gaussian of standard deviation s is exp(-2 (pi s f)^2).
        blur = np.exp(-2.0 * (np.pi * settings.feature_size * frequency) ** 2)
        column = np.concatenate([part[:, columns] for part in parts])
        column = np.fft.ifft(np.fft.fft(column, axis=0) * blur, axis=0)
        for rows, part in bands.spectrum():
            part[:, columns] = column[rows]


def _transform_back(bands, width):
    """Transform all rows back, in the same memory."""
    for rows, part in bands.spectrum():
        values = part.reshape(-1).view(np.float64)
        for piece in slices(len(part), width):
            real = np.fft.irfft(part[piece], n=width, axis=1)
            # a row of numbers is shorter than its spectrum: what is not transformed yet stays
            values[piece.start * width:piece.stop * width] = real.reshape(-1)


PATTERN = Pattern('aperiodic 2-D hue, uniform brightness', make, Repeats.NEVER,
                  uniform_brightness=True, check=check)
