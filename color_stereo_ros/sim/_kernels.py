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
"""Inner loops of the simulated rig: pattern look-up and edge-aware smoothing."""

from ..core.compiled import parallel, prange, serial


@serial(error_model='python')
def project_pattern(stack, level, column, row, weight, pixel, image):
    """
    Add weight * pattern(column, row) of every sample to the sum of its camera pixel.

    Parameters
    ----------
    stack : numpy.ndarray, float32, shape (L, H, W, 3)
        The pattern, blurred more from level to level.
    level, column, row : numpy.ndarray, float32, shape (N,)
        Place in the stack; linear interpolation; inside the pattern by half a pixel at most.
    weight : numpy.ndarray, float32, shape (N, 3)
        Radiance that each channel of the pattern at 1 causes.
    pixel : numpy.ndarray, int32, shape (N,)
        Flat index into the image.
    image : numpy.ndarray, float64, shape (H' W', 3)
        Written.

    """
    levels, height, width, _ = stack.shape
    for i in range(pixel.size):
        x = min(max(column[i], 0.0), width - 1.0)
        y = min(max(row[i], 0.0), height - 1.0)
        z = min(max(level[i], 0.0), levels - 1.0)
        x0, y0, z0 = int(x), int(y), int(z)
        x1, y1, z1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1), min(z0 + 1, levels - 1)
        fx, fy, fz = x - x0, y - y0, z - z0
        for c in range(3):
            near = ((stack[z0, y0, x0, c] * (1 - fx) + stack[z0, y0, x1, c] * fx) * (1 - fy)
                    + (stack[z0, y1, x0, c] * (1 - fx) + stack[z0, y1, x1, c] * fx) * fy)
            if fz > 0:
                far = ((stack[z1, y0, x0, c] * (1 - fx) + stack[z1, y0, x1, c] * fx) * (1 - fy)
                       + (stack[z1, y1, x0, c] * (1 - fx) + stack[z1, y1, x1, c] * fx) * fy)
                near = near * (1 - fz) + far * fz
            image[pixel[i], c] += weight[i, c] * near


@serial(error_model='python')
def accumulate(values, pixel, total, count):
    """
    Sum the samples of every pixel and count them.

    Parameters
    ----------
    values : numpy.ndarray, float32, shape (N, C)
        What the rays bring.
    pixel : numpy.ndarray, int32, shape (N,)
        Flat index of the pixel, -1 = none.
    total : numpy.ndarray, float64, shape (P, C)
        Written.
    count : numpy.ndarray, int64, shape (P,)
        Written.

    """
    for i in range(pixel.size):
        if pixel[i] >= 0:
            count[pixel[i]] += 1
            for c in range(values.shape[1]):
                total[pixel[i], c] += values[i, c]


@parallel(error_model='python')
def smooth_on_surfaces(light, normal, position, radius, spread, result):
    """
    Average light over neighbors that lie on the same smooth surface.

    Parameters
    ----------
    light, normal, position : numpy.ndarray, float32, shape (H, W, 3)
        A normal of length 0 marks the background.
    radius : int
        Half window, px.
    spread : float
        Distance from the tangent plane, m, at which a neighbor counts half.
    result : numpy.ndarray, float32, shape (H, W, 3)
        Written.

    """
    height, width, _ = light.shape
    for y in prange(height):
        for x in range(width):
            nx, ny, nz = normal[y, x, 0], normal[y, x, 1], normal[y, x, 2]
            total, red, green, blue = 0.0, 0.0, 0.0, 0.0
            for j in range(max(0, y - radius), min(height, y + radius + 1)):
                for i in range(max(0, x - radius), min(width, x + radius + 1)):
                    alike = nx * normal[j, i, 0] + ny * normal[j, i, 1] + nz * normal[j, i, 2]
                    if alike < 0.7:
                        continue
                    away = (nx * (position[j, i, 0] - position[y, x, 0])
                            + ny * (position[j, i, 1] - position[y, x, 1])
                            + nz * (position[j, i, 2] - position[y, x, 2])) / spread
                    share = alike ** 8 / (1.0 + away * away)
                    total += share
                    red += share * light[j, i, 0]
                    green += share * light[j, i, 1]
                    blue += share * light[j, i, 2]
            if total > 0:
                result[y, x, 0] = red / total
                result[y, x, 1] = green / total
                result[y, x, 2] = blue / total
            else:
                for c in range(3):
                    result[y, x, c] = light[y, x, c]
