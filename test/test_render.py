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
"""The command `color_stereo render`."""

import sim_scenes  # noqa: F401, chooses the variant

from color_stereo_ros.cli.main import main  # noqa: I100
from color_stereo_ros.core import ColorStereo, Settings, StereoCalibration
from color_stereo_ros.recordings.reading import Recording

import cv2

import numpy as np

import pytest

import yaml

SCENE = """
name: card
rig:
  base: effector
  cameras: {width: 128, height: 96, focal: 120}
objects:
  - {shape: plane, position: [0, 0, 0.5], rotation: [0, 20, 0], size: [2.0, 2.0]}
"""
MOVING = SCENE + """
  - shape: sphere
    radius: 0.03
    path: [{position: [0, 0, 0.40]}, {position: [0, 0, 0.43]}]
"""
PATTERN = ['--pattern.width', '256', '--pattern.height', '256', '--pattern.feature_size', '6']
QUICK = ['--samples', '2', '--direct-only', *PATTERN]


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / 'card.yaml'
    path.write_text(SCENE)
    return str(path)


def contents(folder):
    return {path.relative_to(folder): path.read_bytes()
            for path in sorted(folder.rglob('*')) if path.is_file()}


def test_a_folder_holds_images_calibration_truth_pattern_and_settings(scene, tmp_path, capsys):
    output = tmp_path / 'out'
    assert main(['render', scene, str(output), *QUICK]) == 0
    assert {path.name for path in output.iterdir()} == {
        'left.png', 'right.png', 'left.yaml', 'right.yaml', 'truth.npz', 'pattern.png',
        'settings.yaml'}
    assert 'card on the rig effector' in capsys.readouterr().out
    with np.load(output / 'truth.npz') as truth:
        assert truth['depth'].shape == truth['visible'].shape == (96, 128)
        assert truth['depth'].dtype == np.float32 and truth['visible'].dtype == bool
    assert cv2.imread(str(output / 'pattern.png')).shape == (256, 256, 3)
    settings = yaml.safe_load((output / 'settings.yaml').read_text())
    assert settings['range'] == {'min_depth': 0.35, 'max_depth': 0.75}
    assert settings['pattern'] == {'width': 256, 'height': 256, 'feature_size': 6.0}


def test_what_is_written_can_be_measured(scene, tmp_path):
    output = tmp_path / 'out'
    main(['render', scene, str(output), *QUICK])
    calibration = StereoCalibration.from_yaml(output / 'left.yaml', output / 'right.yaml')
    left, right = (cv2.imread(str(output / f'{side}.png'))[..., ::-1].copy()
                   for side in ('left', 'right'))
    settings = Settings().updated({
        'matching.method': 'paper', 'range.min_depth': 0.35, 'range.max_depth': 0.75})
    result = ColorStereo(calibration, settings).process(left, right)
    with np.load(output / 'truth.npz') as truth:
        known = truth['visible'] & np.isfinite(result.depth)
        error = np.abs(result.disparity - truth['disparity'])[known]
    assert known.mean() > 0.4
    assert np.median(error) < 0.5


def test_the_same_seed_writes_the_same_bytes_and_another_one_other_images(scene, tmp_path):
    for name, seed in (('a', '3'), ('b', '3'), ('c', '4')):
        main(['render', scene, str(tmp_path / name), '--seed', seed, *QUICK])
    first, again, other = (contents(tmp_path / name) for name in 'abc')
    assert first == again
    assert {path.name for path in first if first[path] != other[path]} == {'left.png', 'right.png'}


def test_a_recording_holds_pairs_calibration_and_pattern_and_repeats_itself(tmp_path):
    scene = tmp_path / 'moving.yaml'
    scene.write_text(MOVING)
    for name in ('one', 'two'):
        assert main(['render', str(scene), str(tmp_path / name / 'bag'), '--bag', *QUICK]) == 0
    assert contents(tmp_path / 'one') == contents(tmp_path / 'two')
    with Recording(tmp_path / 'one' / 'bag') as recording:
        assert recording.counts == {
            '/pattern/image': 1, '/left/image_raw': 2, '/right/image_raw': 2,
            '/left/camera_info': 2, '/right/camera_info': 2}
        assert recording.latched == {'/pattern/image'}


