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
"""Kernels of the surface method: how far the rows of the views disagree; see `grid_kernels`."""

import numpy as np

from .grid_kernels import F4, FAST, PAD, PHASE_VARIANCE, SILENT_VARIANCE
from .tuning import TUNING
from ..compiled import band, banded

# Constants of `tuning`, compiled into the kernels.
CELL = TUNING.rows.cell
CELL_STEP, NODE_STEP = TUNING.rows.cell_step, TUNING.rows.node_step
LEAST_SLOPE = F4(TUNING.rows.least_slope)
ROUNDING = F4(TUNING.rows.rounding)
BESIDE, STEP = TUNING.rows.beside, F4(TUNING.rows.step)
BESIDE_WEIGHT = F4(TUNING.rows.beside_weight)
QUANTITIES = 'count', 'information', 'pull', 'misfit', 'place', 'disparity', 'structure'
"""What `row_cells` writes of a cell, see there."""
COUNT, INFORMATION, PULL, MISFIT, PLACE, DISPARITY, STRUCTURE = range(len(QUANTITIES))


@banded(fastmath=FAST)
def row_cells(k, left_u, left_v, left_var, right_u, right_v, right_var, matrix, d, robust_misfit,
              scale, rows, columns, turn, cells):
    """
    Ask the matched nodes of every cell by how much their rows disagree.

    With e, g and w as in `plane_kernels.linearize` and the vertical gradient h = M dR/dy, per px,
    of the right view, a row error r and an error of the disparity show as e = h r + g (d -
    d_true). The disparity is eliminated from the normal equations of the cell: information =
    S(h.h) - S(g.h)^2 / S(g.g) and pull = S(h.e) - S(g.h) S(g.e) / S(g.g), where S sums with the
    weight w. The cell asks for r = pull / information, px. Beside a step of the disparities, or
    nodes that have none, w is smaller: windows reach over the step there, and the disparity is
    wrong in a way of its own at each node.

    A cell has CELL x CELL nodes; every NODE_STEP-th column counts. The n-th line of cells is asked
    every CELL_STEP-th column, from turn + 2 n modulo CELL_STEP on. cells, float32 (h, ceil(w /
    CELL_STEP), 7): number of compared nodes; information, px^-2; pull, px^-1; sums of their
    misfits, columns in the right image and disparities, px; and structure, the information that
    the left view would have at all its nodes, px^-2. Structure knows no match: there the scale
    counts up to 1 only, since wrong matches raise it.

    """
    width = right_u.shape[1]
    m00, m01, m02 = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    m10, m11, m12 = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    one, two, three, half, sixth = F4(1), F4(2), F4(3), F4(0.5), F4(1 / 6)
    near, far, quarter = F4(8 / 24), F4(1 / 24), F4(0.25)  # rows lie 2 px apart
    first, last = band(k, cells.shape[0])
    for line in range(first, last):
        top = PAD + line * CELL
        bottom = min(top + CELL, PAD + rows)
        for column in range(cells.shape[1]):
            left = PAD + (column * CELL_STEP + (turn + 2 * line) % CELL_STEP) * CELL
            right = min(left + CELL, PAD + columns)
            count, total, places, depths = F4(0), F4(0), F4(0), F4(0)
            gg, gh, hh, ge, he = F4(0), F4(0), F4(0), F4(0), F4(0)
            xx, xy, yy = F4(0), F4(0), F4(0)
            for y in range(top, bottom):
                for x in range(left, right, NODE_STEP):
                    quiet = left_var[y, x]
                    lit = ((quiet < SILENT_VARIANCE) & (left_var[y, x - 1] < SILENT_VARIANCE)
                           & (left_var[y, x + 1] < SILENT_VARIANCE)
                           & (left_var[y - 1, x] < SILENT_VARIANCE)
                           & (left_var[y + 1, x] < SILENT_VARIANCE))
                    if not lit:
                        continue
                    own_u, own_v = left_u[y, x], left_v[y, x]
                    xu = quarter * (left_u[y, x + 1] - left_u[y, x - 1])
                    xv = quarter * (left_v[y, x + 1] - left_v[y, x - 1])
                    yu = quarter * (left_u[y + 1, x] - left_u[y - 1, x])
                    yv = quarter * (left_v[y + 1, x] - left_v[y - 1, x])
                    steep = xu * xu + xv * xv + yu * yu + yv * yv
                    w = one / (two * min(scale, one) * quiet + PHASE_VARIANCE * steep)
                    xx += w * (xu * xu + xv * xv)
                    xy += w * (xu * yu + xv * yv)
                    yy += w * (yu * yu + yv * yv)
                    place = F4(2 * (x - PAD)) - d[y, x]
                    if not ((place >= one) & (place < F4(width - 2))):
                        continue
                    i1 = np.int32(place)
                    t = place - F4(i1)
                    i0, i2, i3 = i1 - 1, i1 + 1, i1 + 2
                    noise = max(right_var[y, i1], right_var[y, i2])
                    around = max(max(right_var[y - 1, i1], right_var[y + 1, i1]),
                                 max(right_var[y - 2, i1], right_var[y + 2, i1]))
                    if not max(noise, around) < SILENT_VARIANCE:
                        continue
                    w0 = sixth * t * (t * (three - t) - two)
                    w1 = one + half * t * (t * (t - two) - one)
                    w2 = half * t * (two + t * (one - t))
                    w3 = sixth * t * (t * t - one)
                    g0 = sixth * (t * (F4(6) - three * t) - two)
                    g1 = half * (t * (three * t - F4(4)) - one)
                    g2 = half * (two + t * (two - three * t))
                    g3 = sixth * (three * t * t - one)
                    u0, u1, u2, u3 = (right_u[y, i0], right_u[y, i1], right_u[y, i2],
                                      right_u[y, i3])
                    v0, v1, v2, v3 = (right_v[y, i0], right_v[y, i1], right_v[y, i2],
                                      right_v[y, i3])
                    u = w0 * u0 + w1 * u1 + w2 * u2 + w3 * u3
                    v = w0 * v0 + w1 * v1 + w2 * v2 + w3 * v3
                    gu = g0 * u0 + g1 * u1 + g2 * u2 + g3 * u3
                    gv = g0 * v0 + g1 * v1 + g2 * v2 + g3 * v3
                    s = one - t
                    hu = (near * (s * (right_u[y + 1, i1] - right_u[y - 1, i1])
                                  + t * (right_u[y + 1, i2] - right_u[y - 1, i2]))
                          - far * (s * (right_u[y + 2, i1] - right_u[y - 2, i1])
                                   + t * (right_u[y + 2, i2] - right_u[y - 2, i2])))
                    hv = (near * (s * (right_v[y + 1, i1] - right_v[y - 1, i1])
                                  + t * (right_v[y + 1, i2] - right_v[y - 1, i2]))
                          - far * (s * (right_v[y + 2, i1] - right_v[y - 2, i1])
                                   + t * (right_v[y + 2, i2] - right_v[y - 2, i2])))
                    eu = own_u - (m00 * u + m01 * v + m02)
                    ev = own_v - (m10 * u + m11 * v + m12)
                    slope_u, slope_v = m00 * gu + m01 * gv, m10 * gu + m11 * gv
                    rise_u, rise_v = m00 * hu + m01 * hv, m10 * hu + m11 * hv
                    steep = (slope_u * slope_u + slope_v * slope_v
                             + rise_u * rise_u + rise_v * rise_v)
                    w = one / (scale * (quiet + noise) + PHASE_VARIANCE * steep)
                    chi = w * (eu * eu + ev * ev)
                    w = w / (one + chi / robust_misfit)
                    here = d[y, x]
                    smooth = ((abs(d[y, x - BESIDE] - here) < STEP)
                              & (abs(d[y, x + BESIDE] - here) < STEP)
                              & (abs(d[y - BESIDE, x] - here) < STEP)
                              & (abs(d[y + BESIDE, x] - here) < STEP))
                    if not smooth:
                        w = w * BESIDE_WEIGHT
                    count += one
                    total += chi
                    places += place
                    depths += d[y, x]
                    gg += w * (slope_u * slope_u + slope_v * slope_v)
                    gh += w * (slope_u * rise_u + slope_v * rise_v)
                    hh += w * (rise_u * rise_u + rise_v * rise_v)
                    ge += w * (slope_u * eu + slope_v * ev)
                    he += w * (rise_u * eu + rise_v * ev)
            share = gh / max(gg, LEAST_SLOPE)
            cells[line, column, COUNT] = count
            cells[line, column, INFORMATION] = hh - share * gh
            cells[line, column, PULL] = he - share * ge
            cells[line, column, MISFIT] = total
            cells[line, column, PLACE] = places
            cells[line, column, DISPARITY] = depths
            cells[line, column, STRUCTURE] = yy - xy * xy / max(xx, LEAST_SLOPE)


