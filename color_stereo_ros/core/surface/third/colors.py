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
"""What the left camera sees of the colors of the pattern, measured where two cameras know."""

from dataclasses import dataclass

import cv2
import numpy as np

from .color_kernels import (
    color_equations, color_errors, color_slopes, mixed_errors, solve_changes, window_means)
from .tuning import TUNING

F4 = np.float32
ROOT3 = F4(np.sqrt(3.0))


@dataclass(frozen=True, eq=False)
class Light:
    """From the light of the pattern to the colors of the left view."""

    pattern: object
    """The BlurredPattern that is as blurred as the left view."""
    colors: np.ndarray
    """float32 (3, 4): light of the camera = A p + b of that of the pattern, [A | b]."""
    local: np.ndarray
    """
    float32 (3, framed): red and blue against green that the surface returns, and the share of
    the color that is not diluted.
    """
    unrest: np.ndarray
    """float32, framed: variance of the color beside what noise explains, as a factor, >= 1."""
    scale: np.float32
    """Variance of the colors as a factor of that of the camera model."""


def chromaticity(light):
    """Return u and v of light, shape (3, ...)."""
    r, g, b = light
    total = np.maximum(r + g + b, F4(TUNING.color.least_light))
    return (2 * r - g - b) / total, ROOT3 * (g - b) / total


def mixed(colors, light):
    """Return light of the pattern, (3, ...), as the left camera sees it on a white surface."""
    return np.tensordot(colors[:, :3], light, axes=1) + colors[:, 3].reshape(
        (3,) + (1,) * (light.ndim - 1))


def fitted_colors(u, v, light, weight):
    """
    Return the map from the light of the pattern to that of the camera, up to its brightness.

    With light A p + b, a chromaticity u = (2 r - g - b) / (r + g + b) asks for (u - 2) r + (u + 1)
    g + (u + 1) b = 0, and v likewise for v r + (v - 3^.5) g + (v + 3^.5) b = 0: linear in A and b.

    Parameters
    ----------
    u, v : numpy.ndarray, shape (N,)
        Column and row in the pattern, px.
    light : numpy.ndarray, shape (3, N)
        Of the pattern at these places.
    weight : numpy.ndarray, shape (N,)
        Of each place.

    Returns
    -------
    colors : numpy.ndarray, float32, shape (3, 4)

    """
    tuning = TUNING.color
    prior, normal = np.eye(3, 4), np.empty((12, 12))
    colors, trust, error = prior, weight, np.empty(len(weight))
    for _ in range(tuning.turns):
        color_equations(u, v, light, trust, colors, tuning.least_total, normal)
        hold = tuning.color_prior * np.trace(normal) / 12
        solved = np.linalg.solve(normal + hold * np.eye(12), hold * prior.ravel())
        colors = solved.reshape(3, 4)
        colors = colors * (3 / max(np.trace(colors[:, :3]), tuning.least_total))
        mixed_errors(u, v, light, colors, tuning.least_light, error)
        trust = weight / (1 + error / max(middle(error) * tuning.robust, tuning.least_error))
    return colors.astype(F4)


def explained(u, v, light, colors):
    """Return the share of the spread of known colors that the pattern explains, by medians."""
    seen_u, seen_v = chromaticity(mixed(colors, light))
    error = middle((u - seen_u) ** 2 + (v - seen_v) ** 2)
    return 1 - error / middle((u - middle(u)) ** 2 + (v - middle(v)) ** 2)


def middle(values, share=0.5):
    """Return the value, of some (N,), that a share of them does not exceed; fast."""
    at = int(share * (values.size - 1))
    return np.partition(values, at)[at]


def local_light(u, v, light, colors, variance, known):
    """
    Return what surfaces make of the colors, from coarse to fine, on a grid.

    Each node with a known place asks for three changes of its predicted color: more red, more
    blue, less color of all. Least squares over windows give them; where a window knows nothing,
    that of the larger window stays.

    Parameters
    ----------
    u, v, variance : numpy.ndarray, float32, shape (h, w)
        Of the left view.
    light : numpy.ndarray, float32, shape (3, h, w)
        Of the pattern; NaN = unknown.
    colors : numpy.ndarray, float32, shape (3, 4)
        Affine map from the light of the pattern to the camera.
    known : numpy.ndarray, bool, shape (h, w)
        Where the place in the pattern is known.

    Returns
    -------
    local : numpy.ndarray, float32, shape (3, h, w)
        See `Light.local`.
    error : numpy.ndarray, float32, shape (h, w)
        Squared error of the color over its variance that is left; 0 where unknown.

    """
    tuning = TUNING.color
    change, error = np.zeros((3, *u.shape), F4), np.empty(u.shape, F4)
    sums, means = np.empty((2, 9, *u.shape), F4)
    limits = np.array(tuning.change_limits, F4)
    for radius, hold, thin in zip(tuning.radii, tuning.holds, tuning.thinnings):
        color_slopes(u, v, variance, light, known, colors, change, sums)
        size = tuple(max(1, count // thin) for count in reversed(u.shape))
        if thin == 1:
            window_means(sums, radius, means)
            solve_changes(means, F4(hold), limits, change)
            continue
        thinned = np.stack([cv2.resize(plane, size, interpolation=cv2.INTER_AREA)
                            for plane in sums])
        windows = np.empty_like(thinned)
        window_means(thinned, radius // thin, windows)
        step = np.stack([resized(plane, size) for plane in change])
        solve_changes(windows, F4(hold), limits, step)
        change = np.stack([resized(plane, u.shape[::-1]) for plane in step])
    color_errors(u, v, variance, light, known, colors, change, error)
    return np.exp(change), error


def resized(plane, size):
    """Return a smooth plane on a grid of another size (columns, rows)."""
    return plane if plane.shape[::-1] == size else cv2.resize(plane, size,
                                                              interpolation=cv2.INTER_LINEAR)


def warm(shape):
    """Run the kernels once on a grid of a shape."""
    plane, light = np.ones(shape, F4), np.ones((3, *shape), F4)
    local_light(plane, plane, light, np.eye(3, 4, dtype=F4), plane, np.zeros(shape, bool))
    fitted_colors(*np.ones((2, 8), F4), light.reshape(3, -1)[:, :1].repeat(8, axis=1), np.ones(8))
