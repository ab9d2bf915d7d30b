# SPDX-License-Identifier: Apache-2.0
"""Three sines, one per component (paper, sec. 2.1)."""

import numpy as np

from .colors import sweep_hue
from .pattern import Pattern, Repeats


def make(settings):
    """Return three sines, shifted by a third of a period, (width, 3)."""
    phase = 2.0 * np.pi / 3.0 * (sweep_hue(settings)[:, None] - np.arange(3.0))
    return 0.5 + 0.5 * np.cos(phase)


PATTERN = Pattern('three phase-shifted sines', make, Repeats.CYCLES, uniform_brightness=True)
