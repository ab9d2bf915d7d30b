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
"""Pairs from the simulated rig, kept in a folder in the layout of `datasets.load_folder`."""

from dataclasses import replace
import hashlib
from pathlib import Path

from .datasets import load_folder, save_folder, Scene
from .metrics import Truth
from .noise_limit import BAYER_SHARES, CameraNoise
from ..core import make_pattern, PatternSettings
from ..core.settings import flat, Settings

FULL_SCALE = 255  # DN
FORMAT = 2  # raised when the meaning of kept pairs changes


class Renders:
    """
    Renders pairs and keeps them.

    Parameters
    ----------
    folder : path-like
        Where the pairs are kept; a pair that is there is not rendered again.
    samples : int
        Samples per pixel along either axis.
    seed : int
        Of the noise.

    """

    def __init__(self, folder, samples=3, seed=1):
        self.folder = Path(folder)
        self.samples = samples
        self.seed = seed
        self._renderer = None

    def pair(self, name, pattern):
        """
        Return a scene that comes with the package, lit with a pattern.

        Parameters
        ----------
        name : str
            One of `sim.scene_names()`.
        pattern : PatternSettings
            Of the pattern that is projected.

        Returns
        -------
        scene : color_stereo_ros.evaluation.datasets.Scene

        """
        from .. import sim
        scene = sim.load_scene(name)
        image = make_pattern(pattern)
        key = hashlib.sha256(repr((scene.fingerprint, image.shape, self.samples, self.seed, FORMAT)
                                  ).encode() + image.tobytes()).hexdigest()[:10]
        path = self.folder / f'{scene.name}-{pattern.type}-{key}'
        if not path.exists():
            rendering = self.renderer(scene).render(image, seed=self.seed)
            save_folder(as_scene(scene, rendering, pattern), path)
        return replace(load_folder(path), name=scene.name)

    def renderer(self, scene):
        """Return the Renderer of a scene; that of the last scene is kept for more patterns."""
        from .. import sim
        if self._renderer is None or self._renderer.scene.fingerprint != scene.fingerprint:
            self._renderer = sim.Renderer(scene, samples=self.samples)
        return self._renderer


def as_scene(scene, rendering, pattern):
    """
    Return a rendering as a scene of the evaluation.

    Parameters
    ----------
    scene : color_stereo_ros.sim.Scene
        What is rendered.
    rendering : color_stereo_ros.sim.Rendering
        Images and truth of the renderer.
    pattern : PatternSettings
        Of the pattern that is projected.

    Returns
    -------
    scene : color_stereo_ros.evaluation.datasets.Scene

    """
    near, far = scene.rig.depth_limits
    settings = {'range.min_depth': float(near), 'range.max_depth': float(far),
                **pattern_values(pattern)}
    if scene.rig.left.sensitivity == scene.rig.right.sensitivity:
        settings['color.equalize_cameras'] = 'shared'  # two cameras of one type, as in sec. 3
    noise = tuple(camera_noise(camera) for camera in (scene.rig.left, scene.rig.right))
    truth = Truth(rendering.truth.depth, rendering.truth.visible)
    return Scene(scene.name, rendering.left_rgb, rendering.right_rgb, rendering.calibration,
                 truth, settings, 'of the rig', () if None in noise else noise)


def pattern_values(pattern):
    """Return the flat settings in which a pattern differs from the default one."""
    default = flat(Settings())
    values = flat(replace(Settings(), pattern=pattern))
    return {name: value for name, value in values.items() if value != default[name]}


def camera_noise(camera):
    """Return the CameraNoise of a simulated camera, None if its response is not linear."""
    if camera.response not in ('linear', 1.0) or camera.bits > 8:
        return None
    step = FULL_SCALE / camera.full_well  # DN per electron
    floor = (step * camera.read_noise) ** 2 + 1 / 12  # rounding
    return CameraNoise(
        (floor,) * 3, (step,) * 3, float(camera.speckle), (float(camera.dark_level),) * 3,
        (1.0, 1.0, 1.0) if camera.bayer == 'none' else BAYER_SHARES)


def default_pattern():
    """Return the package's own pattern."""
    return PatternSettings()


def paper_pattern():
    """Return the paper's pattern: one sweep of constant brightness (fig. 2.2, right)."""
    return PatternSettings(type='sweep')
