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
"""Settings in YAML files: every form that ROS knows, and why another file is refused."""

from dataclasses import fields
from pathlib import Path
import shutil

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import SettingsError
from color_stereo_ros.evaluation import datasets
from color_stereo_ros.parameters.files import (
    PASSED_OVER, PROJECTORS, read_settings, SENSORS, settings_text)
from color_stereo_ros.parameters.groups import RangeNodeSettings

import pytest

from scenes import SCENES

ROOT = Path(__file__).resolve().parents[1]
FLAT = SCENES / 'flat_350_hue1'
NEAR = {'range.min_depth': 0.3}
AS_ROS = 'range_node: {ros__parameters: {range: {min_depth: 0.25, max_depth: 0.5}}}'


@pytest.fixture
def file(tmp_path):
    """Return a function that writes a text to a settings file and returns its path."""
    def write(text):
        path = tmp_path / 'settings.yaml'
        path.write_text(text)
        return path
    return write


@pytest.fixture
def scene(tmp_path):
    """Return a copy of a scene folder."""
    return Path(shutil.copytree(FLAT, tmp_path / 'scene'))


@pytest.mark.parametrize('text', [
    'range: {min_depth: 0.3}',
    'range.min_depth: 0.3',
    'range_node: {ros__parameters: {range.min_depth: 0.3}}',
    '/cell_1/range_node: {ros__parameters: {range: {min_depth: 0.3}}}',
    'cell_1: {range_node: {ros__parameters: {range: {min_depth: 0.3}}}}',
    'lifecycle_range_node: {ros__parameters: {range: {min_depth: 0.3}}}',
    '/**/range_node: {ros__parameters: {range: {min_depth: 0.3}}}',
    'my_sensor: {ros__parameters: {range: {min_depth: 0.3}}}',
    '/**: {ros__parameters: {range: {min_depth: 0.3}, sync: {tolerance: 0.1}}}',
    'range_node: {ros__parameters: {range: {min_depth: 0.3}, use_sim_time: true}}\n'
    'pattern_node: {ros__parameters: {pattern: {seed: 7}}}'])
def test_parameter_files_of_every_form_are_read(file, text):
    assert read_settings(file(text)) == NEAR


def test_the_frame_that_pattern_node_shows_is_passed_over(file):
    text = 'pattern_node: {ros__parameters: {pattern: {seed: 7, frame: white}}}'
    assert read_settings(file(text), nodes=PROJECTORS) == {'pattern.seed': 7}


def test_an_empty_file_says_nothing(file):
    assert read_settings(file('# nothing yet\n')) == {}


def test_the_parameter_file_of_range_node_is_read(tmp_path):
    assert read_settings(ROOT / 'config/range_node.yaml')['range.max_depth'] == 1.0


def test_an_integer_is_taken_for_a_float(file):
    assert repr(read_settings(file('range: {max_depth: 2}'))['range.max_depth']) == '2.0'


@pytest.mark.parametrize('text, message', [
    ('range: {min_dept: 0.3}', "unknown setting 'range.min_dept'; did you mean 'range.min_depth"),
    ('rang: {min_depth: 0.3}', "unknown setting 'rang.min_depth'; did you mean 'range.min_depth"),
    ('range: {min_depth: -1}', 'range.min_depth = -1.0 m is outside 0.001 .. 1000.0 m'),
    ('range: {min_depth: near}', "range.min_depth = 'near' is a str, expected float"),
    ('range: 3', "unknown setting 'range'"),
    ('range_node: {ros__parameters: 3}', "unknown setting 'ros__parameters'"),
    ('camera: {ros__parameters: {exposure: 3}}', "unknown setting 'exposure'"),
    ('pattern_node: {ros__parameters: {pattern: {seed: 7}}}',
     'holds parameters of pattern_node, expected those of range_node'),
    ('a: {ros__parameters: {}}\nb: {ros__parameters: {}}', 'holds parameters of a, b, expected'),
    ('[1, 2', "is no YAML, line 1: expected ',' or ']', but got 'the end'"),
    ('just words', 'holds str, expected names and values')])
