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
"""Folders with truth, and the depth limits that are derived when a folder has none."""

from dataclasses import replace

from color_stereo_ros.core import ColorStereoError, ImageError, RecordingError, SettingsError
from color_stereo_ros.core import StereoCalibration
from color_stereo_ros.evaluation import datasets
from color_stereo_ros.evaluation.metrics import Truth
from color_stereo_ros.evaluation.noise_limit import CameraNoise

import numpy as np

import pytest

from scenes import parallel_rig, SCENES

FLAT = SCENES / 'flat_350_hue1'


def test_a_folder_is_loaded_with_images_calibration_and_truth():
    scene = datasets.load_folder(FLAT)
    assert scene.name == 'flat_350_hue1'
    assert scene.left.shape == scene.right.shape == (512, 512, 3)
    assert scene.left.dtype == np.uint8
    assert np.nanmedian(scene.truth.depth) == pytest.approx(0.35, abs=1e-6)
    assert scene.truth.visible.mean() > 0.95
    assert scene.noise == ()


def test_limits_of_a_verged_rig_lie_about_the_crossing_of_its_axes():
    calibration = StereoCalibration.from_yaml(FLAT / 'left.yaml', FLAT / 'right.yaml')
    near, far = datasets.depth_limits_of_rig(calibration)
    crossing = 0.1 / np.tan(np.radians(15))
    assert near == pytest.approx(0.6 * crossing, rel=1e-6)
    assert far == pytest.approx(1.65 * crossing, rel=1e-6)


def test_limits_of_a_parallel_rig_follow_from_its_disparities():
    calibration = parallel_rig(width=640, height=480, focal=600, baseline=0.06)
    focal_baseline = calibration.geometry.focal_baseline
    near, far = datasets.depth_limits_of_rig(calibration)
    assert focal_baseline / near == pytest.approx(0.16 * 640)
    assert focal_baseline / far == pytest.approx(0.075 * 640)


def test_derived_limits_are_widened_until_they_hold_the_truth():
    calibration = StereoCalibration.from_yaml(FLAT / 'left.yaml', FLAT / 'right.yaml')
    depth = np.full((512, 512), 1.0, np.float32)
    settings, source = datasets.with_depth_limits(
        {}, calibration, Truth(depth, np.ones(depth.shape, bool)))
    assert settings['range.max_depth'] == pytest.approx(1.05)
    assert 'widened' in source


def test_given_limits_win_over_everything():
    scene = datasets.load_folder(FLAT, {'range.min_depth': 0.25, 'range.max_depth': 0.5})
    assert (scene.settings['range.min_depth'], scene.settings['range.max_depth']) == (0.25, 0.5)
    assert scene.limits_source == 'given'


def test_a_scene_survives_the_way_to_a_folder_and_back(tmp_path):
    noise = tuple(CameraNoise((0.1 * i,) * 3, (0.02,) * 3, 0.01, (2.0,) * 3) for i in (1, 2))
    scene = replace(datasets.load_folder(FLAT), noise=noise, settings={
        'range.min_depth': 0.22, 'range.max_depth': 0.62, 'pattern.type': 'sweep'})
    datasets.save_folder(scene, tmp_path / 'kept')
    back = datasets.load_folder(tmp_path / 'kept')
    np.testing.assert_array_equal(back.left, scene.left)
    np.testing.assert_array_equal(back.right, scene.right)
    np.testing.assert_array_equal(back.truth.visible, scene.truth.visible)
    np.testing.assert_array_equal(back.truth.depth, scene.truth.depth)
    assert back.settings == scene.settings
    assert [tuple(n.floor) for n in back.noise] == [n.floor for n in noise]
    assert [path.name for path in tmp_path.iterdir()] == ['kept']


def test_unknown_settings_of_a_folder_are_refused(tmp_path):
    scene = replace(datasets.load_folder(FLAT), settings={'range.min_dept': 0.3})
    datasets.save_folder(scene, tmp_path / 'kept')
    with pytest.raises(SettingsError, match="did you mean 'range.min_depth'"):
        datasets.load_folder(tmp_path / 'kept')


def test_scenes_are_found_below_a_folder_in_order():
    assert [path.name for path in datasets.find_scenes([SCENES])] == [
        'flat_350_hue1', 'prism_hue1', 'solids_hue1']


def test_a_folder_without_scenes_is_an_error(tmp_path):
    with pytest.raises(ColorStereoError, match='holds no scene'):
        datasets.find_scenes([tmp_path])


@pytest.mark.parametrize('arrays', [{'depth': np.ones((4, 4))}, {'visible': np.ones((4, 4))}])
def test_a_truth_without_both_arrays_is_an_error(tmp_path, arrays):
    np.savez(tmp_path / 'truth.npz', **arrays)
    with pytest.raises(RecordingError, match='truth.npz: damaged, or no .npz file with depth'):
        datasets.load_truth(tmp_path / 'truth.npz')


def test_a_truth_of_two_sizes_is_an_error(tmp_path):
    np.savez(tmp_path / 'truth.npz', depth=np.ones((4, 4)), visible=np.ones((4, 5), bool))
    with pytest.raises(ImageError, match='must be two images of one size'):
        datasets.load_truth(tmp_path / 'truth.npz')


def test_a_malformed_settings_file_is_an_error(tmp_path):
    scene = datasets.load_folder(FLAT)
    datasets.save_folder(scene, tmp_path / 'kept')
    (tmp_path / 'kept' / 'settings.yaml').write_text('range: 3\n')
    with pytest.raises(SettingsError, match="settings.yaml: unknown setting 'range'"):
        datasets.load_folder(tmp_path / 'kept')


def test_a_malformed_noise_file_is_an_error(tmp_path):
    scene = datasets.load_folder(FLAT)
    datasets.save_folder(scene, tmp_path / 'kept')
    (tmp_path / 'kept' / 'noise.yaml').write_text('left: {flor: [1, 1, 1]}\n')
    with pytest.raises(RecordingError, match='does not describe the noise of two cameras'):
        datasets.load_folder(tmp_path / 'kept')
