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
"""Kernel of the projector's geometry: patches of the image are placed in the pattern."""

import numpy as np

from .tuning import TUNING
from ..compiled import part, serial, stack_array

F4 = np.float32
FAST = {'nsz', 'arcp', 'contract', 'afn', 'reassoc'}
HALF = TUNING.patches.half
SIDE = 2 * HALF + 1
COUNT = SIDE * SIDE
DARK = F4(TUNING.patches.dark)
SINGULAR = TUNING.patches.singular
SETTLED = TUNING.patches.settled
VALUES = 8  # of the image and of the pattern: two colors each; four derivatives of the pattern
stack_patch = stack_array(F4, VALUES, COUNT)
stack_sums = stack_array(np.float64, 16)


@part(fastmath=FAST)
def read_image(image, column, row, values):
    """Write the two chromaticities of the patch around a pixel into values[0] and values[1]."""
    at = 0
    for y in range(row - HALF, row + HALF + 1):
        for x in range(column - HALF, column + HALF + 1):
            r, g, b = F4(image[y, x, 0]), F4(image[y, x, 1]), F4(image[y, x, 2])
            share = F4(1) / (r + g + b + DARK)
            values[0, at] = (r - g) * share
            values[1, at] = (b - F4(0.5) * (r + g)) * share
            at += 1


@part(fastmath=FAST)
def read_pattern(pattern, u, v, affine, values):
    """
    Write colors of the pattern and their slopes along u and v into values[2:8].

    Return whether the whole patch lies inside the pattern.

    """
    height, width = pattern.shape[:2]
    at = 0
    for j in range(-HALF, HALF + 1):
        for i in range(-HALF, HALF + 1):
            column = u + affine[0, 0] * i + affine[0, 1] * j
            row = v + affine[1, 0] * i + affine[1, 1] * j
            if not (column >= 0 and row >= 0 and column < width - 1 and row < height - 1):
                return False
            x, y = int(column), int(row)
            fx, fy = F4(column - x), F4(row - y)
            for c in range(2):
                above, below = pattern[y, x, c], pattern[y + 1, x, c]
                step = pattern[y, x + 1, c] - above
                lower = pattern[y + 1, x + 1, c] - below
                top, bottom = above + fx * step, below + fx * lower
                values[2 + c, at] = top + fy * (bottom - top)
                values[4 + c, at] = step + fy * (lower - step)
                values[6 + c, at] = bottom - top
            at += 1
    return True


@part(fastmath=FAST)
def without_mean(values):
    """Subtract from each row of the patch its mean."""
    for k in range(VALUES):
        row = values[k]
        total = F4(0)
        for at in range(COUNT):
            total += row[at]
        mean = total / F4(COUNT)
        for at in range(COUNT):
            row[at] -= mean


@part(fastmath=FAST)
def color_matrix(values, sums):
    """
    Write the 2 x 2 matrix from colors of the pattern to those of the image into sums[0:4].

    Least squares. Return whether the pattern has two colors that vary.

    """
    p00, p01, p11 = 0.0, 0.0, 0.0
    q00, q01, q10, q11 = 0.0, 0.0, 0.0, 0.0
    for at in range(COUNT):
        i0, i1, p0, p1 = values[0, at], values[1, at], values[2, at], values[3, at]
        p00 += p0 * p0
        p01 += p0 * p1
        p11 += p1 * p1
        q00 += i0 * p0
        q01 += i0 * p1
        q10 += i1 * p0
        q11 += i1 * p1
    determinant = p00 * p11 - p01 * p01
    if not determinant > SINGULAR * p00 * p11:
        return False
    sums[0] = (q00 * p11 - q01 * p01) / determinant
    sums[1] = (q01 * p00 - q00 * p01) / determinant
    sums[2] = (q10 * p11 - q11 * p01) / determinant
    sums[3] = (q11 * p00 - q10 * p01) / determinant
    return True


@part(fastmath=FAST)
def normal_equations(values, sums):
    """
    Write the sums of Gauss and Newton's step into sums[4:11].

    Its matrix (3 numbers), its right side (2), the squares of the residuals, those of the image.

    """
    m00, m01, m10, m11 = F4(sums[0]), F4(sums[1]), F4(sums[2]), F4(sums[3])
    n00, n01, n11, r0, r1, left, all_of_it = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for at in range(COUNT):
        i0, i1, p0, p1 = values[0, at], values[1, at], values[2, at], values[3, at]
        e0 = i0 - m00 * p0 - m01 * p1
        e1 = i1 - m10 * p0 - m11 * p1
        u0 = m00 * values[4, at] + m01 * values[5, at]
        u1 = m10 * values[4, at] + m11 * values[5, at]
        v0 = m00 * values[6, at] + m01 * values[7, at]
        v1 = m10 * values[6, at] + m11 * values[7, at]
        n00 += u0 * u0 + u1 * u1
        n01 += u0 * v0 + u1 * v1
        n11 += v0 * v0 + v1 * v1
        r0 += u0 * e0 + u1 * e1
        r1 += v0 * e0 + v1 * e1
        left += e0 * e0 + e1 * e1
        all_of_it += i0 * i0 + i1 * i1
    sums[4], sums[5], sums[6] = n00, n01, n11
    sums[7], sums[8], sums[9], sums[10] = r0, r1, left, all_of_it


