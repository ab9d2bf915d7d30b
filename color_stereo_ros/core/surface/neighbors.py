# SPDX-License-Identifier: Apache-2.0
"""Propagation: nodes near depth edges try the planes of their neighbors."""

from .grid_kernels import F4
from .neighbor_kernels import HALO, propagate


def propagate_planes(views, planes, pair, tiles, turn, tuning):
    """
    Let the nodes of some tiles try the planes of their neighbors (as PatchMatch stereo does).

    Writes the planes and the cost of these tiles. turn counts the rounds, from 1; tuning is a
    NeighborTuning.

    """
    steps = tuning.steps[min(turn, len(tuning.steps)) - 1]
    cap, inertia = F4(tuning.misfit_cap), F4(tuning.inertia)
    left, right = views.left, views.right
    for number, (old, new) in enumerate(planes.rewritten(tiles, len(steps), whole=False)):
        # the first call has written the cost of its planes
        propagate(left.u, left.v, left.variance, right.u, right.v, right.variance,
                  views.psf, pair.matrix, pair.scale, cap, inertia,
                  *old, tiles, steps[number], number > 0, *new, planes.cost)


def rough_tiles(views, planes, step):
    """Return the tiles near depth edges, int32 (N, 2); step: as `PlaneField.smooth` has it."""
    return planes.tiles[~planes.smooth(planes.tiles, views, HALO, step)]
