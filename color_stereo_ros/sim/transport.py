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
Light transport: how much light of each projector pixel reaches each camera pixel.

Direct light is sampled once per scene: every sample of a camera pixel stores its place in the
projected image and its brightness under a white pattern. A new pattern is then a table
look-up. Light that bounces is path-traced for each pattern and smoothed along the surfaces.

"""

from dataclasses import dataclass
from pathlib import Path
import tempfile

import numpy as np

from ._kernels import accumulate, project_pattern, smooth_on_surfaces
from .materials import bsdf
from .projection import pattern_light, pattern_stack, projector_coordinates
from .shapes import INK_MATERIAL, mitsuba_shapes
from .variant import load_mitsuba

# Rays must not slip through between the triangles of a mesh.
SCENE = {'type': 'scene', 'embree_use_robust_intersections': True}
SMOOTHING_RADIUS = 6      # px, window of the indirect light
SMOOTHING_SPREAD = 0.002  # m from the tangent plane
SMOOTH_SAMPLES = 2        # per pixel along either axis, at most, of light that is smoothed
FIREFLY_LIMIT = 8.0       # indirect light of one sample, times the mean direct light


@dataclass(frozen=True, eq=False)
class DirectLight:
    """Samples of one camera that the projector lights directly, and the pixels' surfaces."""

    column: np.ndarray
    """float32 (N,), pattern column as a share of the width, 0..1."""
    row: np.ndarray
    """float32 (N,), pattern row relative to the optical axis, in widths."""
    depth: np.ndarray
    """float32 (N,), m along the axis of the projector."""
    weight: np.ndarray
    """float32 (N, 3), share of a pixel's radiance per unit of projected light."""
    pixel: np.ndarray
    """int32 (N,), flat index of the camera pixel."""
    albedo: np.ndarray
    """float32 (H, W, 3), mean albedo."""
    normal: np.ndarray
    """float32 (H, W, 3), mean normal, scene frame; 0 = background."""
    position: np.ndarray
    """float32 (H, W, 3), mean position, m, scene frame."""
    ambient: np.ndarray
    """float32 (H, W, 3), radiance that surroundings of radiance 1 cause; empty = none."""


class World:
    """A scene in Mitsuba's memory."""

    def __init__(self, scene):
        self.mitsuba = load_mitsuba()
        self.scene = scene
        with tempfile.TemporaryDirectory() as folder:
            self.shapes = self._shapes(Path(folder))
        self.bare = self.mitsuba.load_dict({**SCENE, **self.shapes})

    def _shapes(self, folder):
        shapes = {}
        for index, thing in enumerate(self.scene.objects):
            material = self.mitsuba.load_dict(bsdf(self.mitsuba, thing.material))
            ink = self.mitsuba.load_dict(bsdf(self.mitsuba, INK_MATERIAL))
            for part, (shape, inked) in enumerate(mitsuba_shapes(self.mitsuba, thing, folder)):
                shapes[f'object_{index}_{part}'] = self.mitsuba.load_dict(
                    {**shape, 'bsdf': ink if inked else material})
        return shapes

    def lit_by(self, emitter):
        """Return the Mitsuba scene with one light."""
        return self.mitsuba.load_dict({**SCENE, **self.shapes, 'light': emitter})

    def transform(self, pose):
        """Return Mitsuba's transform of a camera or projector: its x points left, its y up."""
        matrix = pose.matrix @ np.diag([-1.0, -1.0, 1.0, 1.0])
        return self.mitsuba.ScalarTransform4f(matrix.tolist())

    def white_point(self):
        """Return a point light at the projector."""
        position = self.scene.rig.projector.pose.position
        return {'type': 'point', 'position': position.tolist(),
                'intensity': {'type': 'rgb', 'value': [1.0, 1.0, 1.0]}}

    def pattern_projector(self, light):
        """Return Mitsuba's projector that throws linear light, float32 (H, W, 3)."""
        projector = self.scene.rig.projector
        height, width = light.shape[:2]
        bitmap = self.mitsuba.Bitmap(np.ascontiguousarray(light, np.float32))
        # Mitsuba multiplies the irradiance by pi.
        return {'type': 'projector', 'fov': projector.field_of_view, 'fov_axis': 'x',
                'irradiance': {'type': 'bitmap', 'bitmap': bitmap, 'raw': True,
                               'filter_type': 'bilinear', 'wrap_mode': 'clamp'},
                'scale': projector.power / np.pi, 'to_world': self.transform(projector.pose)}


