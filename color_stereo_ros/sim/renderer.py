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
"""Renders what the two cameras of a rig see under a pattern."""

from dataclasses import dataclass, fields
import hashlib
from pathlib import Path

from color_stereo_ros.core.cameras.calibration import StereoCalibration
from color_stereo_ros.errors import ImageError
from color_stereo_ros.files.atomic import written_whole

import numpy as np

from .electronics import expose, exposures_for
from .transport import direct_image, DirectLight, indirect_image, sample_direct, World
from .truth import find_truth, Truth

CACHE_VERSION = 5  # raised when the meaning of cached files changes
SAMPLES = 4        # per pixel along either axis


@dataclass(frozen=True, eq=False)
class Rendering:
    """A simulated pair with its calibration and truth."""

    left_rgb: np.ndarray
    """uint8 (H, W, 3), raw; uint16 above 8 bits, (H, W) without demosaicing."""
    right_rgb: np.ndarray
    """Like left_rgb."""
    calibration: StereoCalibration
    truth: Truth
    exposures: tuple
    """Exposure of the left and of the right camera."""
    radiance: tuple
    """float64 (H, W, 3) of the left and of the right camera, before lens and electronics."""


class Renderer:
    """
    Renders one scene under many patterns.

    Parameters
    ----------
    scene : Scene
    samples : int
        Samples per pixel along either axis; 4 means 16 samples per pixel.
    indirect : bool, optional
        Overrides the scene: whether light that bounces between objects is rendered.
    cache : path-like, optional
        Folder that keeps what does not depend on the pattern, and bounced light per pattern.
    frame : int
        Frame of a sequence.

    Raises
    ------
    SimulatorMissingError
        If Mitsuba is not installed.

    """

    def __init__(self, scene, *, samples=SAMPLES, indirect=None, cache=None, frame=0):
        self.scene = scene.at(frame)
        self.samples = samples
        self.indirect = scene.indirect if indirect is None else indirect
        self.cache = None if cache is None else Path(cache).expanduser()
        self._world = None
        self._direct = {}
        self._truth = {}
        self._prepared = {}

    @property
    def world(self):
        """Return the scene in Mitsuba's memory, loaded when first needed."""
        if self._world is None:
            self._world = World(self.scene)
        return self._world

    def render(self, pattern, *, seed=0, with_truth=True):
        """
        Render the pair under a pattern.

        Parameters
        ----------
        pattern : numpy.ndarray, uint8, shape (H', W', 3)
            RGB values sent to the projector.
        seed : int
            Of the noise; the same seed gives the same bytes.
        with_truth : bool
            False leaves `truth` None.

        Returns
        -------
        rendering : Rendering

        Raises
        ------
        ImageError
            If the pattern is no uint8 RGB image.

        """
        _check_pattern(pattern)
        rig = self.scene.rig
        radiance = tuple(self._light(camera, pattern) for camera in (rig.left, rig.right))
        exposures = exposures_for(radiance, (rig.left, rig.right))
        images = [expose(light, camera, exposure, np.random.SeedSequence([seed, side]))
                  for side, (light, camera, exposure) in enumerate(
                      zip(radiance, (rig.left, rig.right), exposures))]
        truth = self.truth(pattern.shape[:2]) if with_truth else None
        return Rendering(*images, rig.calibration, truth, exposures, radiance)

    def radiance(self, camera, pattern):
        """Return all light that reaches a camera's pixels, float64 (H, W, 3)."""
        light = self.direct(camera)
        image = direct_image(light, camera, self.scene.rig.projector, pattern)
        if light.ambient.size:
            image += light.ambient * np.asarray(self.scene.ambient)
        if self.indirect:
            image += self._bounced(camera, light, pattern)
        return image

    def _light(self, camera, pattern):
        prepared = self._prepared.pop((camera.name, _digest(pattern)), None)
        return self.radiance(camera, pattern) if prepared is None else prepared

    def prepare(self, camera, pattern):
        """Trace the light of a camera now, so that the next `render` is quick."""
        _check_pattern(pattern)
        self._prepared[camera.name, _digest(pattern)] = self.radiance(camera, pattern)

    def direct(self, camera):
        """Return the DirectLight of a camera, from memory, the cache folder, or traced now."""
        if camera.name not in self._direct:
            with_ambient = max(self.scene.ambient) > 0
            self._direct[camera.name] = self._cached(
                f'direct-{camera.name}-{with_ambient}', DirectLight,
                lambda: sample_direct(self.world, camera, self.samples, _seed_of(camera),
                                      with_ambient))
        return self._direct[camera.name]

    def truth(self, pattern_shape):
        """Return the Truth for a pattern of so many rows and columns."""
        aspect = round(pattern_shape[0] / pattern_shape[1], 6)
        if aspect not in self._truth:
            self._truth[aspect] = self._cached(
                f'truth-{aspect}', Truth, lambda: find_truth(self.world, pattern_shape))
        return self._truth[aspect]

    def _bounced(self, camera, light, pattern):
        return self._cached(
            f'bounced-{camera.name}-{_digest(pattern)}', _Image,
            lambda: _Image(indirect_image(self.world, light, camera, pattern, self.samples,
                                          _seed_of(camera)))).pixels

    def _cached(self, name, kind, compute):
        """Return a dataclass of arrays from the cache folder, or compute and keep it."""
        if self.cache is None:
            return compute()
        path = self.cache / f'{self.scene.name}-{self.scene.fingerprint}' / (
            f'{name}-{self.samples}-v{CACHE_VERSION}.npz')
        if path.is_file():
            with np.load(path) as content:
                return kind(**{field.name: content[field.name] for field in fields(kind)})
        value = compute()
        with written_whole(path) as partial:
            np.savez(partial, **{field.name: getattr(value, field.name)
                                 for field in fields(kind)})
        return value


@dataclass(frozen=True, eq=False)
class _Image:
    """An image in the cache."""

    pixels: np.ndarray


def _digest(pattern):
    """Return a short hash of a pattern."""
    return hashlib.sha256(pattern.tobytes() + str(pattern.shape).encode()).hexdigest()[:12]


def _seed_of(camera):
    """Return a seed of the light paths: they do not depend on the seed of the noise."""
    return 11 if camera.name == 'left' else 23


def _check_pattern(pattern):
    if not isinstance(pattern, np.ndarray) or pattern.dtype != np.uint8 or pattern.ndim != 3 \
            or pattern.shape[2] != 3 or pattern.size == 0:
        shape = getattr(pattern, 'shape', None)
        raise ImageError(f'pattern is a {type(pattern).__name__} of shape {shape} and type '
                         f'{getattr(pattern, "dtype", None)}, expected uint8 (H, W, 3) RGB')


def render(scene, pattern, *, seed=0, samples=SAMPLES, indirect=None, cache=None, frame=0,
           with_truth=True):
    """Render a scene once; see Renderer for the arguments. Returns a Rendering."""
    renderer = Renderer(scene, samples=samples, indirect=indirect, cache=cache, frame=frame)
    return renderer.render(pattern, seed=seed, with_truth=with_truth)
