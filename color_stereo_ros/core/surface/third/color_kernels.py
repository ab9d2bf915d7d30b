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
"""Kernels of the colors: what camera and surfaces make of the light of the pattern."""

import math

import numpy as np

from .tuning import TUNING
from ..grid_kernels import F4, FAST
from ...compiled import band, banded, LENGTH, part, serial, stack_row

F8 = np.float64
ROOT3 = F4(math.sqrt(3.0))
# Constants of `tuning`, compiled into the kernels.
MOST_RADIUS = max(radius // thin for radius, thin in zip(TUNING.color.radii,
                                                         TUNING.color.thinnings))
ROBUST_MISFIT = F4(TUNING.color.robust_misfit)


@part(fastmath=FAST)
def exponential(x):
    """Return exp(x), |x| < 4, to 1e-6 of it: (exp(x / 32))^32 with a polynomial."""
    x = x * F4(1 / 32)
    power = F4(1) + x * (F4(1) + x * (F4(1 / 2) + x * (F4(1 / 6) + x * F4(1 / 24))))
    power *= power
    power *= power
    power *= power
    power *= power
    return power * power


@part(fastmath=FAST)
def logarithm(x):
    """Return log(x), .005 < x < 200, to 1e-4: 8 log(x^(1/8)), by the series of artanh."""
    root = math.sqrt(math.sqrt(math.sqrt(x)))
    z = (root - F4(1)) / (root + F4(1))
    q = z * z
    return F4(16) * z * (F4(1) + q * (F4(1 / 3) + q * (F4(1 / 5) + q * F4(1 / 7))))


@serial(fastmath=FAST)
def color_equations(u, v, light, weight, colors, least_total, normal):
    """
    Write the matrix of the least squares of `colors.fitted_colors`, float64 (12, 12).

    u, v, weight (N,), light float32 (3, N). A color counts by its weight over the square of its
    brightness under colors, float64 (3, 4), at least least_total.

    """
    normal[:] = 0.0
    for n in range(u.size):
        p = F8(light[0, n]), F8(light[1, n]), F8(light[2, n]), 1.0
        total = 0.0
        for i in range(3):
            for j in range(4):
                total += colors[i, j] * p[j]
        total = max(total, least_total)
        size = weight[n] / (total * total)
        by_u = u[n] - 2.0, u[n] + 1.0, u[n] + 1.0
        by_v = F8(v[n]), v[n] - math.sqrt(3.0), v[n] + math.sqrt(3.0)
        for i in range(3):
            for j in range(i, 3):
                factor = size * (by_u[i] * by_u[j] + by_v[i] * by_v[j])
                for k in range(4):
                    for m in range(4):
                        normal[4 * i + k, 4 * j + m] += factor * p[k] * p[m]
    for i in range(12):
        for j in range(i):
            normal[i, j] = normal[j, i]


@serial(fastmath=FAST)
def mixed_errors(u, v, light, colors, least_light, error):
    """Write the squared errors of chromaticities (N,) under colors, float64 (3, 4)."""
    for n in range(u.size):
        p, q, o = F8(light[0, n]), F8(light[1, n]), F8(light[2, n])
        r = colors[0, 0] * p + colors[0, 1] * q + colors[0, 2] * o + colors[0, 3]
        g = colors[1, 0] * p + colors[1, 1] * q + colors[1, 2] * o + colors[1, 3]
        b = colors[2, 0] * p + colors[2, 1] * q + colors[2, 2] * o + colors[2, 3]
        share = 1.0 / max(r + g + b, least_light)
        error_u = u[n] - (2.0 * r - g - b) * share
        error_v = v[n] - math.sqrt(3.0) * (g - b) * share
        error[n] = error_u * error_u + error_v * error_v


@banded(fastmath=FAST)
def color_slopes(k, u, v, variance, light, known, colors, change, sums):
    """
    Write what known nodes ask of the changes of their color; see `colors.local_light`.

    sums, float32 (9, h, w): the upper triangle of the normal equations, their right sides; 0 where
    the place is unknown. change, float32 (3, h, w): logarithms.

    """
    rows, columns = u.shape
    first, last = band(k, rows)
    two, one = F4(2), F4(1)
    for row in range(first, last):
        for column in range(columns):
            there = known[row, column]
            p = light[0, row, column] if there else one
            q = light[1, row, column] if there else one
            o = light[2, row, column] if there else one
            r = colors[0, 0] * p + colors[0, 1] * q + colors[0, 2] * o + colors[0, 3]
            g = colors[1, 0] * p + colors[1, 1] * q + colors[1, 2] * o + colors[1, 3]
            b = colors[2, 0] * p + colors[2, 1] * q + colors[2, 2] * o + colors[2, 3]
            r *= exponential(change[0, row, column])
            b *= exponential(change[1, row, column])
            gray = exponential(change[2, row, column])
            share = one / (r + g + b)
            bare_u, bare_v = (two * r - g - b) * share, ROOT3 * (g - b) * share
            own_u, own_v = gray * bare_u, gray * bare_v
            error_u, error_v = u[row, column] - own_u, v[row, column] - own_v
            noise = variance[row, column]
            chi = (error_u * error_u + error_v * error_v) / noise
            w = one / (noise * (one + chi / ROBUST_MISFIT)) if there else F4(0)
            red_u, red_v = gray * r * (two - bare_u) * share, -own_v * r * share
            blue_u = -gray * b * (one + bare_u) * share
            blue_v = -gray * b * (ROOT3 + bare_v) * share
            sums[0, row, column] = w * (red_u * red_u + red_v * red_v)
            sums[1, row, column] = w * (red_u * blue_u + red_v * blue_v)
            sums[2, row, column] = w * (red_u * own_u + red_v * own_v)
            sums[3, row, column] = w * (blue_u * blue_u + blue_v * blue_v)
            sums[4, row, column] = w * (blue_u * own_u + blue_v * own_v)
            sums[5, row, column] = w * (own_u * own_u + own_v * own_v)
            sums[6, row, column] = w * (red_u * error_u + red_v * error_v)
            sums[7, row, column] = w * (blue_u * error_u + blue_v * error_v)
            sums[8, row, column] = w * (own_u * error_u + own_v * error_v)


