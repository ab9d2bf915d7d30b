# SPDX-License-Identifier: Apache-2.0
"""Kernels of the fusion: what tells how far planes of the third view can be trusted."""

import math

from ...compiled import band, banded, LENGTH, part, stack_row
from ..grid_kernels import F4, FAST, PAD
from .tuning import TUNING

# Constants of `tuning`, compiled into the kernels.
MISFIT_CAP = F4(TUNING.use.misfit_cap)
VARIANCE_CAP = F4(TUNING.use.variance_cap)
DISTANCE_CAP = F4(TUNING.use.distance_cap)


@part(fastmath=FAST)
def bounded_distance(away):
    """Return a distance of two planes within -DISTANCE_CAP .. DISTANCE_CAP; unknown: the cap."""
    return max(min(away, DISTANCE_CAP), -DISTANCE_CAP) if away == away else DISTANCE_CAP


@part()
def any_is(values, value):
    """Return whether any entry is a value."""
    found = False
    for x in range(values.size):
        found |= values[x] == value
    return found


@banded(fastmath=FAST)
def gather_evidence(k, d, a, b, cost, variance, misfit, treated, own, steps):
    """
    Write what tells how far planes of the third view can be trusted, at treated nodes.

    own, float32 (4, rows, columns): square roots of the cost of the best shifted window, of the
    mean misfit of 3 x 3 nodes, of the standard deviation (px), and of the mean distance of the
    four neighbors from the plane (px). steps, float32 (2, rows, columns), at all nodes: square
    roots of how far, px, the nearest and the farthest of the neighbors lie before and behind the
    plane. All planes and misfits are framed.

    """
    rows, columns = treated.shape
    first, last = band(k, rows)
    for row in range(first, last):
        y = row + PAD
        for column in range(columns):
            x = column + PAD
            here, along, down = d[y, x], a[y, x], b[y, x]
            right = bounded_distance(d[y, x + 1] - here - along)
            left = bounded_distance(d[y, x - 1] - here + along)
            below = bounded_distance(d[y + 1, x] - here - down)
            above = bounded_distance(d[y - 1, x] - here + down)
            nearer = max(max(right, left), max(below, above))
            farther = min(min(right, left), min(below, above))
            steps[0, row, column] = math.sqrt(max(nearer, F4(0)))
            steps[1, row, column] = math.sqrt(max(-farther, F4(0)))
            if treated[row, column]:
                mean = F4(0.25) * (abs(right) + abs(left) + abs(below) + abs(above))
                own[0, row, column] = math.sqrt(min(cost[y, x], MISFIT_CAP))
                own[1, row, column] = math.sqrt(min(misfit[y, x], MISFIT_CAP))
                own[2, row, column] = math.sqrt(math.sqrt(min(variance[y, x], VARIANCE_CAP)))
                own[3, row, column] = math.sqrt(mean)


@banded(fastmath=FAST)
def weigh_forms(k, evidence, kind, forms, out):
    """
    Write x . forms[n - 1] x of x = (1, evidence) at the nodes of kind n; others stay.

    evidence float32 (K, rows, columns), kind uint8 (rows, columns), 0 = none, forms float32
    (N, K + 1, K + 1), upper triangular, out float32 (rows, columns).

    """
    count, rows, columns = evidence.shape
    first, last = band(k, rows)
    total, inner = stack_row(), stack_row()
    for row in range(first, last):
        for start in range(0, columns, LENGTH):
            size = min(LENGTH, columns - start)
            stop = start + size
            kinds, told = kind[row, start:stop], out[row, start:stop]
            for which in range(forms.shape[0]):
                if not any_is(kinds, which + 1):
                    continue
                for x in range(size):
                    total[x] = forms[which, 0, 0]
                for i in range(count):
                    constant = forms[which, 0, i + 1]
                    for x in range(size):
                        inner[x] = constant
                    for j in range(i, count):
                        factor, each = forms[which, i + 1, j + 1], evidence[j, row, start:stop]
                        for x in range(size):
                            inner[x] += factor * each[x]
                    one = evidence[i, row, start:stop]
                    for x in range(size):
                        total[x] += one[x] * inner[x]
                for x in range(size):
                    if kinds[x] == which + 1:
                        told[x] = total[x]
