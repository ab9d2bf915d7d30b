# SPDX-License-Identifier: Apache-2.0
"""Color correction and noise elimination of the paper's method (paper, sec. 2.2)."""

import cv2
import numpy as np

from . import _kernels
from .types import Status

BRIGHTNESS = 255.0  # lambda of the paper: the sum of the components after scaling
ESTIMATE = -1.0     # value of color.dark_level that asks for an estimate
SAMPLE_STEP = 4     # every fourth row and column is enough for a statistic


class ColorCorrection:
    """
    Makes the colors of one camera comparable with those of another.

    Parameters
    ----------
    settings : ColorSettings

    """

    def __init__(self, settings):
        """Keep the settings."""
        self._settings = settings

    def correct(self, image, inside):
        """
        Correct one rectified image.

        Parameters
        ----------
        image : numpy.ndarray, uint8, shape (H, W, 3)
            RGB.
        inside : numpy.ndarray, bool, shape (H, W)

        Returns
        -------
        colors : numpy.ndarray, float32, shape (H, W, 4)
            Corrected components, and 1; all 0 where a pixel cannot be used.
        reason : numpy.ndarray, uint8, shape (H, W)
            Status.VALID, or why the pixel cannot be used.

        """
        settings = self._settings
        dark = self.dark_level(image, inside)
        gains = self.channel_gains(image, inside, dark)
        colors = np.empty((*inside.shape, 4), np.float32)
        reason = np.empty(inside.shape, np.uint8)
        _kernels.correct_colors(
            image, inside, dark, gains, np.float32(settings.min_signal),
            settings.saturation_level, settings.zero_weakest,
            np.float32(BRIGHTNESS if settings.scale else 0.0), colors, reason)
        return smoothed(colors, reason, settings.smoothing), reason

    def dark_level(self, image, inside):
        """Return the signal without light of each channel, float32 (3,), DN."""
        if self._settings.dark_level != ESTIMATE:
            return np.full(3, self._settings.dark_level, np.float32)
        return estimated_dark_level(image, inside)

    def channel_gains(self, image, inside, dark):
        """Return the factor that equalizes each channel, float32 (3,)."""
        if not self._settings.equalize:
            return np.ones(3, np.float32)
        return estimated_gains(image, inside, dark, self._settings)


def estimated_dark_level(image, inside):
    """
    Return the signal without light of each channel, float32 (3,), DN.

    Where one component of the pattern is zero, and in shadows, a camera shows its dark level.

    """
    sample = image[::SAMPLE_STEP, ::SAMPLE_STEP][inside[::SAMPLE_STEP, ::SAMPLE_STEP]]
    if sample.size == 0:
        return np.zeros(3, np.float32)
    return np.percentile(sample, 2.0, axis=0).astype(np.float32)


def estimated_gains(image, inside, dark, settings):
    """
    Return the factors that make the channels equally strong over the image, float32 (3,).

    The patterns spend the same light on each component, so that a weaker channel is a less
    sensitive one.

    """
    sample = image[::SAMPLE_STEP, ::SAMPLE_STEP][inside[::SAMPLE_STEP, ::SAMPLE_STEP]] - dark
    strongest = sample.max(axis=1, initial=0.0)
    lit = (strongest >= settings.min_signal) & (strongest < settings.saturation_level - dark.max())
    if not lit.any():
        return np.ones(3, np.float32)
    means = np.maximum(sample[lit].mean(axis=0), 1e-3)
    return (means.max() / means).astype(np.float32)


def smoothed(colors, reason, deviation):
    """Return the colors after Gaussian smoothing over the usable pixels only."""
    if deviation == 0:
        return colors
    blurred = cv2.GaussianBlur(colors, (0, 0), deviation, borderType=cv2.BORDER_REPLICATE)
    weight = np.maximum(blurred[..., 3:], np.float32(1e-6))
    blurred[..., :3] /= weight
    blurred[reason != Status.VALID] = 0
    return blurred
