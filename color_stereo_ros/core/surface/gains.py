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
"""What the colors of a pair tell before any match: channel gains, and how noise looks."""

import cv2
import numpy as np

from .grid_kernels import F4


def channel_gains(levels, color, tuning, images):
    """
    Return the gains of the channels of both cameras, float32 (2, 3).

    Parameters
    ----------
    levels : sequence of two (dark, mean)
        Of left and right, float32 (3,) each: dark level and mean above it, DN.
    color : ColorSettings
        The group `color` of the settings.
    tuning : ViewTuning
        Constants of this stage.
    images : sequence of two numpy.ndarray, uint8, shape (H, W, 3)
        Left and right.

    """
    if not color.equalize:
        return np.ones((2, 3), F4)
    means = [mean for _, mean in levels]
    unlike = color.equalize_cameras == 'automatic' and blocks_differ(levels, tuning, images)
    if not unlike and same_cameras(means, color.equalize_cameras, tuning):
        # the two may see different parts of the pattern
        means = [0.5 * (means[0] + means[1])] * 2
    return gains_of(means, tuning)


def same_cameras(means, choice, tuning):
    """
    Return whether both cameras get the same gains.

    means (DN) are those of left and right; choice is `color.equalize_cameras`.

    Every part of an aperiodic pattern holds all hues alike. Under such a pattern, a difference of
    the channel means is one of the cameras. Under other patterns the cameras may see different
    parts.

    """
    if choice != 'automatic':
        return choice == 'shared'
    offset = F4(tuning.channel_offset)
    balance = np.log((means[0] + offset) / (means[1] + offset))
    return np.ptp(balance) < tuning.same_camera_balance


def blocks_differ(levels, tuning, images):
    """
    Return whether the color balance of two cameras differs by more than that of parts of images.

    Where every block of both images holds many cycles of the pattern, the blocks have nearly one
    balance, and a difference of the images is one of the cameras. Where the blocks have many
    balances, nothing can be said.

    """
    columns, rows = tuning.balance_blocks
    if not columns:
        return False
    means, spreads = [], []
    for (dark, _), image in zip(levels, images):
        blocks = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
        light = np.maximum(blocks.reshape(-1, 3) - dark, 0)
        light = light[light.sum(axis=1) > tuning.least_block]
        if len(light) < tuning.least_blocks:
            return False
        balance = np.log(light + tuning.channel_offset)
        balance -= balance.mean(axis=1, keepdims=True)
        means.append(np.median(balance, axis=0))
        spreads.append(balance.std(axis=0))
    difference = means[0] - means[1]
    sure = np.abs(difference) > tuning.sure_blocks * np.maximum(*spreads)
    return np.ptp(difference) > tuning.block_difference and bool(sure.any())


def gains_of(means, tuning):
    """
    Return the gains of the channels of both cameras, float32 (2, 3), from their means (DN).

    They make the cameras alike, and the channels half as unequal as they are (of logarithms).
    Without gains, the hues of a weak channel count for little. Full gains amplify its noise.

    """
    means = np.array(means, np.float64) + tuning.channel_offset
    balance = means / means.mean(axis=1, keepdims=True)
    common = np.sqrt(balance[0] * balance[1])
    return np.clip(np.sqrt(common) / balance, *tuning.channel_gain_limits).astype(F4)
