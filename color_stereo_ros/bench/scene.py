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
"""
The pair of images that is measured for its time: a lit table with objects, of any size.

The projector stands midway between the cameras, so that a point of disparity d at its column x
appears at x + d / 2 on the left and x - d / 2 on the right. Places that it does not light are in
shadow. The scene is the same for every size and search interval, so that times can be compared.

"""

import math

import cv2
import numpy as np

from ..core import make_pattern, Settings, StereoCalibration

VGA = 640, 480
SEED = 5
FINE = 4        # samples per pixel along a row, of which the nearest point is seen
STEEPEST = 1.5  # px per px: more is the step between two surfaces, not a surface
MARGIN = 0.2    # of the width: the projector lights more than either camera sees
SIGNAL = 150.0  # DN of a white surface
AMBIENT = 5.0   # DN
NOISE = 0.25    # DN of variance per DN of signal


def bench_calibration(size=VGA):
    """Return a rig of 60 mm baseline with the small errors of every real one."""
    width, height = size
    focal = 600 * width / VGA[0]
    camera = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
    turned = cv2.Rodrigues(np.array([0.004, -0.006, 0.003]))[0]
    return StereoCalibration.from_arrays(
        size, camera, (-0.09, 0.06, 0.0004, -0.0003, 0.0), camera,
        (-0.10, 0.07, -0.0003, 0.0004, 0.0), turned, -turned @ np.array([0.06, 0.0005, -0.0004]))


def bench_settings(calibration, disparities, method='surface', third_view='off'):
    """
    Return settings whose depth limits make a method search a number of whole disparities.

    The matchers that are compared know two views.

    The interval is laid around the scene as far as the distance stays finite.

    """
    geometry = calibration.geometry
    around = round(geometry.width / 10 - disparities / 2)
    first = math.ceil(geometry.principal_offset) + max(1, around)
    # whole disparities are searched from the floor of the smallest to the ceiling of the largest
    far, near = (geometry.focal_baseline / (disparity - geometry.principal_offset)
                 for disparity in (first + 0.25, first + disparities - 1.25))
    return Settings().updated({'range.min_depth': near, 'range.max_depth': far,
                               'matching.method': method,
                               'matching.third_view': third_view})


def bench_pair(calibration, seed=SEED):
    """
    Return the raw images of the scene.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    seed : int
        Of the noise.

    Returns
    -------
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    """
    geometry = calibration.geometry
    disparity, albedo = _scene(geometry.width, geometry.height)
    pattern = _projected(*disparity.shape)
    rng = np.random.default_rng(seed)
    return tuple(_photograph(camera, _seen(disparity, pattern, albedo, sign), rng)
                 for camera, sign in ((calibration.left, 0.5), (calibration.right, -0.5)))


def _scene(width, height):
    """Return disparity (px) and albedo of what the projector's columns hit, float32 (H, W')."""
    columns = round(width * (1 + 2 * MARGIN))
    x = (np.arange(columns, dtype=np.float32) / width - MARGIN)[None, :]
    y = (np.arange(height, dtype=np.float32) / width)[:, None]
    disparity = np.float32(0.066) + np.float32(0.035) * y + np.float32(0.004) * x
    albedo = 0.75 + 0.1 * np.sin(60 * y + 6 * np.sin(9 * x))  # the grain of a table
    box = (abs(x - 0.25) < 0.09) & (abs(y - 0.47) < 0.13)
    disparity = np.where(box, 0.100 + 0.10 * (x - 0.25), disparity)
    albedo = np.where(box, 0.45, albedo)
    ball = ((x - 0.62) ** 2 + (y - 0.32) ** 2) / 0.12 ** 2
    dome = 0.080 + 0.035 * np.sqrt(np.maximum(1 - ball, 0))
    disparity = np.where(ball < 1, dome, disparity)
    albedo = np.where(ball < 1, 0.9 * np.sqrt(np.maximum(1 - 0.7 * ball, 0.1)), albedo)
    tube = abs(x - 0.85) < 0.04
    disparity = np.where(tube, 0.095 + 0.3 * np.sqrt(np.maximum(
        0.0016 - (x - 0.85) ** 2, 0)), disparity)
    return (disparity * width).astype(np.float32), albedo.astype(np.float32)


def _projected(height, columns):
    """Return the default pattern as it falls on the scene, float32 (H, W', 3), 0..1."""
    pattern = make_pattern(Settings().pattern)
    rows = round(pattern.shape[1] * height / columns)
    return cv2.resize(pattern[:rows], (columns, height),
                      interpolation=cv2.INTER_LINEAR).astype(np.float32) / 255


def _seen(disparity, pattern, albedo, sign):
    """Return what a rectified camera sees, float32 (H, W, 3), DN; sign: +0.5 left, -0.5 right."""
    height, columns = disparity.shape
    width = round(columns / (1 + 2 * MARGIN))
    fine = np.arange(columns * FINE, dtype=np.float32) / FINE
    row_of = np.arange(height, dtype=np.float32)[:, None]
    map_x = np.broadcast_to(fine, (height, fine.size)).copy()
    map_y = np.broadcast_to(row_of, map_x.shape).copy()
    near = cv2.remap(disparity, map_x, map_y, cv2.INTER_LINEAR)
    at = fine - np.float32(MARGIN * width) + np.float32(sign) * near
    column = np.rint(at).astype(np.int64)
    surface = abs(np.gradient(near, axis=1)) * FINE < STEEPEST
    inside = surface & (column >= 0) & (column < width)
    order = np.argsort(near[inside], kind='stable')  # the nearest point is written last
    row, target = np.nonzero(inside)[0][order], column[inside][order]
    source = np.full((height, width), -1, np.float32)  # -1: a shadow
    # the middle of a pixel lies a little beside the sample that was rounded to it
    source[row, target] = (map_x + (column - at))[inside][order]
    light = cv2.remap(pattern, source, np.broadcast_to(row_of, source.shape).copy(),
                      cv2.INTER_LINEAR)
    matte = cv2.remap(albedo, source, np.broadcast_to(row_of, source.shape).copy(),
                      cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[..., None]
    return matte * (SIGNAL * light * (source >= 0)[..., None] + AMBIENT)


def _photograph(camera, light, rng):
    """Return the raw 8-bit image of a rectified one: lens, blur, shot noise, dark level."""
    rows, columns = np.mgrid[0:camera.height, 0:camera.width]
    raw = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2).astype(np.float64)
    place = cv2.undistortPoints(raw, camera.K.copy(), camera.D.copy(), R=camera.R.copy(),
                                P=camera.P[:, :3].copy()).reshape(*rows.shape, 2)
    place = place.astype(np.float32)
    image = cv2.remap(cv2.GaussianBlur(light, (0, 0), 0.6), place[..., 0].copy(),
                      place[..., 1].copy(), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    image += rng.standard_normal(image.shape, np.float32) * np.sqrt(1 + NOISE * image)
    return np.clip(np.rint(image + 2), 0, 255).astype(np.uint8)