@part()
def project(x, y, z, camera, turn, shift, distortion):
    """Return column and row of the pattern that light a point; NaN behind the projector."""
    a = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + shift[0]
    b = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + shift[1]
    c = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + shift[2]
    inverse = 1 / c if c > 0 else np.nan
    a, b = a * inverse, b * inverse
    stretch = 1 + distortion * (a * a + b * b)
    return (stretch * (camera[0, 0] * a + camera[0, 1] * b) + camera[0, 2],
            stretch * camera[1, 1] * b + camera[1, 2])


@serial()
def predict_patches(points, slopes, camera, turn, shift, distortion, places, affines):
    """
    Write where in the pattern some patches of the image should lie, and how they move there.

    points float64 (N, 3), m; slopes float64 (N, 2, 3), m per px along columns and rows; camera,
    turn, shift and distortion as in a ProjectorModel. places float64 (N, 2), px of the pattern;
    affines float64 (N, 2, 2), pattern px per px of the image.

    """
    for n in range(points.shape[0]):
        x, y, z = points[n]
        places[n, 0], places[n, 1] = project(x, y, z, camera, turn, shift, distortion)
        for axis in range(2):
            i, j, k = slopes[n, axis]
            u1, v1 = project(x + i, y + j, z + k, camera, turn, shift, distortion)
            u0, v0 = project(x - i, y - j, z - k, camera, turn, shift, distortion)
            affines[n, 0, axis], affines[n, 1, axis] = (u1 - u0) / 2, (v1 - v0) / 2


@serial()
def choose_sites(depth, confidence, rows, columns, reach, scale, least, bend, tilt, pixels,
                 inverse):
    """
    Write the pixels of a grid whose surface is smooth; return how many there are.

    depth, m, and confidence are float32 (H, W); rows and columns int64. pixels, int32 (N, 2),
    takes column and row, inverse, float64 (N, 5), 1 / depth there and `reach` px to the left,
    right, above and below. scale, px m, takes 1 / depth to disparities: these bend by less than
    bend, px, and lean by less than tilt, px per px. The confidence is above least.

    """
    count = 0
    for y in rows:
        for x in columns:
            if not confidence[y, x] > least:
                continue
            here = 1 / np.float64(depth[y, x])
            before, after = 1 / np.float64(depth[y, x - reach]), 1 / np.float64(
                depth[y, x + reach])
            above, below = 1 / np.float64(depth[y - reach, x]), 1 / np.float64(
                depth[y + reach, x])
            if (abs(before + after - 2 * here) * scale < bend
                    and abs(above + below - 2 * here) * scale < bend
                    and abs(after - before) * scale < 2 * reach * tilt
                    and abs(below - above) * scale < 2 * reach * tilt):
                pixels[count, 0], pixels[count, 1] = x, y
                inverse[count, 0], inverse[count, 1], inverse[count, 2] = here, before, after
                inverse[count, 3], inverse[count, 4] = above, below
                count += 1
    return count


@serial(fastmath=FAST)
def place_patches(image, pattern, pixels, places, affines, rounds, farthest, result):
    """
    Find where in the pattern the patches around some pixels lie (Lucas and Kanade 1981).

    image uint8 (H, W, 3), RGB; pattern float32 (H', W', 2), chromaticities; pixels int32 (N, 2),
    column and row, at least HALF from the border; places float64 (N, 2), the starts, px of the
    pattern; affines float64 (N, 2, 2), pattern px per px of the image.

    Each chromaticity of the patch is a mix of both of the pattern, which is fitted anew in every
    round; the last round is the one whose step is below SETTLED.

    result, float64 (N, 4): column and row, px of the pattern; standard deviation of either, px;
    share of the variance of the colors that the pattern explains. NaN where the patch leaves the
    pattern, moves by more than `farthest` px, or has no structure.

    Serial: a search runs in a thread of its own, beside the parallel kernels of a method, and
    numba does not allow two of these at once.

    """
    values, sums = stack_patch(), stack_sums()
    freedom = 2 * COUNT - 8
    for n in range(pixels.shape[0]):
        result[n, :] = np.nan
        read_image(image, pixels[n, 0], pixels[n, 1], values)
        u, v = places[n, 0], places[n, 1]
        good = True
        for turn in range(rounds + 1):
            good = read_pattern(pattern, u, v, affines[n], values)
            if good:
                without_mean(values)
                good = color_matrix(values, sums)
            if not good:
                break
            normal_equations(values, sums)
            determinant = sums[4] * sums[6] - sums[5] * sums[5]
            good = determinant > SINGULAR * sums[4] * sums[6]
            if not good or turn == rounds:
                break
            step_u = (sums[6] * sums[7] - sums[5] * sums[8]) / determinant
            step_v = (sums[4] * sums[8] - sums[5] * sums[7]) / determinant
            u += step_u
            v += step_v
            good = abs(u - places[n, 0]) < farthest and abs(v - places[n, 1]) < farthest
            if not good or abs(step_u) + abs(step_v) < SETTLED:
                break
        if good:
            variance = sums[9] / freedom * (sums[4] + sums[6]) / (2 * determinant)
            result[n, 0], result[n, 1] = u, v
            result[n, 2] = np.sqrt(variance)
            result[n, 3] = 1 - sums[9] / sums[10]
