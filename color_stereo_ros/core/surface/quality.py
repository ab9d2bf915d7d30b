# SPDX-License-Identifier: Apache-2.0
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

    def correct_variance(self, linearized, planes, reference):
        """
        Make planes.variance that of the errors, not only of the assumed noise.

        Parameters
        ----------
        linearized : Linearized
        planes : PlaneField
        reference : numpy.float32
            Of `Linearized.moment`, px.

        """
        tuning, inner = self.tuning, self.grid.inner
        if not tuning.pull_gain:
            return
        sample_quality(planes.d, linearized.weight, linearized.moment, planes.variance,
                       planes.misfit, reference, tuning.step, self.samples)
        factor, added = self.model()
        variance = planes.variance[inner]
        variance *= self.at_all_nodes(factor)
        variance += self.at_all_nodes(added)

    def model(self):
        """Return factor and addition (px^2) of the variance at the samples, float32 (h, w)."""
        tuning = self.tuning
        around = (tuning.surroundings,) * 2
        share = cv2.blur(self.samples[3], around)
        known = np.maximum(share, F4(tuning.least_share))
        pull, misfit, bend = (cv2.blur(each, around) / known for each in self.samples[:3])
        factor = np.clip(tuning.pull_gain * pull ** 2, *tuning.factor_limits)
        factor[share < F4(tuning.least_share)] = 1
        low, high = tuning.misfits
        doubt = np.clip((misfit - low) / (high - low), 0, 1)
        return factor.astype(F4), (tuning.bend_gain * doubt * bend ** 2).astype(F4)

    def at_all_nodes(self, samples):
        """Return samples at all nodes, float32 (rows, columns), linearly interpolated."""
        return cv2.resize(samples, self.grid.nodes[::-1], interpolation=cv2.INTER_LINEAR)
