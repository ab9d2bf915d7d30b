# SPDX-License-Identifier: Apache-2.0
"""The color patterns for the projector (paper, sec. 2.1, figs. 2.1 and 2.2)."""

import cv2
import numpy as np

from .settings import PatternSettings
from .types import SettingsError

HUE_FIELD_DEVIATION = 1.6  # hue units; the whole circle has 3, so the field wraps around


def make_pattern(settings=PatternSettings()):
    """
    Return the image that the projector must show.

    Parameters
    ----------
    settings : PatternSettings

    Returns
    -------
    pattern : numpy.ndarray, uint8, shape (height, width, 3)
        RGB, linear light: a projector with a gamma curve must be given the inverse of it.

    Raises
    ------
    SettingsError
        If settings.type is 'unknown': such a pattern cannot be made, only matched.

    """
    if settings.type not in GENERATORS:
        known = ', '.join(GENERATORS)
        raise SettingsError(f'pattern.type = {settings.type!r} cannot be made, expected one of '
                            f'{known}')
    colors = GENERATORS[settings.type](settings)
    return np.ascontiguousarray(np.broadcast_to(
        np.rint(255.0 * np.asarray(colors)).astype(np.uint8),
        (settings.height, settings.width, 3)))


def constant_sum_colors(hue):
    """
    Return colors of uniform brightness, one component zero (paper, fig. 2.2 right).

    Parameters
    ----------
    hue : numpy.ndarray, shape (...)
        0 = red, 1 = green, 2 = blue, 3 = red again; any real number.

    Returns
    -------
    colors : numpy.ndarray, float64, shape (..., 3)
        Components 0..1 whose sum is 1.

    """
    distance = np.abs((hue[..., None] - np.arange(3.0) + 1.5) % 3.0 - 1.5)
    return np.maximum(0.0, 1.0 - distance)


def sweep_hue(settings):
    """Return the hue of each projector column, shape (width,): `cycles` turns over the width."""
    return 3.0 * settings.cycles * np.arange(settings.width) / settings.width


def sweep(settings):
    """Return the constant-sum hue sweep (paper, fig. 2.2 right)."""
    return constant_sum_colors(sweep_hue(settings))


def sine(settings):
    """Return three sines, shifted by a third of a period (paper, sec. 2.1)."""
    phase = 2.0 * np.pi / 3.0 * (sweep_hue(settings)[:, None] - np.arange(3.0))
    return 0.5 + 0.5 * np.cos(phase)


def hue_field(settings):
    """Return an aperiodic two-dimensional hue field of uniform brightness."""
    return constant_sum_colors(random_phase(settings))


def random_phase(settings):
    """Return the phase of hue_field: Gaussian-filtered white noise, hue units, (H, W)."""
    noise = np.random.default_rng(settings.seed).standard_normal(
        (settings.height, settings.width))
    smooth = cv2.GaussianBlur(noise, (0, 0), settings.feature_size, borderType=cv2.BORDER_WRAP)
    return HUE_FIELD_DEVIATION * smooth / smooth.std()


GENERATORS = {'hue_field': hue_field, 'sweep': sweep, 'sine': sine}
