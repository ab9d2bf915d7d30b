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
"""The projector: from pattern values to light, and from points in space to pattern pixels."""

import cv2
import numpy as np

BLUR_LEVELS = 6


def pattern_light(projector, pattern):
    """Return the linear light of a uint8 pattern, float32 (H, W, 3), 1 = white."""
    light = (pattern.astype(np.float32) / 255) ** np.float32(projector.gamma)
    return projector.black_level + (1 - projector.black_level) * light


def projector_coordinates(projector, points):
    """
    Project points of the rig frame into the projector.

    Parameters
    ----------
    projector : Projector
        The simulated projector.
    points : numpy.ndarray, shape (N, 3)
        m.

    Returns
    -------
    column : numpy.ndarray, float64, shape (N,)
        Share of the width, 0..1 from the left edge to the right one.
    row : numpy.ndarray, float64, shape (N,)
        Distance below the optical axis, in widths.
    depth : numpy.ndarray, float64, shape (N,)
        m along the optical axis.
    falloff : numpy.ndarray, float64, shape (N,)
        Intensity relative to the axis so that a plane across the axis is lit evenly; 0 behind.

    """
    local = projector.pose.to_child(points.astype(np.float64))
    depth = local[:, 2]
    ahead = depth > 1e-6
    safe = np.where(ahead, depth, 1.0)
    width = 2 * np.tan(np.radians(projector.field_of_view) / 2)
    x, y = local[:, 0] / safe, local[:, 1] / safe
    # A plane at distance d receives I cos^3(angle) / d^2: the intensity I makes up for it.
    falloff = np.where(ahead, (1 + x * x + y * y) ** 1.5, 0.0)
    return x / width + 0.5, y / width, depth, falloff


def pattern_stack(projector, pattern, depth):
    """
    Blur a pattern as much as its distances ask for.

    Parameters
    ----------
    projector : Projector
        The simulated projector.
    pattern : numpy.ndarray, uint8, shape (H, W, 3)
        The image that the projector shows, RGB.
    depth : numpy.ndarray, float32, shape (N,)
        m, the distances that occur.

    Returns
    -------
    stack : numpy.ndarray, float32, shape (L, H, W, 3)
    level_of : callable
        From depths to places in the stack, float32.

    """
    light = pattern_light(projector, pattern)
    width = pattern.shape[1]
    if depth.size == 0 or projector.aperture == 0:
        return (_blurred(light, projector.blur)[None],
                lambda distance: np.zeros(distance.shape, np.float32))
    sigma = projector.blur_at(depth.astype(np.float64), width)
    levels = np.linspace(sigma.min(), sigma.max(), BLUR_LEVELS)
    stack = np.stack([_blurred(light, level) for level in levels])

    def level_of(distance):
        return np.interp(projector.blur_at(distance.astype(np.float64), width), levels,
                         np.arange(BLUR_LEVELS)).astype(np.float32)
    return stack, level_of


def _blurred(light, sigma):
    if sigma < 0.05:
        return light
    return cv2.GaussianBlur(light, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