@dataclass(frozen=True, eq=False)
class View:
    """A pinhole field of square sub-pixels that covers everything a (distorted) camera sees."""

    columns: int
    rows: int
    pitch: float
    """Side of a sub-pixel in normalized image coordinates."""

    @classmethod
    def of(cls, camera, samples):
        """Return the field with `samples` x `samples` sub-pixels in each pixel of a camera."""
        edge = _border(camera)
        rays = camera.lens.undistort(edge, camera.K, camera.D)
        reach = np.abs(rays).max(axis=0)
        pitch = 1.0 / (max(camera.K[0, 0], camera.K[1, 1]) * samples)
        # Rounding must not add a sub-pixel to a whole number of them.
        columns, rows = (2 * np.ceil(reach / pitch - 1e-6)).astype(int)
        return cls(int(columns), int(rows), pitch)

    def sensor(self, world, pose):
        """Return Mitsuba's description of the camera at a pose, one sample per sub-pixel."""
        half = self.columns / 2 * self.pitch
        return world.mitsuba.load_dict({
            'type': 'perspective', 'fov': float(np.degrees(2 * np.arctan(half))),
            'fov_axis': 'x', 'near_clip': 1e-3, 'far_clip': 1e3,
            'to_world': world.transform(pose),
            'sampler': {'type': 'independent', 'sample_count': 1},
            'film': {'type': 'hdrfilm', 'width': self.columns, 'height': self.rows,
                     'pixel_format': 'rgb', 'component_format': 'float32',
                     'rfilter': {'type': 'box'}}})

    def centers(self):
        """Return the normalized coordinates of the sub-pixels, float64 (rows * columns, 2)."""
        x = (np.arange(self.columns) + 0.5 - self.columns / 2) * self.pitch
        y = (np.arange(self.rows) + 0.5 - self.rows / 2) * self.pitch
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _border(camera):
    """Return points along the outer edge of a raw image, float64 (N, 2), px."""
    left, top, right, bottom = -0.5, -0.5, camera.width - 0.5, camera.height - 0.5
    x, y = np.linspace(left, right, 101), np.linspace(top, bottom, 101)
    return np.concatenate([np.column_stack([x, np.full(101, top)]),
                           np.column_stack([x, np.full(101, bottom)]),
                           np.column_stack([np.full(101, left), y]),
                           np.column_stack([np.full(101, right), y])])


def pixel_index(camera, rays):
    """Return the flat pixel that each normalized ray (N, 2) falls into, -1 = outside."""
    # Beyond the corners a distortion polynomial may fold back into the image.
    reach = np.abs(camera.lens.undistort(_border(camera), camera.K, camera.D))
    regular = (np.abs(rays) <= 1.001 * reach.max(axis=0)).all(axis=1)
    column, row = (np.floor(each + 0.5)
                   for each in camera.pixels(camera.lens.distort(rays, camera.D)))
    inside = (regular & (column >= 0) & (column < camera.width)
              & (row >= 0) & (row < camera.height))
    index = np.full(len(rays), -1, np.int32)
    index[inside] = (row * camera.width + column)[inside]
    return index


def _averaged(values, pixel, camera):
    """Return the mean of the samples (N, C) of every pixel, and their number (H * W,)."""
    total = np.zeros((camera.width * camera.height, values.shape[1]))
    count = np.zeros(len(total), np.int64)
    accumulate(values, pixel, total, count)
    return total / np.maximum(count, 1)[:, None], count


def _render(world, lit, view, pose, integrator, seed):
    """Return the channels of every sub-pixel, float32 (N, C)."""
    image = world.mitsuba.render(
        lit, sensor=view.sensor(world, pose), spp=1, seed=seed,
        integrator=world.mitsuba.load_dict(integrator))
    return np.array(image).reshape(view.rows * view.columns, -1)


def sample_direct(world, camera, samples, seed, with_ambient):
    """
    Sample the direct light of one camera.

    Parameters
    ----------
    world : World
        The scene as the renderer holds it.
    camera : Camera
        The simulated camera.
    samples : int
        Samples per pixel along either axis.
    seed : int
        Of the random numbers.
    with_ambient : bool
        Add the light of the room.

    Returns
    -------
    light : DirectLight

    """
    view = View.of(camera, samples)
    lit = world.lit_by(world.white_point())
    values = _render(world, lit, view, camera.pose, {
        'type': 'aov', 'aovs': 'p:position,a:albedo,n:sh_normal',
        'light': {'type': 'direct', 'hide_emitters': True}}, seed)
    radiance, position, albedo, normal = np.split(values[:, :12], 4, axis=1)
    hit = np.any(normal != 0, axis=1)
    rays = view.centers()
    local = camera.pose.to_child(position[hit].astype(np.float64))
    rays[hit] = local[:, :2] / local[:, 2:]
    pixel = pixel_index(camera, rays)
    surfaces, count = _averaged(np.concatenate([albedo, normal, position], axis=1), pixel, camera)
    surfaces = surfaces.reshape(*camera.shape, 9).astype(np.float32)
    lit = np.flatnonzero((pixel >= 0) & hit & (radiance.max(axis=1) > 0))
    column, row, depth, falloff = projector_coordinates(world.scene.rig.projector, position[lit])
    ahead = (falloff > 0) & (np.abs(column - 0.5) <= 0.5)
    lit, column, row, depth, falloff = (
        values[ahead] for values in (lit, column, row, depth, falloff))
    weight = radiance[lit] * (falloff / count[pixel[lit]])[:, None]
    return DirectLight(
        column=column.astype(np.float32), row=row.astype(np.float32),
        depth=depth.astype(np.float32), weight=weight.astype(np.float32), pixel=pixel[lit],
        albedo=surfaces[..., :3], normal=surfaces[..., 3:6], position=surfaces[..., 6:],
        ambient=_ambient(world, camera, samples, seed, surfaces) if with_ambient
        else np.empty(0, np.float32))


