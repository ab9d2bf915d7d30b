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
"""Rectified pairs of known disparity, under the default pattern if none is named."""

from functools import lru_cache

from color_stereo_ros.core import (
    CameraModel, make_pattern, PatternSettings, Settings, StereoCalibration)
import cv2
import numpy as np

FOCAL, BASELINE = 320.0, 0.1
SUB = 4          # samples per pixel and direction
MARGIN = 128     # px of pattern on either side of the image


def rig(width, height, offset=0.0):
    """Return a rig whose images are rectified; offset (px) = cx_left - cx_right."""
    center = (width - 1) / 2, (height - 1) / 2
    cameras = []
    for name, shift, moved in (('left', offset / 2, 0.0), ('right', -offset / 2, 1.0)):
        K = np.array([[FOCAL, 0, center[0] + shift], [0, FOCAL, center[1]], [0, 0, 1]])
        P = np.column_stack([K, [-FOCAL * BASELINE * moved, 0, 0]])
        cameras.append(CameraModel(name, width, height, 'plumb_bob', np.zeros(5), K, np.eye(3), P))
    return StereoCalibration(*cameras)


def surface_settings(smallest, largest, offset=0.0, **changes):
    """Return settings for a range of disparities, px; changes use __ for the dot."""
    values = {'range.min_depth': FOCAL * BASELINE / (largest - offset),
              'range.max_depth': FOCAL * BASELINE / (smallest - offset)}
    values.update({name.replace('__', '.'): value for name, value in changes.items()})
    return Settings().updated(values)


@lru_cache(maxsize=2)
def texture(width, height, feature_size, kind):
    """Return a pattern with SUB samples a pixel, float32 (H, W, 3), 0..1."""
    settings = PatternSettings(type=kind, width=SUB * (width + 2 * MARGIN), height=SUB * height,
                               feature_size=SUB * feature_size)
    return make_pattern(settings).astype(np.float32) / 255


def photographed(shift, feature_size=7.0, kind=PatternSettings().type, rows=0.0):
    """
    Return what a camera sees of the pattern, float64 (H, W, 3), 0..1.

    Parameters
    ----------
    shift : numpy.ndarray, shape (H, W)
        Pattern column minus image column, px, linear between pixels.
    feature_size, kind : float, str
        Of the pattern.
    rows : numpy.ndarray, shape (H, W), or float
        Image row minus pattern row, px.

    """
    height, width = shift.shape
    step = (np.arange(SUB) - (SUB - 1) / 2) / SUB
    down = np.repeat(np.repeat(np.broadcast_to(rows, shift.shape), SUB, 0), SUB, 1)
    rows = np.add.outer(np.arange(height), step).ravel()
    columns = np.add.outer(np.arange(width), step).ravel()
    slope = np.gradient(shift, axis=1)
    fine = np.repeat(np.repeat(shift, SUB, 0), SUB, 1) + np.repeat(
        np.repeat(slope, SUB, 0), SUB, 1) * np.tile(step, width)
    x = SUB * (columns + fine + MARGIN + 0.5) - 0.5
    y = SUB * (rows[:, None] - down + 0.5) - 0.5
    seen = cv2.remap(texture(width, height, feature_size, kind), x.astype(np.float32),
                     y.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return seen.reshape(height, SUB, width, SUB, 3).mean(axis=(1, 3), dtype=np.float64)


def exposed(light, rng, brightness=180.0, noise=True):
    """Return an 8-bit image: shot noise of a few electrons a DN, read noise 1 DN."""
    signal = brightness * light
    deviation = np.sqrt(1.0 + 0.1 * signal) if noise else 0.0
    signal = signal + deviation * rng.standard_normal(light.shape)
    return np.clip(np.rint(signal), 0, 255).astype(np.uint8)


def pair_of(disparity, seed=1, brightness=180.0, noise=True, **pattern):
    """Return a pair of one surface, lit from the right camera; disparity at the left pixels."""
    rng = np.random.default_rng(seed)
    return tuple(exposed(photographed(shift, **pattern), rng, brightness, noise)
                 for shift in (-disparity, np.zeros(disparity.shape)))


def plane_pair(width, height, disparity, slope_x=0.0, slope_y=0.0, **options):
    """Return a pair of a plane that has a disparity in the center and slopes, px per px."""
    return pair_of(plane(width, height, disparity, slope_x, slope_y), **options)


def plane(width, height, disparity, slope_x=0.0, slope_y=0.0):
    """Return the disparity of a plane, float64 (H, W), px."""
    row, column = np.mgrid[:height, :width]
    return (disparity + slope_x * (column - (width - 1) / 2)
            + slope_y * (row - (height - 1) / 2))


def step_pair(width, height, near, far, first, last, seed=1):
    """
    Return a pair of a near strip before a far plane, its disparity, and what only left sees.

    The strip fills the left columns first .. last - 1. The projector stands between the cameras;
    shadows are lit, as if by a second one: hidden pixels show colors that right does not have.

    """
    column = np.arange(width)
    left = np.where((column >= first) & (column < last), near, far).astype(float)
    right = np.where((column >= first - near) & (column < last - near), near, far).astype(float)
    hidden = (left == far) & (column - far >= first - near) & (column - far < last - near)
    rng = np.random.default_rng(seed)
    images = [exposed(photographed(np.broadcast_to(shift, (height, width))), rng)
              for shift in (-left / 2, right / 2)]
    return (*images, np.broadcast_to(left, (height, width)),
            np.broadcast_to(hidden, (height, width)))
