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
"""Lines of high contrast (paper, fig. 2.1 left)."""

import numpy as np

from .colors import constant_sum_colors
from .pattern import Pattern


def make(settings):
    """
    Return columns of high contrast, (width, 3).

    From line to line the hue jumps half around the circle and returns, so that every second line
    follows the constant-sum sweep.

    """
    line = np.floor(np.arange(settings.width) / settings.feature_size)
    slow = 3.0 * settings.cycles * line * settings.feature_size / settings.width
    return constant_sum_colors(slow + 1.5 * (line % 2))


PATTERN = Pattern('high-contrast lines (paper fig. 2.1 left)', make, uniform_brightness=True)
