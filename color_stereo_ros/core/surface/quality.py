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
"""Quality: how well planes fit in the surroundings, and what that says of their variance."""

import cv2
import numpy as np

from .grid_kernels import F4
from .quality_kernels import sample_quality


class Quality:
    """
    Corrects the variance of planes by how well they fit around each node.

    Parameters
    ----------
    grid : HalfGrid
    tuning : QualityTuning
    arena : Arena

    Attributes
    ----------
    samples : numpy.ndarray, float32, shape (4, h, w)
        See `quality_kernels.sample_quality`.

    """

    def __init__(self, grid, tuning, arena):
        """Allocate the samples."""
        self.grid, self.tuning = grid, tuning
        shape = (max(1, count // tuning.step) for count in grid.nodes)
        self.samples = arena.zeros((4, *shape), F4)

    def sample(self, linearized, planes, reference):
        """
        Measure how well planes fit; the other methods read that.

        Parameters
        ----------
        linearized : Linearized
            The slopes of the misfit at the planes.
        planes : PlaneField
            The planes of the nodes so far.
        reference : numpy.float32
            Of `Linearized.moment`, px.

        """
        sample_quality(planes.d, linearized.weight, linearized.moment, planes.variance, reference,
                       self.tuning.step, self.samples)

    def correct_variance(self, planes):
        """Make planes.variance that of the errors, not only of the assumed noise."""
        if self.tuning.pull_gain:
            planes.variance[self.grid.inner] *= self.at_all_nodes(self.factor())

    def uneven(self):
        """Return ln of the mean second difference (px) around all nodes, float32."""
        return self.at_all_nodes(np.log(np.maximum(self.bend(), F4(self.tuning.even))))

    def bend(self):
        """Return the mean second difference around the samples, px, float32 (h, w)."""
        return self.averages()[1]

    def averages(self):
        """
        Return means around the samples, float32 (h, w) each.

        Pull and second difference, 0 = unknown, and the share of samples that are known.

        """
        around = (self.tuning.surroundings,) * 2
        pull, bend, share = (cv2.blur(each, around) for each in self.samples[:3])
        known = np.maximum(share, F4(self.tuning.least_share))
        return pull / known, bend / known, share

    def factor(self):
        """Return the factor of the variance at the samples, float32 (h, w)."""
        tuning, (pull, bend, share) = self.tuning, self.averages()
        uneven = np.maximum(bend, F4(tuning.even)) ** F4(tuning.uneven_power)
        factor = np.clip(F4(tuning.pull_gain) * uneven * pull ** 2, *tuning.factor_limits)
        factor[share < F4(tuning.least_share)] = 1
        return factor.astype(F4)

    def at_all_nodes(self, samples):
        """Return samples at all nodes, float32 (rows, columns), linearly interpolated."""
        return cv2.resize(samples, self.grid.nodes[::-1], interpolation=cv2.INTER_LINEAR)
