# SPDX-License-Identifier: Apache-2.0
"""What the colors of a pair tell before any match: channel gains, and how noise looks."""

import cv2
import numpy as np

from ..patterns.expectation import APERIODIC
from .grid_kernels import F4

NOISE_WEIGHTS = 0.15, 1.0  # of a node that shows only noise: demosaiced, independent
INDEPENDENT = 0.85, 0.95   # change to the next pixel / to the next but one: see noise_weight
SAME_BALANCE = 0.12  # of logarithms: cameras of one type under an aperiodic pattern


def channel_gains(levels, settings):
    """
    Return the gains of the channels of both cameras, float32 (2, 3).

    Parameters
    ----------
    levels : sequence of two (dark, mean)
        Of left and right, float32 (3,) each: dark level and mean above it, DN.
    settings : Settings

    """
    if not settings.color.equalize:
        return np.ones((2, 3), F4)
    means = [mean for _, mean in levels]
    if same_cameras(means, settings):
        # the two may see different parts of the pattern
        means = [0.5 * (means[0] + means[1])] * 2
    return gains_of(means)


def same_cameras(means, settings):
    """
    Return whether both cameras get the same gains; means (DN) are those of left and right.

    Every part of an aperiodic pattern holds all hues alike. Under such a pattern, a difference of
    the channel means is one of the cameras. Under other patterns the cameras may see different
    parts.

    """
    choice = settings.color.equalize_cameras
    if choice != 'automatic':
        return choice == 'shared'
    if settings.pattern.type not in APERIODIC:
        return True
    balance = np.log((means[0] + F4(0.5)) / (means[1] + F4(0.5)))
    return np.ptp(balance) < SAME_BALANCE


def gains_of(means):
    """
    Return the gains of the channels of both cameras, float32 (2, 3), from their means (DN).

    They make the cameras alike, and the channels half as unequal as they are (of logarithms).
    Without gains, the hues of a weak channel count for little. Full gains amplify its noise.

    """
    means = np.array(means, np.float64) + 0.5
    balance = means / means.mean(axis=1, keepdims=True)
    common = np.sqrt(balance[0] * balance[1])
    return np.clip(np.sqrt(common) / balance, 0.25, 4.0).astype(F4)


def noise_weight(image):
    """
    Return the weight that mere noise has at a node of an image, uint8 (H, W, 3).

    The noise of a single-chip camera changes slowly from pixel to pixel, since demosaicing
    interpolates. The noise of other cameras does not, and has steeper gradients; nor does that of
    gray images without any pattern.

    """
    rows = image[8::32]
    if rows.shape[0] == 0 or rows.shape[1] < 3:
        return NOISE_WEIGHTS[1]
    near, far = (cv2.norm(rows[:, step:], rows[:, :-step], cv2.NORM_L1) / (rows.shape[1] - step)
                 for step in (1, 2))
    low, high = INDEPENDENT
    share = np.clip((near / max(far, 1e-6) - low) / (high - low), 0, 1)
    return NOISE_WEIGHTS[0] + share * (NOISE_WEIGHTS[1] - NOISE_WEIGHTS[0])
