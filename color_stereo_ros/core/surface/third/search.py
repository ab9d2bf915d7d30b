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
"""The coarse search of the third view: semi-global, over disparities, on the left coarse grid."""

import cv2
import numpy as np

from .sweep_kernels import (
    cheapest_disparities, PATHS, paths_along_columns, paths_along_rows, sum_windows, sweep_costs)
from .tuning import TUNING
from ..coarse import Seeds
from ...compiled import BANDS

F4 = np.float32
I2 = np.int16


class SweepSearch:
    """
    Searches the pattern for the nodes of the left image.

    Parameters
    ----------
    coarse : CoarseSearch
        Of the two cameras: its grid and its penalties are used.
    limits : (float, float)
        Smallest and largest disparity, px.
    spacing : float
        Between the disparities that are compared, px.
    arena : Arena

    """

    def __init__(self, coarse, limits, spacing, arena):
        """Allocate the volumes."""
        self.coarse, self.spacing = coarse, spacing
        h, w = coarse.disparity.shape
        self.depth = 3 + int(np.ceil((limits[1] - limits[0]) / spacing))
        lanes = TUNING.search.lanes
        whole = -(-self.depth // lanes) * lanes
        self.first = float(limits[0]) - spacing
        self.cost, self.summed, self.total = (arena.empty((h, w, whole), I2) for _ in range(3))
        # paths see no difference between these and the end of the volume
        self.cost[..., self.depth:] = TUNING.search.guard_cost // TUNING.search.window_weight
        self.scratch = arena.empty((BANDS, w // BANDS + 2, whole + 3), I2)
        self.best = arena.empty((h, w), F4)

    @property
    def step(self):
        """Return the pixels per coarse node."""
        return 2 * self.coarse.factor

    def search(self, pattern, size, colors, light, known, wanted, sweep):
        """
        Search one pair.

        Parameters
        ----------
        pattern : BlurredPattern
            The pattern as the camera sees it.
        size : numpy.ndarray, int64, shape (2,)
            Its height and width, px.
        colors : numpy.ndarray, float32, shape (3, 4)
            Affine map from the light of the pattern to the camera.
        light : numpy.ndarray, float32, shape (3, h, w)
            Of the pattern, local brightness.
        known : numpy.ndarray, float32, shape (h, w)
            Disparity that stereo knows, px; NaN = unknown.
        wanted : numpy.ndarray, bool, shape (h, w)
            Unknown coarse nodes that are searched; all others keep what is known, or take the
            disparities of those around.
        sweep : numpy.ndarray, float32, shape (3, 4)
            To the pixels of this image.

        Returns
        -------
        seeds : Seeds
            Without NaN.

        """
        tuning, coarse = TUNING.search, self.coarse
        left = coarse.upright.left
        cap, neutral = coarse.costs
        center = F4((self.step - 1) / 2)
        known = (known - F4(self.first)) / F4(self.spacing)
        needed = needed_nodes(wanted)
        sweep_costs(left[0], left[1], left[3] * wanted, pattern.coarse_image,
                    F4(1 / pattern.thin), size, colors, light, known, needed, sweep, center,
                    F4(self.step), F4(self.first), F4(self.spacing), coarse.scale, cap,
                    neutral, F4(tuning.known_slope * cap), self.depth, self.cost)
        sum_windows(self.cost, needed, self.summed)
        small, large = coarse.penalties
        guard = I2(tuning.guard_cost)
        paths_along_rows(self.summed, needed, small, large, guard, self.total, self.scratch)
        paths_along_columns(self.summed, needed, small, large, guard, self.total, self.scratch)
        cheapest_disparities(self.total, self.depth, known, needed, self.best)
        disparity = F4(self.first) + F4(self.spacing) * self.best
        return Seeds(disparity / F4(self.step), coarse.factor, None, 0.0)


def needed_nodes(unknown):
    """
    Return what is needed of coarse nodes whose disparity is searched, uint8 (h, w).

    Paths run over these nodes and their neighbors, of which some know more, and costs are summed
    over the neighbors of both.

    """
    kernel = np.ones((3, 3), np.uint8)
    paths = cv2.dilate(unknown.view(np.uint8), kernel)
    return np.where(paths, np.uint8(PATHS), cv2.dilate(paths, kernel))
