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
"""Three sines, one per component (paper, sec. 2.1)."""

import numpy as np

from .colors import sweep_hue
from .pattern import Pattern, Repeats


def make(settings):
    """Return three sines, shifted by a third of a period, (width, 3)."""
    phase = 2.0 * np.pi / 3.0 * (sweep_hue(settings)[:, None] - np.arange(3.0))
    return 0.5 + 0.5 * np.cos(phase)


PATTERN = Pattern('three phase-shifted sines', make, Repeats.CYCLES, uniform_brightness=True)
