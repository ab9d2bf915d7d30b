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
"""Propagation: nodes near depth edges try the planes of their neighbors."""

from .grid_kernels import F4
from .neighbor_kernels import HALO, propagate


def propagate_planes(views, planes, pair, tiles, turn, tuning, brightness):
    """
    Let the nodes of some tiles try the planes of their neighbors (as PatchMatch stereo does).

    Writes planes.d, a, b and cost in these tiles only.

    Parameters
    ----------
    views : Views
        Both views as the method sees them.
    planes : PlaneField
        The planes of the nodes so far.
    pair : PairModel
        What the two views of the pair differ by.
    tiles : numpy.ndarray, int32, shape (N, 2)
        Row and column of the tiles, in nodes.
    turn : int
        Number of the round, from 1.
    tuning : NeighborTuning
        Constants of this stage.
    brightness : BrightnessCarrier
        The brightness of both views.

    """
    steps = tuning.steps[min(turn, len(tuning.steps)) - 1]
    cap, inertia = F4(tuning.misfit_cap), F4(tuning.inertia)
    left, right = views.left, views.right
    for number, step in enumerate(steps):
        first = number == 0
        # the first pass copies the nodes that no pass writes, and writes the cost of the planes
        with planes.rewriting(keep_unwritten=first) as (old, new):
            propagate(left.u, left.v, left.variance, right.u, right.v, right.variance, views.psf,
                      pair.matrix, pair.scale, cap, inertia, brightness.arrays, old.d, old.a,
                      old.b, tiles, step, not first, new.d, new.a, new.b, planes.cost)


def rough_tiles(views, planes, step):
    """Return the tiles near depth edges, int32 (N, 2); step: see `PlaneField.smooth`."""
    return planes.tiles[~planes.smooth(planes.tiles, views, HALO, step)]
