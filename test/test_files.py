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
"""Results are written whole or not at all, and the fields of camera_info files come back."""

import os

from color_stereo_ros.core import ImageError
from color_stereo_ros.files import atomic
from color_stereo_ros.files.atomic import folder_written_whole, write_text, written_whole
from color_stereo_ros.files.camera_info import camera_info_text, read_camera_info
from color_stereo_ros.files.image import write_image
from color_stereo_ros.files.yaml import UnreadableError

import numpy as np

import pytest

import yaml

FIELDS = {'width': 640, 'height': 480, 'distortion_model': 'plumb_bob', 'D': [0.1, 0, 0, 0, 0.2],
          'K': [600.0, 0, 320, 0, 600, 240, 0, 0, 1], 'R': [1.0, 0, 0, 0, 1, 0, 0, 0, 1],
          'P': [600.0, 0, 320, 0, 0, 600, 240, 0, 0, 0, 1, 0]}


def names_in(folder):
    """Return the names of what is in a folder, hidden ones included."""
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_never_half_written(tmp_path):
    path = tmp_path / 'result.txt'
    write_text(path, 'first')
    with pytest.raises(ZeroDivisionError):
        with written_whole(path) as partial:
            partial.write_text('second, but')
            raise ZeroDivisionError
    assert path.read_text() == 'first'
    assert names_in(tmp_path) == ['result.txt']


def test_folders_are_made_on_demand_only(tmp_path):
    write_text(tmp_path / 'new' / 'result.txt', 'text')
    assert names_in(tmp_path / 'new') == ['result.txt']
    with pytest.raises(FileNotFoundError):
        write_text(tmp_path / 'other' / 'result.txt', 'text', make_folders=False)
    assert names_in(tmp_path) == ['new']


def test_a_durable_file_is_on_the_disk_before_it_gets_its_name(tmp_path, monkeypatch):
    path = tmp_path / 'result.txt'
    there = []
    monkeypatch.setattr(os, 'fsync', lambda _: there.append(path.exists()))
    write_text(path, 'text', durable=True)
    assert there == [False] and path.read_text() == 'text'


def fill(folder, text):
    folder.mkdir()
    (folder / 'a.txt').write_text(text)


def test_a_folder_appears_when_it_is_complete(tmp_path):
    path = tmp_path / 'above' / 'result'
    with folder_written_whole(path) as unfinished:
        fill(unfinished, 'text')
        assert unfinished.name == 'result' and not path.exists()
    assert names_in(path) == ['a.txt'] and names_in(path.parent) == ['result']


def test_a_folder_that_fails_leaves_the_old_one_and_no_other(tmp_path):
    path = tmp_path / 'result'
    fill(path, 'old')
    with pytest.raises(ZeroDivisionError):
        with folder_written_whole(path, replace=True) as unfinished:
            fill(unfinished, 'new')
            raise ZeroDivisionError
    assert (path / 'a.txt').read_text() == 'old' and names_in(tmp_path) == ['result']


def test_a_folder_is_replaced_on_demand_only(tmp_path):
    path = tmp_path / 'result'
    fill(path, 'old')
    with pytest.raises(OSError):
        with folder_written_whole(path) as unfinished:
            fill(unfinished, 'new')
    assert (path / 'a.txt').read_text() == 'old'
    with folder_written_whole(path, replace=True) as unfinished:
        fill(unfinished, 'new')
    assert (path / 'a.txt').read_text() == 'new' and names_in(tmp_path) == ['result']


def test_the_old_folder_comes_back_if_the_new_one_cannot_take_its_place(tmp_path, monkeypatch):
    path = tmp_path / 'result'
    fill(path, 'old')

    def refuse(*_):
        raise OSError('no')

    monkeypatch.setattr(atomic.os, 'replace', refuse)
    with pytest.raises(OSError, match='no'):
        with folder_written_whole(path, replace=True) as unfinished:
            fill(unfinished, 'new')
    assert (path / 'a.txt').read_text() == 'old' and names_in(tmp_path) == ['result']


def test_an_image_of_unknown_format_is_refused(tmp_path):
    with pytest.raises(ImageError, match='.png always works'):
        write_image(tmp_path / 'picture.xyz', np.zeros((4, 4, 3), np.uint8))
    assert not list(tmp_path.iterdir())


def test_the_fields_of_a_camera_info_file_come_back(tmp_path):
    path = tmp_path / 'left.yaml'
    path.write_text(camera_info_text('left', FIELDS))
    assert read_camera_info(path) == FIELDS
    content = yaml.safe_load(path.read_text())
    assert content['camera_name'] == 'left'
    assert (content['projection_matrix']['rows'], content['projection_matrix']['cols']) == (3, 4)
    assert content['distortion_coefficients']['cols'] == 5


