# SPDX-License-Identifier: Apache-2.0
"""A turn through the hues at maximum brightness (paper, fig. 2.2 left)."""

import numpy as np

from . import sweep
from .colors import constant_sum_colors, sweep_hue
from .pattern import Pattern, Repeats


def make(settings):
    """Return the hue sweep of maximum brightness, (width, 3)."""
    return np.minimum(1.0, 2.0 * constant_sum_colors(sweep_hue(settings)))


# The figure shows both sweeps: lists name them together, "right and left".
PATTERN = Pattern(sweep.PATTERN.summary, make, Repeats.CYCLES)
