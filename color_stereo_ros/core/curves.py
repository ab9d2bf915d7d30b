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
