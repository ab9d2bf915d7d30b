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
"""Three Walsh functions, one per component (paper, sec. 2.1)."""

import numpy as np

from .pattern import Pattern


def make(settings):
    """
    Return three Walsh functions, (width, 3).

    The width is cut into 2^n segments of at least feature_size px. Function j is -1 to the number
    of bits that segment number and j share; red takes every third bit from the first on, green
    from the second, blue from the third, so that red is the fastest.

    """
    bits = max(3, int(np.log2(settings.width / settings.feature_size)))
    segments = np.arange(settings.width) * 2 ** bits // settings.width
    every_third = [sum(1 << bit for bit in range(first, bits, 3)) for first in range(3)]
    return np.stack([1.0 - parity(segments & mask) for mask in every_third], axis=-1)


def parity(numbers):
    """Return 1 where a non-negative number below 2^16 has an odd count of set bits."""
    for shift in (8, 4, 2, 1):
        numbers = numbers ^ (numbers >> shift)
    return numbers & 1


PATTERN = Pattern('three Walsh functions, one a channel (paper sec. 2.1)', make)
