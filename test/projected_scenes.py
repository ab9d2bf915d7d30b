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
"""Surfaces under a projector of known geometry, drawn in milliseconds, for the tests."""

from color_stereo_ros.core import RectifiedGeometry
from color_stereo_ros.core.projector import Measured, ProjectorModel
import cv2
import numpy as np

WIDTH, HEIGHT = 480, 360
GEOMETRY = RectifiedGeometry(WIDTH, HEIGHT, 480.0, 480.0, 240.0, 200.0, 180.0, 0.12)
SIZE = 768, 768
NOISE = 1.5             # DN
DISPARITY_NOISE = 0.03  # px


def rays():
    """Return X/Z, Y/Z and 1 of every pixel, float64 (H, W, 3)."""
    row, column = np.indices((HEIGHT, WIDTH), np.float64)
    return np.dstack([(column - GEOMETRY.center_x_left) / GEOMETRY.focal_x,
                      (row - GEOMETRY.center_y) / GEOMETRY.focal_y, np.ones((HEIGHT, WIDTH))])


def wall(distance=0.5, tilt=0.0):
    """Return the depth of a plane, float64 (H, W), m; tilt: slope of Z over X."""
    return distance / (1 - tilt * rays()[..., 0])


def solids():
    """Return the depth of a tilted wall with a ball and a ridge before it, m."""
    depth = wall(0.55, 0.2)
    x, y = rays()[..., 0], rays()[..., 1]
    ridge = 0.45 + 0.5 * np.abs(x + 0.25)
    depth = np.where((np.abs(x + 0.25) < 0.12) & (np.abs(y) < 0.28), ridge, depth)
    away = np.hypot(x - 0.15, y - 0.05) / 0.17
    ball = 0.47 - 0.07 * np.sqrt(np.maximum(1 - away ** 2, 0))
    return np.where(away < 1, ball, depth)


def right_view(model, pattern, distance=0.5, tilt=0.0, rows=0, seed=5):
    """Return the image of the right camera before a `wall`, shifted down by some rows."""
    row, column = np.indices((HEIGHT, WIDTH), np.float64)
    x = (column - GEOMETRY.center_x_right) / GEOMETRY.focal_x
    y = (row - rows - GEOMETRY.center_y) / GEOMETRY.focal_y
    depth = (distance + tilt * GEOMETRY.baseline) / (1 - tilt * x)
    points = np.dstack([x * depth + GEOMETRY.baseline, y * depth, depth])
    return photographed(sampled(pattern, *model.project(points)), seed)


def turned(degrees_x, degrees_y, degrees_z=0.0):
    """Return a rotation matrix of a rotation vector in degrees."""
    return cv2.Rodrigues(np.radians([degrees_x, degrees_y, degrees_z]))[0]


def projector(center=(0.06, -0.09, 0.02), rotation=None, field_of_view=58.0, shift=0.4, k1=0.0,
              matrix=None):
    """
    Return the true model of a projector.

    center in m, left camera; rotation from the left camera; field of view over the width,
    degrees; shift of the lens, share of the height; or a camera matrix of its own.

    """
    width, height = SIZE
    focal = width / 2 / np.tan(np.radians(field_of_view) / 2)
    if matrix is None:
        matrix = [[focal, 0, (width - 1) / 2], [0, focal, (0.5 + shift) * height - 0.5],
                  [0, 0, 1]]
    rotation = turned(3, 5, 1) if rotation is None else rotation
    return ProjectorModel(matrix, k1, rotation, -rotation @ np.asarray(center), SIZE,
                          np.zeros((12, 12)))


def lit(depth, model, pattern, albedo=1.0):
    """Return the light of every pixel of the left camera, float32 (H, W, 3), DN."""
    return albedo * sampled(pattern, *model.project(rays() * depth[..., None]))


def sampled(pattern, u, v):
    """Return the light at places of a pattern, float32 (H, W, 3), DN; 0 outside."""
    return 0.8 * cv2.remap(pattern.astype(np.float32), u.astype(np.float32), v.astype(np.float32),
                           cv2.INTER_LINEAR)


def photographed(light, seed=1, blur=0.6):
    """Return the image that a camera takes of light, uint8 (H, W, 3)."""
    light = cv2.GaussianBlur(light, (0, 0), blur) + 3
    noise = np.random.default_rng(seed).normal(0, NOISE, light.shape)
    return np.uint8(np.clip(np.rint(light + noise), 0, 255))


def measured(image, depth, seed=2, known=True):
    """Return what two views might measure: the true depth, with noise; known: bool (H, W)."""
    noise = np.random.default_rng(seed).normal(0, DISPARITY_NOISE, depth.shape)
    noise = cv2.GaussianBlur(noise, (0, 0), 1.5)
    noise *= DISPARITY_NOISE / noise.std()
    found = GEOMETRY.focal_baseline / (GEOMETRY.focal_baseline / depth + noise)
    known = np.broadcast_to(known, depth.shape)
    found = np.where(known, found, np.nan).astype(np.float32)
    spread = np.where(known, DISPARITY_NOISE, np.nan).astype(np.float32)
    return Measured(image, found, spread, known.astype(np.float32), GEOMETRY)


def seen(depth, model, pattern, seed=1, known=True, **changes):
    """Return what two views measure of a surface under a pattern."""
    return measured(photographed(lit(depth, model, pattern), seed, **changes), depth, seed + 1,
                    known)
