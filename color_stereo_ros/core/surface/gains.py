# SPDX-License-Identifier: Apache-2.0
"""What the colors of a pair tell before any match: channel gains, and how noise looks."""

import cv2
import numpy as np

from .grid_kernels import F4


def channel_gains(levels, color, tuning):
    """
    Return the gains of the channels of both cameras, float32 (2, 3).

    Parameters
    ----------
    levels : sequence of two (dark, mean)
        Of left and right, float32 (3,) each: dark level and mean above it, DN.
    color : ColorSettings
    tuning : ViewTuning

    """
    if not color.equalize:
        return np.ones((2, 3), F4)
    means = [mean for _, mean in levels]
    if same_cameras(means, color.equalize_cameras, tuning):
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


def noise_weight(image, tuning):
    """
    Return the weight that mere noise has at a node of an image, uint8 (H, W, 3).

    The noise of a single-chip camera changes slowly from pixel to pixel, since demosaicing
    interpolates. The noise of other cameras, and that of gray images without any pattern, is
    independent from pixel to pixel: its gradients are steeper.

    """
    demosaiced, independent = tuning.noise_weights
    first, step = tuning.noise_rows
    rows = image[first::step]
    if rows.shape[0] == 0 or rows.shape[1] < 3:
        return independent
    near, far = (cv2.norm(rows[:, step:], rows[:, :-step], cv2.NORM_L1) / (rows.shape[1] - step)
                 for step in (1, 2))
    low, high = tuning.noise_steps
    share = np.clip((near / max(far, tuning.least_change) - low) / (high - low), 0, 1)
    return demosaiced + share * (independent - demosaiced)
