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
"""Disparity, depth and points, and the geometry between them."""

from functools import lru_cache
import math

import numpy as np

from ..errors import SettingsError


def depth_from_disparity(disparity, geometry):
    """
    Triangulate: Z = f B / (d - (cx_left - cx_right)).

    Parameters
    ----------
    disparity : numpy.ndarray, float32, shape (H, W)
        x_left - x_right, px; NaN = unknown.
    geometry : RectifiedGeometry
        Of the rectified pair.

    Returns
    -------
    depth : numpy.ndarray, float32, shape (H, W)
        m along Z of the rectified left camera; NaN = unknown or behind the camera.

    """
    depth = disparity - np.float32(geometry.principal_offset)
    depth[depth <= 0] = np.nan
    return np.divide(np.float32(geometry.focal_baseline), depth, out=depth)


def disparity_from_depth(depth, geometry):
    """Return d = f B / Z + cx_left - cx_right, px, for depths in m; NaN stays NaN."""
    return geometry.focal_baseline / depth + geometry.principal_offset


def disparity_limits(geometry, range_settings):
    """
    Return the disparities of the farthest and the nearest depth.

    Parameters
    ----------
    geometry : RectifiedGeometry
        Of the rectified pair.
    range_settings : RangeSettings
        The group `range` of the settings.

    Returns
    -------
    smallest, largest : float
        px; may be negative on verged rigs.

    Raises
    ------
    SettingsError
        If no pixel of the right image can correspond to any pixel of the left one.

    """
    smallest = disparity_from_depth(range_settings.max_depth, geometry)
    largest = disparity_from_depth(range_settings.min_depth, geometry)
    if smallest > geometry.width - 1 or largest < 1 - geometry.width:
        raise SettingsError(
            f'range.min_depth = {range_settings.min_depth} m .. range.max_depth = '
            f'{range_settings.max_depth} m gives disparities {smallest:.0f} .. {largest:.0f} px, '
            f'outside an image of {geometry.width} columns')
    return smallest, largest


def search_interval(limits):
    """Return the smallest interval of whole disparities (first, last) that holds the limits."""
    return math.floor(limits[0]), math.ceil(limits[1])


def points_from_depth(depth, geometry):
    """
    Back-project a depth image: X = (u - cx) Z / fx, Y = (v - cy) Z / fy.

    Parameters
    ----------
    depth : numpy.ndarray, float32, shape (H, W)
        m along Z; NaN = unknown.
    geometry : RectifiedGeometry
        Of the rectified pair.

    Returns
    -------
    points : numpy.ndarray, float32, shape (H, W, 3)
        m, rectified left camera, x right, y down, z forward; NaN = unknown.

    """
    rays_x, rays_y = rays(geometry)
    points = np.empty((*depth.shape, 3), np.float32)
    np.multiply(depth, rays_x, out=points[..., 0])
    np.multiply(depth, rays_y[:, None], out=points[..., 1])
    points[..., 2] = depth
    return points


@lru_cache(maxsize=8)
def rays(geometry):
    """Return X/Z of every column and Y/Z of every row, float32."""
    rays_x = (np.arange(geometry.width) - geometry.center_x_left) / geometry.focal_x
    rays_y = (np.arange(geometry.height) - geometry.center_y) / geometry.focal_y
    return rays_x.astype(np.float32), rays_y.astype(np.float32)
