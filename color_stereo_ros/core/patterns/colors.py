# SPDX-License-Identifier: Apache-2.0
"""Colors that several patterns are made of."""

import numpy as np


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
