# SPDX-License-Identifier: Apache-2.0
"""What the search for disparities knows of one pixel."""

from dataclasses import dataclass

import numpy as np

from .arrays import Doubles

WINDOW = 8
"""Nodes that a window counts, see `surface/coarse_kernels.sum_window`."""
DIRECTIONS = 4
"""Semi-global paths through a node."""


@dataclass(frozen=True, eq=False)
class CostCurve:
    """The costs of one pixel over the disparities that were searched; lower fits better."""

    disparity: Doubles
    """float64 (D,), px, rising; a step is one node of the coarse grid."""
    window: Doubles
    """float64 (D,), 0 .. 1: how much the colors around the pixel differ, 1 = the cap."""
    path: Doubles
    """
    float64 (D,), 0 = the disparity that the search chose.

    In units of `window`, with all that speaks for the disparity along the semi-global paths.
    """

    @classmethod
    def of(cls, disparity, window, path, cap):
        """
        Take the costs of the coarse search.

        Parameters
        ----------
        disparity : numpy.ndarray, shape (D,)
            px.
        window, path : numpy.ndarray, int16, shape (D,)
            Costs of the windows, and the sums of the path costs.
        cap : int
            The largest cost of a node.

        """
        largest = float(WINDOW * cap)
        path = path.astype(np.float64)
        return cls(disparity.astype(np.float64), window / largest,
                   (path - path.min()) / (DIRECTIONS * largest))
