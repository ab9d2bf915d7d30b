# SPDX-License-Identifier: Apache-2.0
"""
Kernels of the search for texture: semi-global matching, one row of the half grid after another.

All disparities of a node lie beside each other, so that each step is a SIMD loop over them. A row
of costs and paths stays in the cache: there is no volume. The right view is mirrored, since a
larger disparity is a place further left.

"""

import numpy as np

from ..compiled import band, banded, part
from .grid_kernels import F4, I4
from .tuning import TUNING

I2 = np.int16
LARGEST = I2(32767)
WINDOW = 12  # sum of the weights of a window: three rows of three nodes
FREE = np.iinfo(np.int32).max  # a column of the right view that no node has chosen
GUARD_COST = I2(TUNING.coarse.guard_cost)
# Constants of `tuning`, compiled into the kernels.
DIFFERENCE_CAP = I2(TUNING.brightness.difference_cap)
RUN_UP = TUNING.brightness.run_up
AGREEMENT = TUNING.brightness.agreement


@banded()
def intervals(k, planes, low, high):
    """
    Write what a view has within half a column of each column; all int16 (C, h, N).

    The first and the last column are left as they are: nothing is compared with them.

    """
    channels, rows, columns = planes.shape
    first, last = band(k, rows)
    for c in range(channels):
        for y in range(first, last):
            row, least, most = planes[c, y], low[c, y, 1:columns - 1], high[c, y, 1:columns - 1]
            same, after = row[1:columns - 1], row[2:]
            for n in range(least.size):
                earlier = I2(I2(same[n] + row[n]) >> I2(1))
                later = I2(I2(same[n] + after[n]) >> I2(1))
                least[n] = min(min(earlier, later), same[n])
                most[n] = max(max(earlier, later), same[n])


@part()
def outside(value, low, high):
    """Return how far a value lies outside an interval, int16, at most DIFFERENCE_CAP."""
    return min(max(max(I2(value - high), I2(low - value)), I2(0)), DIFFERENCE_CAP)


@part()
def row_costs(left, low, high, y, start, out):
    """
    Write the costs of a row, int16 (columns, D), summed over pairs of channels.

    start is the entry of `low` at which node 0 has its first disparity; a node is two columns.

    """
    columns, depth = out.shape
    for x in range(columns):
        costs, at = out[x], start - 2 * x
        for c in range(0, left.shape[0], 2):
            one, other = left[c, y, x], left[c + 1, y, x]
            low_one, high_one = low[c, y, at:at + depth], high[c, y, at:at + depth]
            low_other, high_other = low[c + 1, y, at:at + depth], high[c + 1, y, at:at + depth]
            if c == 0:
                for d in range(depth):
                    costs[d] = I2(outside(one, low_one[d], high_one[d])
                                  + outside(other, low_other[d], high_other[d]))
            else:
                for d in range(depth):
                    costs[d] = I2(costs[d] + I2(outside(one, low_one[d], high_one[d])
                                                + outside(other, low_other[d], high_other[d])))


@part()
def window_costs(above, here, below, sums, out):
    """
    Sum three rows and then three nodes, the middle one twice; int16 (columns, D).

    sums is scratch, int16 (columns + 2, D).

    """
    columns, depth = out.shape
    a, b, c = above.reshape(-1), here.reshape(-1), below.reshape(-1)
    flat, costs = sums.reshape(-1), out.reshape(-1)
    middle = flat[depth:(columns + 1) * depth]
    for i in range(middle.size):
        middle[i] = I2(I2(a[i] + b[i]) + c[i])
    for d in range(depth):
        sums[0, d] = sums[1, d]
        sums[columns + 1, d] = sums[columns, d]
    after = flat[2 * depth:]
    for i in range(costs.size):
        costs[i] = I2(I2(flat[i] + after[i]) + I2(middle[i] + middle[i]))


@part()
def extend(cost, path, small, large, latest):
    """
    Extend a path by one node: latest = cost + cheapest step; path becomes latest less its lowest.

    path, int16 (D + 2,), has a guard at either end.

    """
    depth = cost.size
    before, same, after = path[:depth], path[1:depth + 1], path[2:depth + 2]
    low = LARGEST
    for d in range(depth):
        step = min(min(same[d], I2(min(before[d], after[d]) + small)), large)
        latest[d] = I2(cost[d] + step)
        low = min(low, latest[d])
    for d in range(depth):
        same[d] = I2(latest[d] - low)


