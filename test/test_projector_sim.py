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
"""The projector of the simulated rig is found in what two views measure of a scene."""

from color_stereo_ros import sim
from color_stereo_ros.core import ColorStereo, make_pattern, PatternSettings, Settings
from color_stereo_ros.core.projector import Measured, ProjectorFinder
from color_stereo_ros.evaluation.projector import projector_of
import numpy as np
from sim_scenes import small_rig


def test_the_simulated_rig_shows_its_projector():
    scene = sim.load_scene('solids', rig=small_rig(width=288, height=288, focal=360))
    pattern = make_pattern(PatternSettings())
    pair = sim.Renderer(scene, samples=1, indirect=False).render(pattern, with_truth=False)
    near, far = scene.rig.depth_limits
    stereo = ColorStereo(scene.rig.calibration, Settings().updated(
        {'range.min_depth': near, 'range.max_depth': far}))
    result = Measured.of(stereo.process(pair.left_rgb, pair.right_rgb))
    model = ProjectorFinder(pattern, (288, 288)).find(result).model
    true = projector_of(scene.rig, (1024, 1024))
    assert np.abs(model.center - true.center).max() < 0.002
    assert np.abs((model.center - true.center) / model.center_std).max() < 4
    assert model.residual < 0.5