@pytest.mark.parametrize('field, value', [
    ('camera_matrix', None), ('camera_matrix', 7), ('camera_matrix', {'rows': 3}),
    ('image_width', None)])
def test_a_camera_info_file_without_a_field_is_refused_by_its_name(tmp_path, field, value):
    path = tmp_path / 'left.yaml'
    path.write_text(yaml.safe_dump({**yaml.safe_load(camera_info_text('left', FIELDS)),
                                    field: value}))
    with pytest.raises(UnreadableError, match=f"has no usable field '{field}'"):
        read_camera_info(path)


def dialect(name):
    """Return the text of a camera_info of FIELDS as another program writes it."""
    text = camera_info_text('left', FIELDS)
    content = yaml.safe_load(text)
    message = {'header': {'stamp': {'sec': 1, 'nanosec': 2}, 'frame_id': 'left_optical'},
               'height': FIELDS['height'], 'width': FIELDS['width'],
               'distortion_model': FIELDS['distortion_model']}
    lower = {field.lower(): FIELDS[field] for field in 'DKRP'}
    rows = '\n'.join
    numbers = {field: ' '.join(map(str, FIELDS[field])) for field in 'DKRP'}
    return {
        'ROS': text,
        'without a model': yaml.safe_dump({key: value for key, value in content.items()
                                           if key != 'distortion_model'}),
        'camera_model': text.replace('distortion_model:', 'camera_model:'),
        'camera_model: pinhole': text.replace('distortion_model: plumb_bob',
                                              'camera_model: pinhole'),
        'OpenCV': '%YAML:1.0\n---\n' + text.replace('matrix:', 'matrix: !!opencv-matrix').replace(
            'coefficients:', 'coefficients: !!opencv-matrix'),
        'OpenCV without ---': '%YAML:1.0\n' + text,
        'ros2 topic echo': yaml.safe_dump({**message, **lower}) + '---\n',
        'ros2 topic echo, twice': (yaml.safe_dump({**message, **lower}) + '---\n') * 2,
        'rostopic echo': yaml.safe_dump({**message, **{f: FIELDS[f] for f in 'DKRP'}}) + '---\n',
        'INI': rows(['# oST version 5.0 parameters', '', '', '[image]', '', 'width',
                     str(FIELDS['width']), '', 'height', str(FIELDS['height']), '', '[left]', '',
                     'camera matrix', numbers['K'], '', 'distortion', numbers['D'], '',
                     'rectification', numbers['R'], '', 'projection', numbers['P'], ''])}[name]


@pytest.mark.parametrize('name', [
    'ROS', 'without a model', 'camera_model', 'camera_model: pinhole', 'OpenCV',
    'OpenCV without ---', 'ros2 topic echo', 'ros2 topic echo, twice', 'rostopic echo', 'INI'])
def test_a_camera_info_is_read_in_the_dialects_of_other_programs(tmp_path, name):
    path = tmp_path / 'left.yaml'
    path.write_text(dialect(name))
    found = read_camera_info(path)
    numbers = {field: [float(value) for value in found[field]] for field in 'DKRP'}
    assert {**found, **numbers} == FIELDS


@pytest.mark.parametrize('text, words', [
    ('cam0:\n  camera_model: pinhole\n', 'is a Kalibr camchain.*from_arrays makes'),
    ('%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 1\n   data: [1.]\n', 'matrices of both'),
    ('K1: [1.0]\nD1: [0.0]\n', 'matrices of both'),
    ('width: 4\nheight: 4\n', "has no usable field 'd'"),
    ('camera matrix\n1 2 3\n', "has no usable field 'width'"),
    ('width\n4\nheight\nx\ncamera matrix\n1\nrectification\n1\nprojection\n1\n', 'whole pixels'),
    ('camera matrix\n1 2 3\ncamera matrix\n1 2 3\n', 'holds several cameras, expected one')])
def test_other_files_are_named(tmp_path, text, words):
    path = tmp_path / 'left.yaml'
    path.write_text(text)
    with pytest.raises(UnreadableError, match=words):
        read_camera_info(path)


def test_different_camera_infos_in_one_file_are_refused(tmp_path):
    path = tmp_path / 'left.yaml'
    text = dialect('ros2 topic echo')
    path.write_text(text + text.replace(f'width: {FIELDS["width"]}', 'width: 320'))
    with pytest.raises(UnreadableError, match='holds 2 different camera_infos, expected one'):
        read_camera_info(path)


@pytest.mark.parametrize('line', ['roi: x', 'roi: {x_offset: a}', 'roi: {1: 2}', 'binning_x: a'])
def test_an_odd_window_of_a_printed_message_is_named(tmp_path, line):
    path = tmp_path / 'left.yaml'
    path.write_text(dialect('ros2 topic echo').replace('---', line))
    with pytest.raises(UnreadableError, match='has no usable field .(roi|binning_x)'):
        read_camera_info(path)
