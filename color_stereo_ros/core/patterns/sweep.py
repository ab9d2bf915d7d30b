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
"""A turn through the hues at constant brightness (paper, fig. 2.2 right)."""

from .colors import constant_sum_colors, sweep_hue
from .pattern import Pattern, Repeats


def make(settings):
    """Return a constant-sum turn through the hues, (width, 3)."""
    return constant_sum_colors(sweep_hue(settings))


PATTERN = Pattern('all hues in turn, uniform brightness (paper fig. 2.2 right)', make,
                  Repeats.CYCLES, uniform_brightness=True)