@part()
def add_to(row, out):
    """Add row to out, int16 (D,)."""
    for d in range(out.size):
        out[d] = I2(out[d] + row[d])


@part()
def cheapest_of(costs):
    """Return the lowest of some costs, int16 (D,), and the first index that has it."""
    low = LARGEST
    for d in range(costs.size):
        low = min(low, costs[d])
    at = 0
    while costs[at] != low:
        at += 1
    return I4(low), at


@part()
def row_winners(total, first, last_column, best_right, best, disparity):
    """
    Write the disparities of a row, px, NaN where the right view prefers another node.

    total is int16 (columns, D); a parabola through three costs gives fractions.

    """
    columns, depth = total.shape
    best_right[:] = FREE
    for x in range(columns):
        costs = total[x]
        low, at = cheapest_of(costs)
        found = F4(first + at)
        if 0 < at < depth - 1:
            before, after = I4(costs[at - 1]), I4(costs[at + 1])
            found += F4(0.5) * F4(before - after) / F4(max(before + after - 2 * low, 1))
        disparity[x] = found
        best[x] = first + at
        place = 2 * x - (first + at)
        if 0 <= place <= last_column:
            # cost and disparity in one number: the cheaper, then the nearer one wins
            best_right[place >> 1] = min(best_right[place >> 1], I4(low * 16384 + 8192 - (first + at)))
    for x in range(columns):
        here = I4(best[x])
        beside = here + 1 if disparity[x] > F4(here) else here - 1
        if not (agrees(best_right, 2 * x - here, here, last_column)
                or agrees(best_right, 2 * x - beside, beside, last_column)):
            disparity[x] = np.nan


@part()
def agrees(best_right, place, disparity, last_column):
    """Return whether a place of the right view has no node or one of about a disparity."""
    if not 0 <= place <= last_column or best_right[place >> 1] == FREE:
        return True
    return abs(8192 - best_right[place >> 1] % 16384 - disparity) <= AGREEMENT


@banded()
def search_rows(k, left, low, high, start, first_disparity, last_column, small, large, disparity,
                rows_of, sums_of, lines, numbers):
    """
    Search all disparities of the half grid: paths from the left, the right and above.

    Parameters
    ----------
    left : int16 (C, rows, columns)
        What is compared, at the nodes.
    low, high : int16 (C, rows, N)
        See `intervals`; of the mirrored right view.
    start : int
        Entry of low at which node 0 has the first disparity.
    first_disparity, last_column : int
        px; last column of the right view.
    small, large : int16
        Penalties of a step of one pixel and of a larger one.
    disparity : float32 (rows, columns)
        Written, px; NaN = the right view does not agree.
    rows_of : int16 (BANDS, 5, columns, D)
        Scratch: three rows of costs, their windows, and the sum of all paths.
    sums_of : int16 (BANDS, columns + 2, D)
        Scratch: sums of three rows.
    lines : int16 (BANDS, columns + 2, D + 2)
        Scratch: the paths from above, a path along the row and what it becomes.
    numbers : int32 (BANDS, 2, columns of the right view or of the nodes)

    """
    rows, columns = disparity.shape
    depth = rows_of.shape[3]
    first, last = band(k, rows)
    scratch, sums, paths = rows_of[k], sums_of[k], lines[k]
    costs, total = scratch[3], scratch[4]
    above, along, latest = paths[:columns], paths[columns], paths[columns + 1, :depth]
    above[:] = I2(0)
    above[:, 0] = GUARD_COST
    above[:, depth + 1] = GUARD_COST
    begin = max(first - RUN_UP, 0)
    for y in range(begin - 1, last + 1):
        row = min(max(y, 0), rows - 1)
        row_costs(left, low, high, row, start, scratch[(y + 3) % 3])
        if y <= begin:
            continue
        here = y - 1
        window_costs(scratch[(here + 2) % 3], scratch[here % 3], scratch[(here + 4) % 3], sums,
                     costs)
        for x in range(columns):
            extend(costs[x], above[x], small, large, total[x])
        if here < first:
            continue
        for backwards in range(2):
            along[:] = I2(0)
            along[0] = GUARD_COST
            along[depth + 1] = GUARD_COST
            for n in range(columns):
                x = columns - 1 - n if backwards else n
                extend(costs[x], along, small, large, latest)
                add_to(latest, total[x])
        row_winners(total, first_disparity, last_column, numbers[k, 0], numbers[k, 1],
                    disparity[here])
