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
"""Color correction and noise elimination of the paper's method (paper, sec. 2.2)."""

import math

import cv2
import numpy as np

from . import kernels
from .tuning import TUNING

ESTIMATE = -1.0  # value of color.dark_level that asks for an estimate
COLORS = TUNING.colors


class ColorCorrection:
    """
    Makes the colors of the two cameras comparable.

    Parameters
    ----------
    settings : ColorSettings

    """

    def __init__(self, settings):
        """Keep the settings."""
        self._settings = settings
        self._memory = {}

    def correct(self, pair):
        """
        Correct both images of a pair.

        Parameters
        ----------
        pair : RectifiedPair
            The rectified images.

        Returns
        -------
        left, right : (numpy.ndarray, numpy.ndarray)
            Colors, float32 (H, W, 4): corrected components and 1, or four zeros where a pixel
            cannot be used; and reason, uint8 (H, W): Status.VALID or why it cannot. The next
            call overwrites them.

        """
        views = [(pair.left, pair.left_inside), (pair.right, pair.right_inside)]
        darks = [self._dark_level(*view) for view in views]
        gains = self._gains(views, darks)
        return tuple(self._corrected(side, *view, dark, gain)
                     for side, view, dark, gain in zip(('left', 'right'), views, darks, gains))

    def _dark_level(self, image, inside):
        """Return the signal without light of each channel, float32 (3,), DN."""
        if self._settings.dark_level != ESTIMATE:
            return np.full(3, self._settings.dark_level, np.float32)
        return estimated_dark_level(image, inside)

    def _gains(self, views, darks):
        """Return the channel gains of both cameras, float32 (3,) each."""
        settings = self._settings
        if not settings.equalize:
            return np.ones((2, 3), np.float32)
        samples = [brightness_samples(*view, dark, settings) for view, dark in zip(views, darks)]
        if settings.equalize_cameras == 'separate':
            return [equal_brightness_gains(*sample) for sample in samples]
        shared = equal_brightness_gains(*(np.concatenate(part) for part in zip(*samples)))
        if settings.equalize_cameras == 'shared':
            return shared, shared
        return split_gains(shared, *(equal_brightness_gains(*sample) for sample in samples))

    def _corrected(self, side, image, inside, dark, gains):
        """Return corrected colors (H, W, 4) and reasons (H, W) of one image."""
        settings = self._settings
        colors, blurred, reason = self._buffers(side, inside.shape)
        kernels.correct_colors(
            image, inside, dark, gains, np.float32(settings.min_signal),
            settings.saturation_level, settings.zero_weakest,
            np.float32(COLORS.brightness if settings.scale else 0.0), colors, reason)
        return smoothed(colors, reason, settings.smoothing, blurred), reason

    def _buffers(self, side, shape):
        """Return memory for one image; taking it anew for each pair costs more than the work."""
        if (side, shape) not in self._memory:
            self._memory[side, shape] = (np.empty((*shape, 4), np.float32),
                                         np.empty((*shape, 4), np.float32),
                                         np.empty(shape, np.uint8))
        return self._memory[side, shape]


def estimated_dark_level(image, inside):
    """
    Return the signal without light, the same for each channel, float32 (3,), DN.

    Where one component of the pattern is zero, and in shadows, a camera shows its dark level.

    """
    step = COLORS.dark_step
    sample = image[::step, ::step][inside[::step, ::step]]
    if sample.size == 0:
        return np.zeros(3, np.float32)
    level = np.percentile(sample.min(axis=1), COLORS.dark_percentile)
    return np.full(3, level, np.float32)


