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
"""Inner loop of the stress test: resampling without the rounding of fixed-point maps."""

from ...core.compiled import part, serial


@part()
def cubic(distance):
    """Return the weight of a sample so many samples away."""
    away = abs(distance)
    if away < 1:
        return 1 + away * away * (1.5 * away - 2.5)
    if away < 2:
        return 2 + away * (-4 + away * (2.5 - 0.5 * away))
    return 0.0


@serial(error_model='python')
def bicubic(image, column, row, result):
    """
    Resample an image by cubic convolution (Keys, a = -1/2).

    Parameters
    ----------
    image : numpy.ndarray, float32, shape (H, W, C)
        What is sampled.
    column, row : numpy.ndarray, float64, shape (N,)
        Places, px.
    result : numpy.ndarray, float32, shape (N, C)
        Written and returned; 0 where the image does not reach, never negative.

    """
    height, width, channels = image.shape
    for i in range(column.size):
        x, y = int(column[i] // 1), int(row[i] // 1)
        inside = 1 <= x <= width - 3 and 1 <= y <= height - 3
        fx, fy = column[i] - x, row[i] - y
        for c in range(channels):
            total = 0.0
            if inside:
                for j in range(-1, 3):
                    line = 0.0
                    for k in range(-1, 3):
                        line += cubic(fx - k) * image[y + j, x + k, c]
                    total += cubic(fy - j) * line
            result[i, c] = max(total, 0.0)
    return result
