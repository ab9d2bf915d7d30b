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
"""The light of the stress test: rendered, kept, and the same as the simulated rig's own."""

from color_stereo_ros import sim
from color_stereo_ros.evaluation.stress import light
from color_stereo_ros.evaluation.stress.mounting import Mounting
from color_stereo_ros.evaluation.stress.patterns import Shown
from color_stereo_ros.evaluation.stress.rig import StressRig
from color_stereo_ros.evaluation.stress.shot import Shots

import numpy as np

import pytest

from sim_scenes import BALL, CARD, scene_of, small_rig, smooth_pattern

PATTERN = smooth_pattern(256, 256)


@pytest.fixture(scope='module')
def scene():
    """Return a ball before a card on the small verged rig."""
    return scene_of(CARD, BALL, rig=small_rig(), ambient=0.01, name='ball')


@pytest.fixture(scope='module')
def kept(scene, tmp_path_factory):
    """Return its LightScene, rendered under one pattern and kept in a folder."""
    folder = tmp_path_factory.mktemp('renders')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sim, 'load_scene', lambda name, rig=None: scene)
        patch.setattr(light.patterns, 'shown', lambda: [Shown('default', PATTERN)])
        patch.setattr(light, 'PRINT', (0.02, 0.05))  # m, waves of several pixels of this rig
        first = light.LightScenes(folder, samples=1).scene('casting')
        patch.setattr(light, 'render', lambda *arguments: pytest.fail('rendered again'))
        again = light.LightScenes(folder, samples=1).scene('casting')
    np.testing.assert_array_equal(first.light('left', 'default'), again.light('left', 'default'))
    return again


def test_the_view_is_that_of_the_simulated_rig(scene, kept):
    renderer = sim.Renderer(scene, samples=3)
    for side in ('left', 'right'):
        expected = renderer.radiance(getattr(scene.rig, side), PATTERN)
        view = kept.cropped(kept.light(side, 'default'))
        difference = np.abs(view - expected)
        # the samples of a pixel differ; bias would show in the median
        assert np.median(difference) < 0.02 * expected.mean()
        assert view.mean() == pytest.approx(expected.mean(), rel=0.01)


def test_the_truth_is_that_of_the_simulated_rig(scene, kept):
    expected = sim.Renderer(scene, samples=1).truth(PATTERN.shape[:2])
    truth = kept.truth(Mounting())
    np.testing.assert_allclose(truth.disparity, expected.disparity, atol=1e-3)
    assert (truth.visible == expected.visible).mean() > 0.999


def test_both_views_show_the_same_print_and_object(kept):
    truth = kept.truth(Mounting())
    row, column = np.nonzero(truth.visible)
    raw_left, _ = Mounting().true_pixels(np.column_stack([column, row]).astype(float),
                                         kept.calibration.left)
    match = np.column_stack([column - truth.disparity[row, column], row])
    raw_right, _ = Mounting().true_pixels(match, kept.calibration.right)
    ink = []
    for side, raw in (('left', raw_left), ('right', raw_right)):
        place = np.round((raw + kept.margin + 0.5) * kept.scale - 0.5).astype(int)
        ink.append(kept.mask(side, 'ink')[place[:, 1], place[:, 0], 0])
    assert np.corrcoef(*ink)[0, 1] > 0.95
    assert 0.005 < kept.mask('left', 'object').mean() < 0.995


def test_a_pair_of_the_kept_light_is_measured(kept):
    left, right = Shots(kept).pair(StressRig())
    assert left.shape == right.shape == (96, 96, 3)
    assert left.max() > 150 and right.max() > 150
