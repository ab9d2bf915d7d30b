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
"""What is measured in the scene: the point under the mouse, distances, planes."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..errors import SettingsError

REACH = 0.006
"""rad; chosen: so far from the mouse a point may be, some pixels of the window."""
SURFACE = 0.02
"""Share of the distance; chosen: of points within it the nearest to the mouse counts."""
LEAST = 10
"""Points of a plane; chosen: fewer tell little about a residual."""


@dataclass(frozen=True)
class Distance:
    """How far two points are from each other."""

    value: float
    """m."""
    std: float
    """m, from the standard deviations of both depths, which count as independent."""


@dataclass(frozen=True, eq=False)
class FittedPlane:
    """The plane with the least squares of the distances to some points."""

    center: np.ndarray
    """float64 (3,), m."""
    normal: np.ndarray
    """float64 (3,), unit, towards the camera."""
    rms: float
    """m, of the distances of the points from the plane."""
    largest: float
    """m, the largest of them."""
    tilt: float
    """degrees, between the normal and the optical axis."""
    count: int
    """Points."""


def point_on_ray(points, origin, direction):
    """
    Return the pixel whose point is under the mouse.

    Parameters
    ----------
    points : numpy.ndarray, float32, shape (H, W, 3)
        m; NaN = unknown.
    origin, direction : array-like, shape (3,)
        Of the ray, rectified left camera, m.

    Returns
    -------
    pixel : (int, int) or None
        Column and row.

    """
    direction = np.asarray(direction, np.float32) / np.float32(np.linalg.norm(direction))
    away = points - np.asarray(origin, np.float32)
    along = away @ direction
    off = np.linalg.norm(away - along[..., None] * direction, axis=-1)
    with np.errstate(invalid='ignore', divide='ignore'):
        angle = np.where(along > 0, off / along, np.inf)
        near = angle < REACH
        if not near.any():
            return None
        front = along[near].min()
        angle[~near | (along > front * (1 + SURFACE))] = np.inf
    row, column = np.unravel_index(np.argmin(angle), angle.shape)
    return int(column), int(row)


def distance(result, points, first, second):
    """
    Return the Distance of two pixels that have a range.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    points : numpy.ndarray, float32, shape (H, W, 3)
        Of the result.
    first, second : (int, int)
        Column and row.

    """
    (a, b) = (points[row, column].astype(np.float64) for column, row in (first, second))
    value = float(np.linalg.norm(b - a))
    along = (b - a) / value if value else np.array([0.0, 0.0, 1.0])
    # an error of the depth moves a point along its ray: dX = X / Z dZ
    parts = [float(along @ (point / point[2])) * float(result.depth_std[row, column])
             for point, (column, row) in ((a, first), (b, second))]
    return Distance(value, float(np.hypot(*parts)))


def fitted_plane(points):
    """
    Fit a plane.

    Parameters
    ----------
    points : numpy.ndarray, float, shape (N, 3)
        m.

    Returns
    -------
    plane : FittedPlane

    Raises
    ------
    SettingsError
        For fewer than LEAST points.

    """
    if len(points) < LEAST:
        raise SettingsError(f'{len(points)} points have a range there, a plane needs {LEAST}')
    points = np.asarray(points, np.float64)
    center = points.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov((points - center).T, bias=True))
    normal = vectors[:, 0] * (-1 if vectors[2, 0] > 0 else 1)
    off = (points - center) @ normal
    return FittedPlane(center, normal, float(np.sqrt(max(values[0], 0.0))),
                       float(np.abs(off).max()),
                       float(np.degrees(np.arccos(min(-normal[2], 1.0)))), len(points))


def inside_polygon(corners, size):
    """
    Return which pixels a polygon holds, its border included, bool (H, W).

    Parameters
    ----------
    corners : list of (int, int)
        Column and row.
    size : (int, int)
        Width and height of the image, px.

    """
    inside = np.zeros(size[::-1], np.uint8)
    cv2.fillPoly(inside, [np.array(corners, np.int32)], 1)
    return inside.view(bool)


def inside_box(points, camera, low, high):
    """
    Return which points a box in the window holds, bool (N,).

    Parameters
    ----------
    points : numpy.ndarray, float, shape (N, 3)
        m.
    camera : object
        With `rotation` (3, 3), from the camera's axes (x right, y down, z forward) to the scene,
        `position` (3,), `fov` (vertical, rad) and `aspect`.
    low, high : (float, float)
        Corners in shares of the window, (0, 0) = upper left.

    """
    seen = (points - camera.position) @ camera.rotation
    with np.errstate(invalid='ignore', divide='ignore'):
        scale = seen[:, 2] * np.tan(camera.fov / 2)
        x = 0.5 + 0.5 * seen[:, 0] / (scale * camera.aspect)
        y = 0.5 + 0.5 * seen[:, 1] / scale
        return ((seen[:, 2] > 0) & (x >= low[0]) & (x <= high[0]) & (y >= low[1])
                & (y <= high[1]))