@banded(fastmath=FAST)
def moved_rows(k, places_x, places_y, seen, margin, step_x, coefficients, half_width, half_height,
               columns, lines, first, index, frac_x, frac_y):
    """
    Write where the nodes of a half grid lie in the raw image once their rows are moved.

    places_x, places_y, float32 (rows + 2 margin, w): columns and rows in the raw image of the
    nodes before they move, margin rows above and below included, px; seen, uint8: whether a raw
    image can be there. Node (j, i) has its center at column x = step_x i + 0.5, row y = 2 j + 0.5
    and moves down by r(x, y), px, see `rows.alignment`; coefficients are float32 (7,). The raw
    image has columns x lines pixels. Writes index, frac_x and frac_y of `views.half_grid_index`,
    from row PAD and column `first` on.

    """
    height, width = places_x.shape[0] - 2 * margin, places_x.shape[1]
    c0, c1, c2, c3, c4, c5, c6 = (coefficients[0], coefficients[1], coefficients[2],
                                  coefficients[3], coefficients[4], coefficients[5],
                                  coefficients[6])
    half, scale = F4(0.5), F4(1) / half_width
    right, bottom = F4(columns - 1), F4(lines - 1)
    band_first, band_last = band(k, height)
    for j in range(band_first, band_last):
        v = (F4(2 * j) + half - half_height + half) * scale
        to, to_x, to_y = index[PAD + j], frac_x[PAD + j], frac_y[PAD + j]
        for i in range(width):
            u = (F4(step_x * i) + half - half_width + half) * scale
            radius = u * u + v * v
            moved = c0 + u * (c1 + c3 * u + c4 * v) + v * (c2 + c5 * v + c6 * radius)
            at = F4(j + margin) + half * moved
            at = min(max(at, F4(0)), F4(places_x.shape[0] - 2))
            above = np.int32(at)
            t = at - F4(above)
            x = places_x[above, i] + t * (places_x[above + 1, i] - places_x[above, i])
            y = places_y[above, i] + t * (places_y[above + 1, i] - places_y[above, i])
            inside = ((seen[above, i] != 0) & (seen[above + 1, i] != 0)
                      & (x >= -ROUNDING) & (x <= right + ROUNDING)
                      & (y >= -ROUNDING) & (y <= bottom + ROUNDING))
            # box sums have their centers half a pixel right of and below their index
            x = min(max(x - half, F4(0)), right - F4(1))
            y = min(max(y - half, F4(0)), bottom - F4(1))
            i_x, i_y = np.int32(x), np.int32(y)
            to[first + i] = i_y * columns + i_x if inside else -1
            to_x[first + i] = x - F4(i_x)
            to_y[first + i] = y - F4(i_y)
