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
"""The planes of the third view: fitted where they are needed."""

import numpy as np

from .fitting_kernels import fit_region
from ..planes import LeastSquares


class RegionSquares(LeastSquares):
    """
    Fits planes to the nodes of a region.

    Near depth edges only the lines of tiles are fitted that hold such nodes. All others keep
    their planes and variances.

    Attributes
    ----------
    region : numpy.ndarray, bool, framed
        To be set before `fit`.

    """

    def __init__(self, grid, *others):
        """Begin without any node; others as those of LeastSquares."""
        super().__init__(grid, *others)
        self.region = np.zeros(grid.shape, bool)

    def solve(self, linearized, planes, pair, tiles, reach, gate, stride):
        """Replace the planes of the region in some tiles, see `LeastSquares.solve`."""
        with planes.rewriting(keep_unwritten=True) as (old, new):
            fit_region(linearized.weight, linearized.moment, old.d, old.a, old.b, self.region,
                       tiles, reach, gate, stride, pair.noise_weight, self.ridge, self.steepest,
                       self.reference, new.d, new.a, new.b, planes.variance)