def test_any_other_file_is_refused_in_one_line_that_names_it(file, text, message):
    with pytest.raises(SettingsError) as refused:
        read_settings(file(text))
    assert message in str(refused.value)
    assert 'settings.yaml: ' in str(refused.value) and '\n' not in str(refused.value)


def test_a_camera_calibration_is_refused_as_what_it_is():
    with pytest.raises(SettingsError, match='left.yaml: is the calibration of a camera'):
        read_settings(FLAT / 'left.yaml')


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(SettingsError, match='missing.yaml: cannot be read: No such file'):
        read_settings(tmp_path / 'missing.yaml')


def test_the_parameters_of_pattern_node_serve_where_only_the_pattern_counts(file):
    path = file('pattern_node: {ros__parameters: {pattern: {seed: 7}}}')
    assert read_settings(path, nodes=(*SENSORS, *PROJECTORS)) == {'pattern.seed': 7}


def test_groups_that_only_the_node_has_are_known_and_passed_over():
    core = {spec.name for spec in fields(RangeNodeSettings().core)}
    assert {spec.name for spec in fields(RangeNodeSettings())} - core <= set(PASSED_OVER)


@pytest.mark.parametrize('node', [None, '/**', 'range_node'])
def test_settings_that_are_written_are_read_back(file, node):
    values = {'range.min_depth': 0.3, 'pattern.type': 'sweep', 'matching.slanted': False}
    assert read_settings(file(settings_text(values, node))) == values


def test_a_folder_may_hold_the_parameter_file_of_a_node(scene):
    (scene / 'settings.yaml').write_text(AS_ROS)
    loaded = datasets.load_folder(scene)
    assert loaded.settings == {'range.min_depth': 0.25, 'range.max_depth': 0.5}


def test_evaluate_takes_a_parameter_file(scene, file, capsys):
    assert cli.main(['evaluate', str(scene), '--methods', 'bm', '--repeats', '1', '--config',
                     str(file(AS_ROS))]) == 0
    assert 'scene: 0.25 .. 0.5 m (given)' in capsys.readouterr().out


def test_options_of_evaluate_override_its_parameter_file(scene, file, capsys):
    assert cli.main(['evaluate', str(scene), '--methods', 'bm', '--repeats', '1', '--config',
                     str(file(AS_ROS)), '--range.max_depth', '0.6']) == 0
    assert 'scene: 0.25 .. 0.6 m (given)' in capsys.readouterr().out


@pytest.mark.parametrize('words, message', [
    (['--range.min_depth', '0.3'], 'range.min_depth is set, but no FOLDER is given'),
    (['--json', 'f.json'], '--json is for FOLDER or --ablation'),
    ([str(FLAT), '--matching.method', 'paper'], 'choose by --methods')])
def test_evaluate_refuses_arguments_that_would_have_no_effect(words, message, capsys):
    assert cli.main(['evaluate', *words]) == 2
    assert message in capsys.readouterr().err


def test_a_sample_keeps_the_settings_of_its_scene(tmp_path, scene):
    (scene / 'settings.yaml').write_text(AS_ROS)
    assert cli.main(['sample', str(scene), str(tmp_path / 'sample'), '--pairs', '1',
                     '--range.max_depth', '0.6']) == 0
    assert read_settings(tmp_path / 'sample/settings.yaml') == {
        'range.min_depth': 0.25, 'range.max_depth': 0.6}


@pytest.mark.parametrize('name', ['range_node', 'pattern_node'])
def test_the_pattern_command_takes_the_parameter_file_of_either_node(tmp_path, name):
    path = tmp_path / 'pattern.png'
    assert cli.main(['pattern', str(path), '--config', str(ROOT / f'config/{name}.yaml'),
                     '--pattern.width', '32', '--pattern.height', '8']) == 0
    assert path.exists()


def test_the_process_command_refuses_a_calibration_as_settings(tmp_path, capsys):
    arguments = [str(FLAT / name) for name in ('left.png', 'right.png')]
    yamls = [str(FLAT / name) for name in ('left.yaml', 'right.yaml')]
    assert cli.main(['process', *arguments, '--calibration', *yamls, '--config', yamls[0],
                     '--output', str(tmp_path / 'out')]) == 2
    assert 'left.yaml: is the calibration of a camera' in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()
