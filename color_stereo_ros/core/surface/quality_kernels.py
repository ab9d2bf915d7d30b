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
"""Kernels of the surface method: how well planes fit around a node; see `grid_kernels`."""

import math

from .bend_kernels import SPAN
from .grid_kernels import F4, FAST, PAD
from .tuning import TUNING
from ..compiled import band, banded

# Constants of `tuning`, compiled into the kernels.
REACH = TUNING.quality.reach
PULL_CAP = F4(TUNING.quality.pull_cap)
UNEVEN_CAP = F4(TUNING.quality.uneven_cap)
WORST_VARIANCE = F4(TUNING.quality.worst_variance)


@banded(fastmath=FAST)
def sample_quality(k, d, weight, moment, variance, reference, step, samples):
    """
    Measure at every step-th node how well planes fit around it.

    samples, float32 (4, h, w), takes two numbers, 1 and a height, or zeros where the
    disparity or its surroundings are unknown. First the root of (sum of pulls)^2 over the sum of
    weights, both over the nodes up to REACH away: 1 on average for noise as the weights say that
    is not shared by neighbors. A pull is moment - weight d, what a node asks for beyond its
    plane. Second the smaller of the second differences of d over SPAN nodes along rows and along
    columns, px: those of an error, since few surfaces bend both ways. Both are capped. The height
    is the range of d over the nodes up to REACH away, px.

    """
    first, last = band(k, samples.shape[1])
    for row in range(first, last):
        y = PAD + row * step + step // 2
        for column in range(samples.shape[2]):
            x = PAD + column * step + step // 2
            total, pulls = F4(0), F4(0)
            low = high = d[y, x]
            for j in range(y - REACH, y + REACH + 1):
                for i in range(x - REACH, x + REACH + 1):
                    w, near = weight[j, i], d[j, i]
                    low = near if near < low else low
                    high = near if near > high else high
                    asked = moment[j, i] - w * (near - reference)
                    total += w if asked == asked else F4(0)
                    pulls += asked if asked == asked else F4(0)
            center = F4(2) * d[y, x]
            across = abs(d[y, x - SPAN] + d[y, x + SPAN] - center)
            along = abs(d[y - SPAN, x] + d[y + SPAN, x] - center)
            bend = across if across < along else along
            known = ((across >= F4(0)) & (along >= F4(0)) & (total > F4(0))
                     & (variance[y, x] < WORST_VARIANCE))
            root = abs(pulls) / math.sqrt(total if known else F4(1))
            samples[0, row, column] = min(root, PULL_CAP) if known else F4(0)
            samples[1, row, column] = min(bend, UNEVEN_CAP) if known else F4(0)
            samples[2, row, column] = F4(1) if known else F4(0)
            samples[3, row, column] = high - low if known else F4(0)
