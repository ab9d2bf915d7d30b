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
"""Truth by ray casting through the center of every rectified pixel."""

from dataclasses import dataclass

import cv2
import numpy as np

from .projection import projector_coordinates
from .variant import is_vectorized

BORDER = 1e-3      # px, rounding at the border of an image
GAP = 2e-5          # m, start of a shadow ray above the surface
EDGE_STEP = 0.01    # relative change of depth between neighbors that makes an edge
EDGE_REGION = 5     # px, half width of the region around an edge


@dataclass(frozen=True, eq=False)
class Truth:
    """What an ideal instrument would measure, in the pixels of the rectified left camera."""

    depth: np.ndarray
    """float32 (H, W), m along Z of the rectified left camera, NaN = nothing there."""
    disparity: np.ndarray
    """float32 (H, W), px, NaN = nothing there."""
    visible: np.ndarray
    """bool (H, W), seen by both cameras and lit."""
    seen_by_both: np.ndarray
    """bool (H, W), a surface inside both raw images and hidden from neither camera."""
    seen_by_left_only: np.ndarray
    """bool (H, W), a surface in the left raw image that the right camera does not see."""
    clear: np.ndarray
    """bool (H, W), a surface that nothing hides from the right camera, beyond its image, too."""
    lit: np.ndarray
    """bool (H, W), a surface that the projector lights directly."""
    edge: np.ndarray
    """bool (H, W), within a few pixels of a depth edge."""


def cast(world, origins, directions):
    """
    Find the nearest surface along rays.

    Parameters
    ----------
    world : World
        The scene as the renderer holds it.
    origins, directions : numpy.ndarray, float64, shape (N, 3)
        m; unit directions.

    Returns
    -------
    distance : numpy.ndarray, float64, shape (N,)
        m, inf = nothing.
    normal : numpy.ndarray, float64, shape (N, 3)
        Geometric normal.

    """
    mi = world.mitsuba
    if is_vectorized(mi):
        rays = mi.Ray3f(mi.Point3f(origins.T.astype(np.float32)),
                        mi.Vector3f(directions.T.astype(np.float32)))
        hit = world.bare.ray_intersect(rays)
        return np.array(hit.t, np.float64), np.array(hit.n, np.float64).T
    distance, normal = np.empty(len(origins)), np.empty(origins.shape)
    for index, (origin, direction) in enumerate(zip(origins.tolist(), directions.tolist())):
        hit = world.bare.ray_intersect(mi.Ray3f(origin, direction))
        distance[index], normal[index] = hit.t, hit.n
    return distance, normal


def sees(world, points, eye):
    """Return whether nothing lies between points (N, 3) and one place (3,), bool (N,)."""
    mi = world.mitsuba
    away = eye - points
    distance = np.linalg.norm(away, axis=1)
    away = away / distance[:, None]
    reach = distance * (1 - 1e-4)
    if is_vectorized(mi):
        rays = mi.Ray3f(mi.Point3f(points.T.astype(np.float32)),
                        mi.Vector3f(away.T.astype(np.float32)))
        rays.maxt = mi.Float(reach.astype(np.float32))
        return ~np.array(world.bare.ray_test(rays), bool)
    clear = np.empty(len(points), bool)
    for index, (point, direction) in enumerate(zip(points.tolist(), away.tolist())):
        ray = mi.Ray3f(point, direction)
        ray.maxt = reach[index]
        clear[index] = not world.bare.ray_test(ray)
    return clear


def inside_image(camera, points):
    """Return whether points (N, 3) of the rig frame fall into the raw image of a camera."""
    local = camera.pose.to_child(points)
    ahead = local[:, 2] > 1e-6
    rays = local[:, :2] / np.where(ahead, local[:, 2], 1.0)[:, None]
    column, row = camera.pixels(camera.lens.distort(rays, camera.D))
    return (ahead & (np.abs(column - (camera.width - 1) / 2) <= (camera.width - 1) / 2 + BORDER)
            & (np.abs(row - (camera.height - 1) / 2) <= (camera.height - 1) / 2 + BORDER))


