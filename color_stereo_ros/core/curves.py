# SPDX-License-Identifier: Apache-2.0
"""What the search for disparities knows of one pixel."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class CostCurve:
    """The costs of one pixel over the disparities that were searched; lower fits better."""

    disparity: np.ndarray
    """float64 (D,), px, rising; a step is one node of the coarse grid."""
    window: np.ndarray
    """float64 (D,), 0 .. 1: how much the colors around the pixel differ, 1 = the cap."""
    path: np.ndarray
    """
    float64 (D,), 0 = the disparity that the search chose.

    In units of `window`, with all that speaks for the disparity along the semi-global paths.
    """