def test_a_sequence_has_a_folder_for_each_frame(tmp_path):
    scene = tmp_path / 'moving.yaml'
    scene.write_text(MOVING)
    main(['render', str(scene), str(tmp_path / 'out'), *QUICK])
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == ['0000', '0001']
    near, far = (np.nanmin(np.load(tmp_path / 'out' / name / 'truth.npz')['depth'])
                 for name in ('0000', '0001'))
    assert far - near == pytest.approx(0.03, abs=1e-3)


def test_an_existing_folder_is_replaced_only_on_demand_and_only_if_it_is_a_rendering(
        scene, tmp_path, capsys):
    output = tmp_path / 'out'
    main(['render', scene, str(output), *QUICK])
    assert main(['render', scene, str(output), *QUICK]) == 1
    assert '--overwrite replaces it' in capsys.readouterr().err
    assert main(['render', scene, str(output), '--overwrite', *QUICK]) == 0
    other = tmp_path / 'other'
    other.mkdir()
    (other / 'diary.txt').write_text('mine')
    assert main(['render', scene, str(other), '--overwrite', *QUICK]) == 1
    assert (other / 'diary.txt').read_text() == 'mine'
    assert not list(tmp_path.glob('.*')), 'nothing unfinished is left'


def test_a_pattern_from_a_file_is_projected_and_called_unknown(scene, tmp_path):
    cv2.imwrite(str(tmp_path / 'red.png'), np.full((64, 64, 3), (0, 0, 255), np.uint8))
    main(['render', scene, str(tmp_path / 'out'), '--pattern', str(tmp_path / 'red.png'),
          '--samples', '1', '--direct-only'])
    image = cv2.imread(str(tmp_path / 'out' / 'left.png'))[..., ::-1]
    assert image[..., 0].mean() > 20 * image[..., 1].mean()
    settings = yaml.safe_load((tmp_path / 'out' / 'settings.yaml').read_text())
    assert settings['pattern']['type'] == 'unknown'


def test_a_camera_of_twelve_bits_writes_sixteen_bit_files_with_white_at_the_top(tmp_path):
    scene = tmp_path / 'card.yaml'
    scene.write_text(SCENE.replace('focal: 120', 'focal: 120, bits: 12, exposure: 100'))
    main(['render', str(scene), str(tmp_path / 'out'), *QUICK])
    image = cv2.imread(str(tmp_path / 'out' / 'left.png'), cv2.IMREAD_UNCHANGED)
    assert image.dtype == np.uint16 and image.max() == 4095 << 4


@pytest.mark.parametrize('arguments, words, status', [
    (['solidz'], "did you mean 'solids'", 2),
    ([], '--list', 2),
    (['solids', '--samples', '0'], '--samples = 0 is outside 1 .. 16', 2),
    (['solids', '--seed', '-1'], '--seed = -1 is outside 0', 2),
    (['solids', '--rig', 'papr'], "did you mean 'paper'", 2),
    (['solids', '--pattern', 'none.png'], 'none.png: No such file', 1)])
def test_bad_arguments_are_refused_in_one_line(arguments, words, status, tmp_path, monkeypatch,
                                               capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['render', *arguments]) == status
    said = capsys.readouterr().err
    assert words in said and said.count('\n') == 1
    assert not list(tmp_path.iterdir())


def test_the_list_names_every_scene_and_rig(capsys):
    assert main(['render', '--list']) == 0
    said = capsys.readouterr().out
    assert 'material_polished_brass' in said
    assert 'rigs: effector, effector_worn, paper, paper_worn' in said
