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
"""Pairs from the simulated rig for the evaluation: kept, changed, and their noise known."""

from dataclasses import replace

from color_stereo_ros.core import ColorStereoError, PatternSettings
from color_stereo_ros.evaluation import experiments, renders

import numpy as np

import pytest

from sim_scenes import CARD, scene_of, small_rig
from color_stereo_ros.sim.electronics import expose  # noqa: E402, I100

PATTERN = PatternSettings(width=128, height=128)


@pytest.fixture
def rig(monkeypatch):
    """Make every scene name stand for one small card, and count the renderings."""
    from color_stereo_ros import sim
    scene = scene_of(CARD, rig=small_rig(), indirect=False, name='card', ambient=0.004)
    monkeypatch.setattr(sim, 'load_scene', lambda name: scene)
    return scene


def test_a_rendered_pair_is_kept_and_not_rendered_again(rig, tmp_path, monkeypatch):
    first = renders.Renders(tmp_path, samples=1).pair('card', PATTERN)
    again = renders.Renders(tmp_path, samples=1)
    monkeypatch.setattr(again, 'renderer', lambda scene: pytest.fail('rendered again'))
    second = again.pair('card', PATTERN)
    np.testing.assert_array_equal(first.left, second.left)
    assert second.name == 'card'
    assert second.settings['range.min_depth'] == 0.22


def test_another_seed_pattern_or_sampling_is_another_pair(rig, tmp_path):
    for maker, pattern in ((renders.Renders(tmp_path, 1, 1), PATTERN),
                           (renders.Renders(tmp_path, 1, 2), PATTERN),
                           (renders.Renders(tmp_path, 2, 1), PATTERN),
                           (renders.Renders(tmp_path, 1, 1), replace(PATTERN, type='sweep'))):
        maker.pair('card', pattern)
    assert len(list(tmp_path.iterdir())) == 4


def test_only_what_differs_from_the_default_is_kept_of_a_pattern():
    values = renders.pattern_values(PatternSettings(type='sweep', cycles=4))
    assert values == {'pattern.type': 'sweep', 'pattern.cycles': 4}


def test_the_known_noise_is_that_of_the_camera(rig):
    camera = replace(rig.rig.left, bayer='none', sensitivity=(1.0, 1.0, 1.0), exposure=1.0)
    noise = renders.camera_noise(camera)
    assert noise.shares == (1.0, 1.0, 1.0)
    for level in (0.1, 0.5):
        light = np.full((*camera.shape, 3), level)
        image = expose(light, camera, 1.0, 5).astype(np.float64)
        signal = 255 * level
        expected = noise.floor[0] + noise.slope[0] * signal + (noise.relative * signal) ** 2
        assert image.var() == pytest.approx(expected, rel=0.05)


def test_a_curved_response_has_no_known_noise(rig):
    assert renders.camera_noise(replace(rig.rig.left, response='srgb')) is None


def test_a_bench_changes_noise_light_and_blur(rig, tmp_path):
    bench = experiments.Bench(renders.Renders(tmp_path, samples=1), 'card')
    plain = bench.scene(PATTERN)
    loud = bench.scene(PATTERN, noise=4.0)
    dim = bench.scene(PATTERN, brightness=0.25)
    flooded = bench.scene(PATTERN, ambient=0.6)
    blurred = bench.scene(PATTERN, blur=4.0)
    assert loud.noise[0].relative == pytest.approx(4 * plain.noise[0].relative)
    assert np.mean(dim.left) < 0.5 * np.mean(plain.left)
    assert contrast(flooded.left) < 0.7 * contrast(plain.left)
    assert contrast(blurred.left) < 0.9 * contrast(plain.left)


def test_ambient_light_needs_a_scene_that_has_some(monkeypatch, tmp_path):
    from color_stereo_ros import sim
    scene = scene_of(CARD, rig=small_rig(), indirect=False, name='dark')
    monkeypatch.setattr(sim, 'load_scene', lambda name: scene)
    bench = experiments.Bench(renders.Renders(tmp_path, samples=1), 'dark')
    with pytest.raises(ColorStereoError, match="scene 'dark' has ambient = 0"):
        bench.scene(PATTERN, ambient=0.5)


def contrast(image):
    """Return the standard deviation of the middle of an image over its mean."""
    middle = image[24:72, 24:72].astype(np.float64)
    return np.mean(middle.std(axis=(0, 1)) / middle.mean(axis=(0, 1)))
