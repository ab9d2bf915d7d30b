# SPDX-License-Identifier: Apache-2.0
"""What holds for all nodes of one pair: how colors map from right to left, how much noise."""

from dataclasses import dataclass, replace

import numpy as np

from .grid_kernels import F4, PAD
from .view_kernels import add_color_sums

QUARTILE = 0.5754   # first quartile of chi-square with two degrees of freedom
ADAPT_STEPS = 8, 4  # nodes between samples: thousands are left at 640 x 480
ROBUST = F4(9.0)    # misfit at which a node counts half
LEAST_SAMPLES = 100
SCALES = 0.1, 100.0
STEADYING = 50.0


@dataclass(frozen=True, eq=False)
class PairModel:
    """What is the same at all nodes of one pair of images."""

    matrix: np.ndarray
    """float32 (2, 3), the affine map from right to left chromaticities."""
    scale: np.float32
    """Variance of the colors, as a factor of that of the camera model in `views`."""
    noise_weight: np.float32
    """Weight that mere noise has at a node, see `gains.noise_weight`."""

    @classmethod
    def neutral(cls, views):
        """Return what holds before anything is measured: equal cameras, plausible noise."""
        return cls(np.eye(2, 3, dtype=F4), F4(1), views.noise_weight)

    def measured(self, views, planes, misfit, match_colors):
        """
        Return the model that the matches so far show.

        Parameters
        ----------
        views : Views
        planes : PlaneField
        misfit : numpy.ndarray, float32, framed
            Of the nodes under this model, NaN = unknown.
        match_colors : bool
            Measure `matrix`, too.

        Returns
        -------
        model : PairModel
            This one where there are too few matches.

        """
        rows, columns = views.grid.nodes
        area = np.s_[PAD + 1:PAD + rows:ADAPT_STEPS[0], PAD + 1:PAD + columns:ADAPT_STEPS[1]]
        known = misfit[area][np.isfinite(misfit[area])]
        if known.size < LEAST_SAMPLES:
            return self
        at = known.size // 4
        scale = F4(np.clip(np.partition(known, at)[at] / QUARTILE, *SCALES))
        matrix = color_matrix(views, planes, misfit, scale) if match_colors else self.matrix
        return replace(self, scale=scale, matrix=matrix)


def color_matrix(views, planes, misfit, scale):
    """Return the affine map (2, 3) from right to left chromaticities of matched nodes."""
    # a prior of 100 nodes for equal cameras steadies images with little color
    normal, target = STEADYING * np.eye(3), STEADYING * np.eye(3, 2)
    left, right = views.left, views.right
    add_color_sums(left.u, left.v, right.u, right.v, planes.d, misfit, ROBUST * scale,
                   *views.grid.nodes, *ADAPT_STEPS, normal, target)
    # rows in memory as in `PairModel.neutral`: another layout would compile the kernels again
    return np.ascontiguousarray(np.linalg.solve(normal, target).T, F4)
