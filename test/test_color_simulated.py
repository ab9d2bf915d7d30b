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
"""Color calibration on the simulated rig: unlike cameras measure as ideal ones do."""

from dataclasses import replace

from color_stereo_ros.calibration.color import calibrate_color
from color_stereo_ros.core import ColorStereo, PatternSettings, Settings
from color_stereo_ros.core.patterns.frames import make_frame
from color_stereo_ros.sim import load_scene, Renderer
from color_stereo_ros.sim.electronics import expose, exposures_for
import numpy as np
import pytest
from unequal_cameras import FRAMES

LEFT = {'response': 2.2, 'crosstalk': 0.1, 'sensitivity': (1.0, 0.9, 0.5)}
RIGHT = {'response': 2.2, 'crosstalk': 0.1, 'sensitivity': (0.8, 1.0, 0.65)}
SCENES = 'flat_350', 'solids'


class Film:
    """The light of a scene under some frames, and what cameras make of it."""

    def __init__(self, name, frames, samples):
        self.scene = load_scene(name)
        renderer = Renderer(self.scene, samples=samples, indirect=False)
        self.cameras = self.scene.rig.left, self.scene.rig.right
        settings = PatternSettings()
        self.light = {frame: [renderer.radiance(camera, make_frame(frame, settings))
                              for camera in self.cameras] for frame in frames}
        self.truth = renderer.truth((settings.height, settings.width))

    def images(self, frame, changes, seed, exposed_for):
        """Return what the two cameras send, changed so; exposure as for a frame."""
        exposures = exposures_for(self.light[exposed_for], self.cameras)
        return [expose(light, replace(camera, **change), exposure, 2 * seed + side)
                for side, (light, camera, change, exposure) in enumerate(zip(
                    self.light[frame], self.cameras, changes, exposures))]

    def depth_error(self, changes, seeds, path=''):
        """Return the mean error of the depth of visible pixels, % of Z."""
        near, far = self.scene.rig.depth_limits
        stereo = ColorStereo(self.scene.rig.calibration, Settings().updated({
            'range.min_depth': near, 'range.max_depth': far, 'color.calibration': str(path)}))
        errors = []
        for seed in seeds:
            depth = stereo.process(*self.images('pattern', changes, seed, 'pattern')).depth
            known = np.isfinite(depth) & self.truth.visible
            assert known.sum() > 0.9 * self.truth.visible.sum()
            errors.append(np.abs(depth[known] / self.truth.depth[known] - 1).mean() * 100)
        return float(np.mean(errors))


@pytest.fixture(scope='module')
def films(effort):
    """Return the films of the scenes, by name; that of the card has all frames."""
    return {name: Film(name, ('pattern', *FRAMES) if name == SCENES[0] else ('pattern',),
                       effort.count(1, 2)) for name in SCENES}


@pytest.fixture(scope='module')
def file(films, tmp_path_factory):
    """Return the file of what is found before the card."""
    pairs = {frame: films[SCENES[0]].images(frame, (LEFT, RIGHT), 7, 'white') for frame in FRAMES}
    found = calibrate_color(*({frame: pair[side] for frame, pair in pairs.items()}
                              for side in range(2)))
    path = tmp_path_factory.mktemp('color') / 'color.yaml'
    found.calibration.write(path)
    return path


@pytest.mark.parametrize('scene', SCENES)
def test_unlike_simulated_cameras_measure_nearly_as_well_as_ideal_ones(
        films, file, scene, effort, figures):
    seeds = effort.seeds(2, 10)
    film = films[scene]
    ideal = film.depth_error(({}, {}), seeds)
    for name, path, goal in (('with color.calibration', file, 1.2), ('without', '', None)):
        figures(f'color: depth error of unlike over ideal cameras, {scene}, {name}',
                film.depth_error((LEFT, RIGHT), seeds, path) / ideal, '', over=seeds,
                at_most=goal)
