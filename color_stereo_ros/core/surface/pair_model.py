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
"""What holds for all nodes of one pair: how colors map from right to left, how much noise."""

from dataclasses import dataclass, replace

import numpy as np

from .grid_kernels import F4, PAD, TILE_ROWS
from .view_kernels import add_color_sums


@dataclass(frozen=True, eq=False)
class PairModel:
    """What is the same at all nodes of one pair of images."""

    matrix: np.ndarray
    """float32 (2, 3), the affine map from right to left chromaticities."""
    scale: np.float32
    """Variance of the colors, as a factor of that of the camera model in `views`."""
    noise_weight: np.float32
    """Weight that mere noise has at a node, see `raw_faults.noise_weight`."""

    @classmethod
    def neutral(cls, views):
        """Return what holds before anything is measured: equal cameras, plausible noise."""
        return cls(np.eye(2, 3, dtype=F4), F4(1), views.noise_weight)

    def measured(self, views, planes, match_colors, tuning):
        """
        Return the model that the matches so far show.

        Parameters
        ----------
        views : Views
            Both views as the method sees them.
        planes : PlaneField
            With the misfit under this model.
        match_colors : bool
            Measure `matrix`, too.
        tuning : Tuning
            Constants of the method.

        Returns
        -------
        model : PairModel
            This one where there are too few matches.

        """
        misfit = counted_misfit(views, planes, tuning)
        known = known_values(misfit[sampled_nodes(views.grid, tuning.pair)])
        if known.size < tuning.pair.least_samples:
            return self
        quartile = first_quartile(known)
        scale = F4(np.clip(quartile / tuning.pair.quartile, *tuning.pair.scale_limits))
        if not match_colors:
            return replace(self, scale=scale)
        matrix = color_matrix(views, planes, scale, tuning, misfit)
        return replace(self, scale=scale, matrix=matrix)


def worst_part(views, planes, tuning):
    """
    Return the noise scale of the part of the image in which the views agree least, 0 or more.

    Unequal blur beside one border does not show in the scale of the whole pair: that is a first
    quartile. Parts with few matches do not count.

    Parameters
    ----------
    views : Views
        Both views as the method sees them.
    planes : PlaneField
        With the misfit of the first round.
    tuning : Tuning
        Constants of the method.

    """
    misfit = counted_misfit(views, planes, tuning)[sampled_nodes(views.grid, tuning.pair)]
    worst, tuning = 0.0, tuning.pair
    for band in np.array_split(misfit, tuning.parts[0]):
        for part in np.array_split(band, tuning.parts[1], axis=1):
            known = known_values(part)
            if known.size >= tuning.least_part:
                worst = max(worst, float(first_quartile(known)))
    return worst / tuning.quartile


def sampled_nodes(grid, tuning):
    """Return the slices of a framed array that hold the nodes which tell what a pair is like."""
    rows, columns = grid.nodes
    step_y, step_x = tuning.adapt_steps
    return np.s_[PAD + 1:PAD + rows:step_y, PAD + 1:PAD + columns:step_x]


def counted_misfit(views, planes, tuning):
    """
    Return the misfit of the nodes, framed; NaN at those that say nothing of a pair.

    Parameters
    ----------
    views : Views
        Their light and noise decide what counts.
    planes : PlaneField
        Of whose misfit a copy is returned where some nodes do not count.
    tuning : Tuning
        Constants of the method.

    Returns
    -------
    misfit : numpy.ndarray, float32, framed

    """
    misfit, variance = planes.misfit, views.left.variance
    area = sampled_nodes(views.grid, tuning.pair)
    if mostly_dim(misfit[area], variance[area], tuning.pair):
        misfit = np.where(variance < F4(tuning.pair.dim_variance), misfit, F4(np.nan))
    if views.compressed:  # compression leaves no noise where it is dark
        misfit = np.where(views.left.s > F4(tuning.raw.least_light), misfit, F4(np.nan))
    return misfit


def known_values(values):
    """Return the finite ones of some values, (N,)."""
    return values[np.isfinite(values)]


def first_quartile(known):
    """Return the first quartile of values (N,), N > 0: outliers do not move it."""
    at = known.size // 4
    return np.partition(known, at)[at]


def sampled_lines(tuning):
    """
    Return the lines of a tile that `PairModel.measured` reads: the first one, and their distance.

    tuning : PairTuning

    """
    step = tuning.adapt_steps[0]
    return (1, step) if TILE_ROWS % step == 0 else (0, 1)


def mostly_dim(misfit, variance, tuning):
    """
    Return whether so many known nodes are dim that they would decide what a pair is like.

    Compression gives a dark background one color, the same in both views: its misfit is 0, and it
    says nothing about noise and colors of the lit surfaces. False where too few nodes would be
    left.

    """
    known = np.isfinite(misfit)
    bright = np.count_nonzero(known & (variance < F4(tuning.dim_variance)))
    return tuning.least_samples <= bright < tuning.bright_share * np.count_nonzero(known)


def color_matrix(views, planes, scale, tuning, misfit=None):
    """
    Return the affine map from right to left chromaticities of matched nodes.

    Parameters
    ----------
    views : Views
        Both views as the method sees them.
    planes : PlaneField
        With the misfit of neutral colors and noise.
    scale : numpy.float32
        Of the `PairModel` that is being measured.
    tuning : Tuning
        Constants of the method.
    misfit : numpy.ndarray, float32, framed, optional
        NaN at nodes that do not count; default: that of planes.

    Returns
    -------
    matrix : numpy.ndarray, float32, shape (2, 3)

    """
    # a prior for equal cameras steadies images with little color
    prior = tuning.pair.color_prior
    normal, target = prior * np.eye(3), prior * np.eye(3, 2)
    left, right = views.left, views.right
    add_color_sums(left.u, left.v, right.u, right.v, planes.d,
                   planes.misfit if misfit is None else misfit,
                   F4(tuning.planes.robust_misfit) * scale, *views.grid.nodes,
                   *tuning.pair.adapt_steps, normal, target)
    # rows in memory as in `PairModel.neutral`: another layout would compile the kernels again
    return np.ascontiguousarray(np.linalg.solve(normal, target).T, F4)