def rectified_rays(rig):
    """Return unit directions in the rig frame, float64 (H * W, 3), and their Z share (H * W,)."""
    geometry = rig.calibration.geometry
    v, u = np.indices((geometry.height, geometry.width), np.float64)
    rays = np.stack([(u - geometry.center_x_left) / geometry.focal_x,
                     (v - geometry.center_y) / geometry.focal_y, np.ones_like(u)], axis=-1)
    rays = rays.reshape(-1, 3)
    length = np.linalg.norm(rays, axis=1)
    to_rig = rig.left.pose.rotation @ rig.calibration.left.R.T
    return (rays / length[:, None]) @ to_rig.T, 1 / length


def find_truth(world, pattern_shape):
    """
    Cast rays through the centers of all rectified left pixels.

    Parameters
    ----------
    world : World
        The scene as the renderer holds it.
    pattern_shape : (int, int)
        Rows and columns of the pattern: they bound what is lit.

    Returns
    -------
    truth : Truth

    """
    rig = world.scene.rig
    geometry = rig.calibration.geometry
    shape = geometry.height, geometry.width
    directions, z_share = rectified_rays(rig)
    origins = np.broadcast_to(rig.left.pose.position, directions.shape)
    distance, normal = cast(world, origins, directions)
    hit = np.isfinite(distance)
    depth = np.where(hit, distance * z_share, np.nan)
    points = origins[hit] + distance[hit, None] * directions[hit]
    facing = normal[hit] * -np.sign(np.sum(normal[hit] * directions[hit], axis=1))[:, None]
    in_left, clear, both, lit = (np.zeros(hit.size, bool) for _ in range(4))
    in_left[hit] = inside_image(rig.left, points)
    clear[hit] = _clear(world, rig.right, points, facing)
    both[hit] = (in_left[hit] & clear[hit] & inside_image(rig.right, points)
                 & _in_rectified_right(rig, hit, depth))
    lit[hit] = _lit(world, points, facing, pattern_shape)
    depth, in_left, clear, both, lit = (
        each.reshape(shape) for each in (depth, in_left, clear, both, lit))
    return Truth(
        depth=depth.astype(np.float32),
        disparity=(geometry.focal_baseline / depth + geometry.principal_offset).astype(
            np.float32),
        visible=both & lit, seen_by_both=both, seen_by_left_only=in_left & ~both, clear=clear,
        lit=lit, edge=edge_region(depth))


def _in_rectified_right(rig, hit, depth):
    """Return whether the match of each hit pixel is a column of the rectified right image."""
    geometry = rig.calibration.geometry
    match = np.flatnonzero(hit) % geometry.width - (
        geometry.focal_baseline / depth[hit] + geometry.principal_offset)
    return (match >= 0) & (match <= geometry.width - 1)


def _clear(world, camera, points, facing):
    eye = camera.pose.position
    front = np.sum(facing * (eye - points), axis=1) > 0
    return front & sees(world, points + GAP * facing, eye)


def _lit(world, points, facing, pattern_shape):
    projector = world.scene.rig.projector
    column, row, depth, _ = projector_coordinates(projector, points)
    aspect = pattern_shape[0] / pattern_shape[1]
    inside = ((np.abs(column - 0.5) <= 0.5) & (depth > 0)
              & (np.abs(row + projector.offset * aspect) <= aspect / 2))
    eye = projector.pose.position
    front = np.sum(facing * (eye - points), axis=1) > 0
    return inside & front & sees(world, points + GAP * facing, eye)


def edge_region(depth):
    """Return the region around steps of the depth and around its gaps, bool (H, W)."""
    near = np.nan_to_num(depth, nan=0.0)
    step = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        # A slanted plane is no edge: the inverse depth of a plane is linear in the image.
        inverse = np.where(near > 0, 1 / np.where(near > 0, near, 1), 0)
        bend = np.abs(np.diff(inverse, 2, axis=axis))
        jump = bend > EDGE_STEP * np.take(inverse, range(1, depth.shape[axis] - 1), axis)
        inner = [slice(None)] * 2
        inner[axis] = slice(1, -1)
        step[tuple(inner)] |= jump & (np.take(inverse, range(1, depth.shape[axis] - 1), axis) > 0)
    size = 2 * EDGE_REGION + 1
    return cv2.dilate(step.astype(np.uint8), np.ones((size, size), np.uint8)).astype(bool)
