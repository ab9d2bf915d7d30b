# SPDX-License-Identifier: Apache-2.0
"""Lines of high contrast (paper, fig. 2.1 left)."""

import numpy as np

from .colors import constant_sum_colors
from .pattern import Pattern


def make(settings):
    """
    Return columns of high contrast, (width, 3).

    From line to line the hue jumps half around the circle and returns, so that every second line
    follows the constant-sum sweep.

    """
    line = np.floor(np.arange(settings.width) / settings.feature_size)
    slow = 3.0 * settings.cycles * line * settings.feature_size / settings.width
    return constant_sum_colors(slow + 1.5 * (line % 2))


PATTERN = Pattern('high-contrast lines', make, uniform_brightness=True)