def _ambient(world, camera, samples, seed, surfaces):
    """Return the radiance that uniform surroundings of radiance 1 cause, float32 (H, W, 3)."""
    view = View.of(camera, min(samples, SMOOTH_SAMPLES))
    lit = world.lit_by({'type': 'constant', 'radiance': {'type': 'rgb', 'value': 1.0}})
    values = _render(world, lit, view, camera.pose, {
        'type': 'path', 'max_depth': world.scene.bounces + 1, 'hide_emitters': True}, seed + 1)
    return _on_surfaces(values[:, :3], pixel_index(camera, view.centers()), camera, surfaces)


def _on_surfaces(radiance, pixel, camera, surfaces):
    """Average samples over pixels and smooth them along surfaces, texture apart."""
    image = _averaged(radiance, pixel, camera)[0].reshape(*camera.shape, 3)
    albedo = np.maximum(surfaces[..., :3], 0.02)
    light = np.where(surfaces[..., 3:6].any(axis=-1, keepdims=True), image / albedo, 0)
    smooth = np.empty(light.shape, np.float32)
    smooth_on_surfaces(light.astype(np.float32), np.ascontiguousarray(surfaces[..., 3:6]),
                       np.ascontiguousarray(surfaces[..., 6:]), SMOOTHING_RADIUS,
                       SMOOTHING_SPREAD, smooth)
    return smooth * albedo


def direct_image(light, camera, projector, pattern):
    """
    Return the radiance of direct projector light.

    Parameters
    ----------
    light : DirectLight
        What the projector gives without detours.
    camera : Camera
        The simulated camera.
    projector : Projector
        The simulated projector.
    pattern : numpy.ndarray, uint8, shape (H', W', 3)
        The image that the projector shows, RGB.

    Returns
    -------
    radiance : numpy.ndarray, float64, shape (H, W, 3)

    """
    height, width = pattern.shape[:2]
    stack, level_of = pattern_stack(projector, pattern, light.depth)
    row = light.row * width + (0.5 + projector.offset) * height - 0.5
    column = light.column * width - 0.5
    inside = (row >= -0.5) & (row <= height - 0.5)
    weight = light.weight * np.float32(projector.power) * inside[:, None]
    image = np.zeros((camera.width * camera.height, 3))
    project_pattern(stack, level_of(light.depth), column, row, weight, light.pixel, image)
    return image.reshape(*camera.shape, 3)


def indirect_image(world, light, camera, pattern, samples, seed):
    """
    Path-trace the projector's light that bounces at least twice.

    Parameters
    ----------
    world : World
        The scene as the renderer holds it.
    light : DirectLight
        Of the same camera.
    camera : Camera
        The simulated camera.
    pattern : numpy.ndarray, uint8, shape (H', W', 3)
        The image that the projector shows, RGB.
    samples : int
        Samples per pixel along either axis.
    seed : int
        Of the random numbers.

    Returns
    -------
    radiance : numpy.ndarray, float64, shape (H, W, 3)

    """
    view = View.of(camera, min(samples, SMOOTH_SAMPLES))
    lit = world.lit_by(world.pattern_projector(
        pattern_light(world.scene.rig.projector, pattern)))
    values = _render(world, lit, view, camera.pose, {
        'type': 'aov', 'aovs': 'p:position',
        'all': {'type': 'path', 'max_depth': world.scene.bounces + 1, 'rr_depth': 64},
        'first': {'type': 'direct'}}, seed + 2)
    # Both integrators start with the same camera ray, so their difference is what bounced.
    bounced = np.maximum(values[:, :3] - values[:, 3:6], 0)
    limit = FIREFLY_LIMIT * max(float(values[:, 3:6].mean()), 1e-12)
    pixel = pixel_index(camera, view.centers())
    surfaces = np.concatenate([light.albedo, light.normal, light.position], axis=-1)
    return _on_surfaces(np.minimum(bounced, limit), pixel, camera, surfaces).astype(np.float64)
