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
"""The kernel that corrects the colors of a raw image by a color calibration."""

import numpy as np

from .compiled import band, banded

F4, U1 = np.float32, np.uint8


@banded()
def correct_colors(k, image, light, gain, matrix, saturation, pedestal, ceiling, saturated, out):
    """
    Correct an image pixel by pixel: out = pedestal + matrix (gain x light[image]), rounded.

    Parameters
    ----------
    k : int
        The band of rows.
    image, out : uint8 (H, W, 3), RGB
        Raw and corrected colors.
    light : float32 (3, 256)
        What each number of a channel means in light.
    gain : float32 (H, W, 3)
        Of each pixel and channel, 1 where the lens is brightest.
    matrix : float32 (3, 3)
        To DN of the result.
    saturation, saturated : int
        Number from which a channel is overexposed, and what it becomes.
    pedestal : float32
        Result without light, DN, so that noise is not clipped.
    ceiling : float32
        Largest result of a channel that is not overexposed, DN.

    """
    first, last = band(k, image.shape[0])
    m00, m01, m02 = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    m10, m11, m12 = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    m20, m21, m22 = matrix[2, 0], matrix[2, 1], matrix[2, 2]
    offset = pedestal + F4(0.5)
    most = ceiling + F4(0.5)
    for y in range(first, last):
        for x in range(image.shape[1]):
            red, green, blue = image[y, x, 0], image[y, x, 1], image[y, x, 2]
            r = light[0, red] * gain[y, x, 0]
            g = light[1, green] * gain[y, x, 1]
            b = light[2, blue] * gain[y, x, 2]
            new_r = m00 * r + m01 * g + m02 * b + offset
            new_g = m10 * r + m11 * g + m12 * b + offset
            new_b = m20 * r + m21 * g + m22 * b + offset
            out[y, x, 0] = saturated if red >= saturation else U1(
                min(max(new_r, F4(0)), most))
            out[y, x, 1] = saturated if green >= saturation else U1(
                min(max(new_g, F4(0)), most))
            out[y, x, 2] = saturated if blue >= saturation else U1(
                min(max(new_b, F4(0)), most))