def brightness_samples(image, inside, dark, settings):
    """
    Return pairs of colors of neighboring lit spots.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        The view, RGB.
    inside : numpy.ndarray, bool, shape (H, W)
        Where the view lies inside the raw image.
    dark : numpy.ndarray, float32, shape (3,)
        DN.
    settings : ColorSettings
        The group `color` of the settings.

    Returns
    -------
    first, second : numpy.ndarray, float32, shape (n, 3)
        DN above the dark level; the spots are `spot_step` apart in a row or a column.

    """
    rows, columns = (size // COLORS.spot_step for size in inside.shape)
    colors = np.empty((rows, columns, 3), np.float32)
    lit = np.empty((rows, columns), np.bool_)
    kernels.average_spots(image, inside, dark, np.float32(settings.min_signal),
                          settings.saturation_level, COLORS.spot_step, COLORS.spot_size, colors,
                          lit)
    in_row = lit[:, 1:] & lit[:, :-1]
    in_column = lit[1:] & lit[:-1]
    return (np.concatenate((colors[:, 1:][in_row], colors[1:][in_column])),
            np.concatenate((colors[:, :-1][in_row], colors[:-1][in_column])))


def equal_brightness_gains(first, second):
    """
    Return the channel gains that make the brightness of neighboring spots most alike.

    The pattern has uniform brightness (paper, fig. 2.2 right), so that the sum of equalized
    channels changes slowly over the image while the hue changes. Edges of objects scale whole
    colors and favor no gain.

    Parameters
    ----------
    first, second : numpy.ndarray, float32, shape (n, 3)
        Colors of neighboring spots, DN above the dark level.

    Returns
    -------
    gains : numpy.ndarray, float32, shape (3,)
        The smallest is 1; all are 1 if the samples are too few.

    """
    gains = np.ones(3, np.float32)
    if len(first) < COLORS.least_gain_samples:
        return gains
    difference, total = first - second, first + second
    for _ in range(COLORS.gain_iterations):
        brightness = np.maximum(total @ gains, COLORS.least_brightness)
        contrast = difference @ gains / brightness
        scale = COLORS.robust_scale * np.median(np.abs(contrast)) + COLORS.least_contrast
        # Cauchy weights; division by the brightness compares relative differences.
        weights = 1.0 / ((1.0 + (contrast / scale) ** 2) * brightness ** 2)
        unlike = (difference * weights[:, None]).T @ difference
        alike = (total * weights[:, None]).T @ total
        gains = _smallest_ratio(unlike, alike)
        if gains.min() <= 0:
            return np.ones(3, np.float32)
        gains = (gains / gains.min()).astype(np.float32)
    return gains


def _smallest_ratio(above, below):
    """Return the vector g that minimizes (g above g) / (g below g), its sum positive."""
    above, below = np.float64(above), np.float64(below)
    ridge = (COLORS.relative_ridge * np.trace(below) + COLORS.absolute_ridge) * np.eye(3)
    root = np.linalg.inv(np.linalg.cholesky(below + ridge))
    vector = root.T @ np.linalg.eigh(root @ above @ root.T)[1][:, 0]
    return vector * np.sign(vector.sum())


def split_gains(shared, left, right):
    """
    Return gains of both cameras that differ only where the two estimates differ for certain.

    Matching suffers from a difference between the cameras, not from an error that they share.

    Parameters
    ----------
    shared : numpy.ndarray, float32, shape (3,)
        Gains of the channels from the samples of both cameras.
    left, right : numpy.ndarray, float32, shape (3,)
        Gains from the samples of one camera.

    Returns
    -------
    left, right : numpy.ndarray, float32, shape (3,)

    """
    difference = np.log(left / right)
    difference -= np.median(difference)
    low, high = COLORS.camera_difference
    share = np.clip((np.abs(difference) - low) / (high - low), 0.0, 1.0)
    half = np.exp(0.5 * share * difference)
    return (shared * half).astype(np.float32), (shared / half).astype(np.float32)


def smoothed(colors, reason, deviation, blurred):
    """
    Return the colors after Gaussian smoothing over the usable pixels only.

    Parameters
    ----------
    colors : numpy.ndarray, float32, shape (H, W, 4)
        Components and 1, or four zeros where a pixel cannot be used.
    reason : numpy.ndarray, uint8, shape (H, W)
        Status.VALID where a pixel can be used.
    deviation : float
        Standard deviation, px; 0 = return the colors as they are.
    blurred : numpy.ndarray, float32, shape (H, W, 4)
        Memory for the result.

    """
    if deviation == 0:
        return colors
    size = 2 * math.ceil(COLORS.blur_reach * deviation) + 1
    cv2.GaussianBlur(colors, (size, size), deviation, dst=blurred,
                     borderType=cv2.BORDER_REPLICATE)
    kernels.normalize(blurred, reason)
    return blurred