@banded(fastmath=FAST)
def window_means(k, planes, radius, out):
    """
    Write means over windows, 2 radius + 1 nodes wide, of planes, float32 (N, h, w).

    What lies outside counts as 0. The radius is at most MOST_RADIUS.

    """
    count, rows, columns = planes.shape
    first, last = band(k, rows)
    side = 2 * radius + 1
    share = F4(1) / F4(side * side)
    sums, length = stack_row(), LENGTH - 2 * MOST_RADIUS
    for plane in range(count):
        for row in range(first, last):
            for start in range(0, columns, length):
                size = min(length, columns - start)
                left = max(start - radius, 0)
                width, shift = min(start + size + radius, columns) - left, left - start + radius
                for x in range(size + 2 * radius):
                    sums[x] = F4(0)
                for y in range(max(row - radius, 0), min(row + radius + 1, rows)):
                    told, into = planes[plane, y, left:left + width], sums[shift:shift + width]
                    for x in range(width):
                        into[x] += told[x]
                mean = out[plane, row, start:start + size]
                for x in range(size):
                    mean[x] = sums[x]
                for i in range(1, side):
                    beside = sums[i:i + size]
                    for x in range(size):
                        mean[x] += beside[x]
                for x in range(size):
                    mean[x] *= share


@banded(fastmath=FAST)
def solve_changes(k, sums, hold, limits, change):
    """
    Add what the windows ask for to the changes, float32 (3, h, w), and keep these within limits.

    sums as `color_slopes` writes them, averaged over windows. hold is added to the diagonal.
    limits float32 (3, 2).

    """
    rows, columns = change.shape[1:]
    first, last = band(k, rows)
    for row in range(first, last):
        for column in range(columns):
            # Cramer's rule for the symmetric 3 x 3 system
            a, b, c = sums[0, row, column] + hold, sums[1, row, column], sums[2, row, column]
            d, e, f = sums[3, row, column] + hold, sums[4, row, column], (
                sums[5, row, column] + hold)
            x, y, z = sums[6, row, column], sums[7, row, column], sums[8, row, column]
            i00, i01, i02 = d * f - e * e, c * e - b * f, b * e - c * d
            i11, i12, i22 = a * f - c * c, b * c - a * e, a * d - b * b
            inverse = F4(1) / (a * i00 + b * i01 + c * i02)
            red = change[0, row, column] + (i00 * x + i01 * y + i02 * z) * inverse
            blue = change[1, row, column] + (i01 * x + i11 * y + i12 * z) * inverse
            gray = change[2, row, column] + (i02 * x + i12 * y + i22 * z) * inverse
            change[0, row, column] = min(max(red, limits[0, 0]), limits[0, 1])
            change[1, row, column] = min(max(blue, limits[1, 0]), limits[1, 1])
            change[2, row, column] = min(max(gray, limits[2, 0]), limits[2, 1])


@banded(fastmath=FAST)
def color_errors(k, u, v, variance, light, known, colors, change, error):
    """Write the squared error of the changed colors over the variance; 0 where unknown."""
    rows, columns = u.shape
    first, last = band(k, rows)
    for row in range(first, last):
        for column in range(columns):
            there = known[row, column]
            p = light[0, row, column] if there else F4(1)
            q = light[1, row, column] if there else F4(1)
            o = light[2, row, column] if there else F4(1)
            r = colors[0, 0] * p + colors[0, 1] * q + colors[0, 2] * o + colors[0, 3]
            g = colors[1, 0] * p + colors[1, 1] * q + colors[1, 2] * o + colors[1, 3]
            b = colors[2, 0] * p + colors[2, 1] * q + colors[2, 2] * o + colors[2, 3]
            r *= exponential(change[0, row, column])
            b *= exponential(change[1, row, column])
            gray = exponential(change[2, row, column]) / (r + g + b)
            error_u = u[row, column] - gray * (F4(2) * r - g - b)
            error_v = v[row, column] - gray * ROOT3 * (g - b)
            square = (error_u * error_u + error_v * error_v) / variance[row, column]
            error[row, column] = square if there else F4(0)
