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
"""Colors that several patterns are made of."""

import numpy as np


def constant_sum_colors(hue):
    """
    Return colors of uniform brightness, one component zero (paper, fig. 2.2 right).

    Parameters
    ----------
    hue : numpy.ndarray, shape (...)
        0 = red, 1 = green, 2 = blue, 3 = red again; any real number.

    Returns
    -------
    colors : numpy.ndarray, float64, shape (..., 3)
        Components 0..1 whose sum is 1.

    """
    distance = np.abs((hue[..., None] - np.arange(3.0) + 1.5) % 3.0 - 1.5)
    return np.maximum(0.0, 1.0 - distance)


def sweep_hue(settings):
    """Return the hue of each projector column, shape (width,): `cycles` turns over the width."""
    return 3.0 * settings.cycles * np.arange(settings.width) / settings.width
