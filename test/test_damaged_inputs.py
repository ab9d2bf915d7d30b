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
"""Damaged files end in one clear line with name and reason, and nothing else reaches the user."""

from pathlib import Path
import re
import shutil
import subprocess
import sys

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import ColorStereoError, ImageError, RecordingError
from color_stereo_ros.evaluation.datasets import load_folder
from color_stereo_ros.files.image import read_image

import cv2

import numpy as np

import pytest

from scenes import SCENES

import yaml

FLAT = SCENES / 'flat_350_hue1'
SAMPLE = Path(__file__).resolve().parents[1] / 'sample/solids_hue1/recording'
PYTHON_ONLY = re.compile(r'Traceback|\w+Error\(|Errno|codec|subscriptable|<unicode|WARN:|libpng|'
                         r'object is|loadsave')
"""What only somebody who knows Python or OpenCV would understand."""


def image_bytes(suffix, size=64):
    image = np.random.default_rng(5).integers(0, 256, (size, size, 3), np.uint8)
    return cv2.imencode(suffix, image)[1].tobytes()


def without_middle(data):
    return data[:len(data) // 3] + bytes(400) + data[len(data) // 3 + 400:]


@pytest.fixture
def scene(tmp_path):
    """Return a copy of a scene folder."""
    return Path(shutil.copytree(FLAT, tmp_path / 'scene'))


def line_of(capfd, words, status=1):
    """Run a command that must fail; return its one line."""
    assert cli.main([str(word) for word in words]) == status
    said = capfd.readouterr().err
    assert said.startswith('color_stereo: ') and said.count('\n') == 1, said
    assert not PYTHON_ONLY.search(said), said
    return said


@pytest.mark.parametrize('suffix', ['.png', '.jpg', '.tiff', '.bmp'])
def test_a_whole_image_is_read_as_rgb(tmp_path, suffix):
    path = tmp_path / f'red{suffix}'
    cv2.imwrite(str(path), np.full((8, 8, 3), (0, 0, 250), np.uint8))
    image = read_image(path)
    assert image.shape == (8, 8, 3) and image.dtype == np.uint8
    np.testing.assert_allclose(image[4, 4], (250, 0, 0), atol=4)


@pytest.mark.parametrize('suffix', ['.png', '.jpg', '.tiff'])
@pytest.mark.parametrize('damage', [lambda data: data[:len(data) // 2], lambda data: data[:20],
                                    without_middle])
def test_a_damaged_image_is_refused_without_noise(tmp_path, capfd, suffix, damage):
    if suffix == '.tiff' and damage is without_middle:
        damage = lambda data: data[:len(data) // 3]  # noqa: E731, raw pixels show no damage
    path = tmp_path / f'half{suffix}'
    path.write_bytes(damage(image_bytes(suffix)))
    with pytest.raises(ImageError, match=f'half{suffix}: damaged'):
        read_image(path)
    said = capfd.readouterr()
    assert said.out == said.err == ''


def test_a_file_that_is_no_image_is_refused(tmp_path):
    path = tmp_path / 'thesis.png'
    path.write_text('Chapter 1')
    with pytest.raises(ImageError, match='thesis.png: damaged, or no image of a known format'):
        read_image(path)


def test_an_empty_image_file_is_refused(tmp_path):
    (tmp_path / 'left.png').touch()
    with pytest.raises(ImageError, match='left.png: the file is empty'):
        read_image(tmp_path / 'left.png')


def test_a_missing_image_is_refused(tmp_path):
    with pytest.raises(RecordingError, match='left.png: No such file or directory'):
        read_image(tmp_path / 'left.png')


def test_standard_error_is_as_before_after_a_damaged_image(tmp_path, capfd):
    test_an_empty_image_file_is_refused(tmp_path)
    print('still there', file=sys.stderr, flush=True)
    subprocess.run([sys.executable, '-c', 'import os; os.write(2, b"child too")'], check=True)
    assert capfd.readouterr().err == 'still there\nchild too'


@pytest.mark.parametrize('name, content', [
    ('left.png', b'\x89PNG\r\n'), ('right.png', b''), ('left.yaml', b'a: [1'),
    ('left.yaml', b'\xff\xfe\x9f'), ('right.yaml', b'camera_matrix: [1, 2]'),
    ('right.yaml', b'')])
def test_process_names_the_file_that_is_damaged(scene, tmp_path, capfd, name, content):
    (scene / name).write_bytes(content)
    said = line_of(capfd, ['process', scene / 'left.png', scene / 'right.png', '--calibration',
                           scene / 'left.yaml', scene / 'right.yaml', '--output',
                           tmp_path / 'out'])
    assert str(scene / name) in said
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize('name, content', [
    ('truth.npz', b''), ('truth.npz', b'PK\x03\x04 and no more'), ('truth.npz', b'pixels'),
    ('left.png', b'\x89PNG\r\n'), ('noise.yaml', b'left: [\n1,'),
    ('noise.yaml', b'a: \x07'), ('noise.yaml', b'left: {}')])
def test_evaluate_names_the_file_that_is_damaged(scene, capfd, name, content):
    (scene / name).write_bytes(content)
    assert str(scene / name) in line_of(capfd, ['evaluate', scene, '--methods', 'bm'])


def test_a_truth_that_was_cut_off_is_named(scene, capfd):
    data = (scene / 'truth.npz').read_bytes()
    (scene / 'truth.npz').write_bytes(data[:len(data) // 2])
    assert 'truth.npz: damaged' in line_of(capfd, ['evaluate', scene, '--methods', 'bm'])


def test_a_value_that_is_no_yaml_is_refused(capfd):
    said = line_of(capfd, ['evaluate', FLAT, '--set', 'range.min_depth=[1'], status=2)
    assert 'the value is no YAML' in said


@pytest.mark.parametrize('cut', [slice(0, 700), slice(700, 760), slice(300, None)])
def test_damaged_metadata_of_a_recording_are_one_line(tmp_path, capfd, cut):
    folder = Path(shutil.copytree(SAMPLE, tmp_path / 'recording'))
    text = (folder / 'metadata.yaml').read_text()
    (folder / 'metadata.yaml').write_text(text[:cut.start] + text[cut.stop:])
    said = line_of(capfd, ['convert', folder, tmp_path / 'result'])
    assert 'metadata.yaml' in said and str(folder) in said


@pytest.mark.parametrize('field', ['version', 'storage_identifier', 'relative_file_paths'])
def test_a_missing_field_of_the_metadata_is_named(tmp_path, capfd, field):
    folder = Path(shutil.copytree(SAMPLE, tmp_path / 'recording'))
    text = (folder / 'metadata.yaml').read_text()
    (folder / 'metadata.yaml').write_text(text.replace(f'{field}:', f'no_{field}:'))
    said = line_of(capfd, ['convert', folder, tmp_path / 'result'])
    assert f'metadata.yaml has no field {field}' in said


def test_a_recording_with_random_damage_is_one_line(tmp_path, capfd, effort, figures):
    seeds = effort.seeds(8, 300)
    folder = Path(shutil.copytree(SAMPLE, tmp_path / 'recording'))
    whole = (folder / 'recording.mcap').read_bytes()
    refused = 0
    for seed in seeds:
        generator = np.random.default_rng(seed)
        data = bytearray(whole)
        end = int(generator.integers(30, 2000))  # the index of the file, which is at its end
        data[-end:-end + 8] = generator.integers(0, 256, 8, np.uint8).tobytes()
        (folder / 'recording.mcap').write_bytes(data)
        if cli.main(['convert', str(folder), str(tmp_path / f'{seed}'), '--matching.method',
                     'paper', '--topics', 'depth/camera_info']):
            refused += 1
            said, = (line for line in capfd.readouterr().err.splitlines()
                     if line.startswith('color_stereo: '))
            assert str(folder) in said
            assert not PYTHON_ONLY.search(said)
        shutil.rmtree(tmp_path / f'{seed}', ignore_errors=True)
    figures('damaged recordings refused in one line', refused, 'recordings', over=seeds)


@pytest.mark.parametrize('name', ['left.yaml', 'truth.npz', 'left.png'])
def test_a_scene_with_random_damage_is_read_or_refused(scene, name, effort, figures):
    seeds = effort.seeds(10, 500)
    whole = (scene / name).read_bytes()
    refused = 0
    for seed in seeds:
        generator = np.random.default_rng(seed)
        data = bytearray(whole)
        start = int(generator.integers(len(data)))
        stop = start + int(generator.integers(1, 9))
        data[start:stop] = generator.integers(0, 256, generator.integers(9), np.uint8).tobytes()
        (scene / name).write_bytes(data)
        try:
            load_folder(scene)
        except ColorStereoError as error:
            refused += 1
            assert Path(name).stem in str(error) and not PYTHON_ONLY.search(str(error)), name
    figures(f'scenes with a damaged {name} refused', refused, 'scenes', over=seeds)


@pytest.mark.parametrize('emptied', ['camera_matrix', 'rectification_matrix'])
def test_process_measures_rectified_images_with_p_alone(scene, tmp_path, capfd, emptied):
    for side in ('left', 'right'):
        path = scene / f'{side}.yaml'
        content = yaml.safe_load(path.read_text())
        content[emptied]['data'] = [0.0] * 9
        path.write_text(yaml.safe_dump(content))
    words = ['process', scene / 'left.png', scene / 'right.png', '--calibration',
             scene / 'left.yaml', scene / 'right.yaml', '--matching.method', 'paper',
             '--range.min_depth', '0.22', '--range.max_depth', '0.62',
             '--output', tmp_path / 'out']
    said = line_of(capfd, words)
    assert 'left.yaml: left ' in said and 'already need P alone' in said
    assert cli.main([str(word) for word in (*words, '--rectified')]) == 0
    assert (tmp_path / 'out' / 'depth.tiff').exists()
