# SPDX-License-Identifier: Apache-2.0
"""A turn through the hues at constant brightness (paper, fig. 2.2 right)."""

from .colors import constant_sum_colors, sweep_hue
from .pattern import Pattern, Repeats


def make(settings):
    """Return a constant-sum turn through the hues, (width, 3)."""
    return constant_sum_colors(sweep_hue(settings))


PATTERN = Pattern('paper fig. 2.2 right and left', make, Repeats.CYCLES, uniform_brightness=True)
