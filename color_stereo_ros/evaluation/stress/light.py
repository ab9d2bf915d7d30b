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
Linear light of simulated scenes, kept in a folder, from which every disturbed pair is made.

Each scene is rendered once, at twice the resolution and with a margin, under every pattern. Lens,
mounting and electronics are applied later, so that a disturbance costs no ray.

"""

from dataclasses import dataclass, replace
import hashlib
from pathlib import Path

import cv2
import numpy as np

from . import patterns
from ..metrics import Truth
from ...core import make_pattern, PatternSettings, StereoCalibration
from ...core.triangulation import disparity_from_depth
from ...files.atomic import folder_written_whole

FORMAT = 2     # raised when the meaning of kept files changes
SCALE = 2      # fine pixels in each pixel along either axis
MARGIN = 28    # px around the image: mountings move it by up to 20 px
BORDER = 1e-3  # px, rounding at the border of an image
SAMPLES = 2    # per fine pixel along either axis
OBJECT = 0.075  # m, radius about the middle of the scene of what can be recolored
PRINT = 0.003, 0.03  # m, shortest and longest wave of the print in space
WAVES = 28     # of the print

VERGED = {'base': 'paper', 'cameras': {'width': 640, 'height': 480}}
BARREL = {'base': 'effector', 'cameras': {'distortion': [-0.28, 0.09, 0.0006, -0.0004, -0.01]}}
PORTRAIT = {'base': 'effector', 'cameras': {'width': 480, 'height': 640}}
UNEQUAL = {'base': 'effector', 'right': {'focal': 480}}
SCENES = {
    'casting': ('casting', VERGED), 'effector_bin': ('effector_bin', 'effector'),
    'tilt_30': ('tilt_30', VERGED), 'airplane': ('airplane', VERGED),
    'printed': ('printed', VERGED), 'effector_nut': ('effector_nut', 'effector'),
    'barrel': ('effector_nut', BARREL), 'portrait': ('effector_nut', PORTRAIT),
    'unequal': ('effector_nut', UNEQUAL)}
"""Names of the stress test to scenes that come with the package, and their rigs."""

MAIN = ('casting', 'effector_bin', 'tilt_30', 'airplane', 'printed', 'effector_nut')
"""Solids with bends, parts in a bin, a tilted board, thin parts, print, metal: 640 x 480 px."""

QUICK = ('casting', 'effector_bin')


@dataclass(frozen=True, eq=False)
class LightScene:
    """One scene as both cameras see it, before lens and electronics, and its truth."""

    name: str
    calibration: StereoCalibration
    depth_limits: tuple
    """Nearest and farthest Z for which the rig is made, m."""
    depth: np.ndarray
    """float64 (H, W), m along Z of the rectified left camera, NaN = nothing there."""
    in_left: np.ndarray
    """bool (H, W), a surface inside the left raw image."""
    clear: np.ndarray
    """bool (H, W), a surface that nothing hides from the right camera."""
    lit: np.ndarray
    """bool (H, W), a surface that the projector lights."""
    arrays: object
    """Mapping of `left_KEY` and `right_KEY` to float16 light or uint8 masks."""
    scale: int = SCALE
    margin: int = MARGIN

    def light(self, side, key):
        """Return the light of one camera, 'left' or 'right', float32 (H', W', 3)."""
        return self.arrays[f'{side}_{key}'].astype(np.float32)

    def mask(self, side, key):
        """Return a mask, 'object' or 'ink', float32 (H', W', 1), 0..1."""
        return self.arrays[f'{side}_{key}'].astype(np.float32)[..., None] / 255

    def cropped(self, light):
        """Return fine light without the margin in pixels of the camera, float64 (H, W, 3)."""
        cut = slice(self.scale * self.margin, -self.scale * self.margin)
        size = self.calibration.left.width, self.calibration.left.height
        return cv2.resize(light[cut, cut], size, interpolation=cv2.INTER_AREA).astype(np.float64)

    def truth(self, mounting):
        """
        Return the truth of the pair that a right camera of this mounting gives.

        Parameters
        ----------
        mounting : Mounting
            How the cameras are mounted.

        Returns
        -------
        truth : Truth
            Its disparity is that of the true correspondence in the pair as given.

        """
        geometry = self.calibration.geometry
        row, column = np.indices(self.depth.shape, np.float64)
        match = column - disparity_from_depth(self.depth, geometry)
        known = np.isfinite(match)
        raw, place = mounting.true_pixels(np.column_stack([match[known], row[known]]),
                                          self.calibration.right)
        last = np.array([geometry.width - 1, geometry.height - 1])
        inside = np.zeros(known.shape, bool)
        inside[known] = (_inside(raw, last) & _inside(place, last)).all(axis=1)
        disparity = np.full(known.shape, np.nan)
        disparity[known] = column[known] - place[:, 0]
        return Truth(depth=self.depth, disparity=disparity, lit=self.lit & self.in_left,
                     visible=self.in_left & self.clear & self.lit & inside)


def _inside(places, last):
    return (places >= -BORDER) & (places <= last + BORDER)


class LightScenes:
    """
    Renders light and keeps it.

    Parameters
    ----------
    folder : path-like
        Where it is kept; a scene that is there is not rendered again.
    samples : int
        Samples per fine pixel along either axis.

    """

    def __init__(self, folder, samples=SAMPLES):
        self.folder = Path(folder)
        self.samples = samples

    def scene(self, name):
        """Return the LightScene of a name in `SCENES`, rendered now or earlier."""
        from ... import sim
        source, rig = SCENES[name]
        scene = sim.load_scene(source, rig=rig)
        key = hashlib.sha256(repr((scene.fingerprint, self.samples, SCALE, MARGIN, FORMAT)
                                  ).encode()).hexdigest()[:10]
        path = self.folder / f'{name}-{key}'
        if not path.exists():
            arrays = render(scene, self.samples)
            with folder_written_whole(path) as partial:
                partial.mkdir()
                scene.rig.calibration.to_yaml(partial / 'left.yaml', partial / 'right.yaml')
                np.savez(partial / 'light.npz', **arrays)
        return load(path, name)


def load(path, name):
    """Return the LightScene of a folder with light.npz, left.yaml and right.yaml."""
    path = Path(path)
    arrays = np.load(path / 'light.npz')
    return LightScene(
        name=name, arrays=arrays, depth=arrays['depth'].astype(np.float64),
        calibration=StereoCalibration.from_yaml(path / 'left.yaml', path / 'right.yaml'),
        depth_limits=tuple(map(float, arrays['depth_limits'])),
        in_left=arrays['in_left'], clear=arrays['clear'], lit=arrays['lit'],
        scale=int(arrays['scale']), margin=int(arrays['margin']))


def render(scene, samples=SAMPLES, shown=None):
    """
    Render the light of a scene under every pattern.

    Parameters
    ----------
    scene : color_stereo_ros.sim.Scene
        What is rendered.
    samples : int
        Samples per fine pixel along either axis.
    shown : iterable, optional
        Instead of `patterns.shown()`.

    Returns
    -------
    arrays : dict of str to numpy.ndarray
        The content of light.npz; see docs/stress.md.

    """
    from ... import sim
    renderer = sim.Renderer(scene, samples=samples)
    shape = make_pattern(PatternSettings()).shape
    truth = renderer.truth(shape[:2])
    arrays = {'scale': SCALE, 'margin': MARGIN, 'depth_limits': np.array(scene.rig.depth_limits),
              'depth': truth.depth, 'lit': truth.lit, 'clear': truth.clear,
              'in_left': truth.seen_by_both | truth.seen_by_left_only}
    middle = None
    for camera in (scene.rig.left, scene.rig.right):
        soft = _soft_light(renderer, widened(camera, 1), np.full(shape, 255, np.uint8))
        fine = widened(camera, SCALE)
        soft = {key: cv2.resize(light.astype(np.float32), (fine.width, fine.height))
                for key, light in soft.items()}
        surfaces = _direct_light(renderer, fine, soft, shown or patterns.shown(), arrays)
        if middle is None:
            middle = np.median(surfaces.position[surfaces.normal.any(axis=-1)], axis=0)
        away = np.linalg.norm((surfaces.position - middle)[..., :2], axis=-1)
        arrays[f'{camera.name}_object'] = np.uint8(255 * (away < OBJECT))
        arrays[f'{camera.name}_ink'] = print_in_space(surfaces.position)
        arrays[f'{camera.name}_ambient'] = soft['ambient'].astype(np.float16)
    return arrays


def widened(camera, scale):
    """Return a simulated camera with a margin and `scale` times the resolution."""
    K = camera.K.copy()
    K[:2, :2] *= scale
    K[:2, 2] = (K[:2, 2] + MARGIN + 0.5) * scale - 0.5
    return replace(camera, K=K, width=scale * (camera.width + 2 * MARGIN),
                   height=scale * (camera.height + 2 * MARGIN))


def _soft_light(renderer, camera, white):
    """Return light that varies slowly: of the surroundings, and bounced under a white pattern."""
    camera = replace(camera, name=f'{camera.name} coarse')
    ambient = renderer.direct(camera).ambient
    renderer.indirect = False
    direct = renderer.radiance(camera, white)
    renderer.indirect = renderer.scene.indirect
    bounced = renderer.radiance(camera, white) - direct
    return {'ambient': ambient if ambient.size else np.zeros_like(direct), 'bounced': bounced}


def _direct_light(renderer, camera, soft, shown, arrays):
    """Add the light of one camera under every pattern to the arrays; return its surfaces."""
    from ...sim.transport import direct_image, sample_direct
    projector = renderer.scene.rig.projector
    light = sample_direct(renderer.world, camera, renderer.samples,
                          11 if camera.name == 'left' else 23, False)
    for each in shown:
        changed = replace(projector, **each.projector)
        mean = ((each.image / 255.0) ** changed.gamma).mean(axis=(0, 1))
        total = (direct_image(light, camera, changed, each.image) + soft['bounced'] * mean
                 + soft['ambient'] * np.asarray(renderer.scene.ambient))
        arrays[f'{camera.name}_{each.key}'] = np.minimum(total, 6e4).astype(np.float16)
    return light


def print_in_space(position, seed=3):
    """
    Return a print that fills space, so that both cameras see the same ink on every surface.

    Parameters
    ----------
    position : numpy.ndarray, float32, shape (H, W, 3)
        m.
    seed : int
        Of the random numbers.

    Returns
    -------
    ink : numpy.ndarray, uint8, shape (H, W)
        255 = covered.

    """
    generator = np.random.default_rng(seed)
    direction = generator.standard_normal((WAVES, 3))
    length = np.exp(generator.uniform(*np.log(PRINT), WAVES))
    vectors = 2 * np.pi * direction / (np.linalg.norm(direction, axis=1) * length)[:, None]
    waves = np.zeros(position.shape[:2], np.float32)
    # Sums by hand: those of BLAS depend on the processor and on the order of the pixels in memory.
    x, y, z = (np.ascontiguousarray(axis) for axis in np.moveaxis(position, -1, 0))
    for (a, b, c), phase in zip(vectors.astype(np.float32),
                                generator.uniform(0, 2 * np.pi, WAVES)):
        waves += np.cos(a * x + b * y + c * z + np.float32(phase))
    return np.uint8(255 * (0.5 + 0.5 * np.tanh(1.3 * waves / np.sqrt(WAVES / 2))))
