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
"""The command `color_stereo`: it finds, runs and explains its subcommands."""

from pathlib import Path
import subprocess
import sys
import types

from color_stereo_ros.cli import main as cli
from color_stereo_ros.cli.progress import Progress
from color_stereo_ros.core import (
    CalibrationError, ImageError, make_pattern, RecordingError, Settings, SettingsError)
from color_stereo_ros.core.settings import flat
from color_stereo_ros.parameters.files import read_settings, settings_text

import cv2

import numpy as np

import pytest


@pytest.fixture
def failing(monkeypatch):
    """Return a function that runs a command `pattern` which raises a given error."""
    def run(error):
        def fail(_):
            raise error
        fake = types.SimpleNamespace(add_arguments=lambda parser: None, run=fail)
        monkeypatch.setattr(cli.importlib, 'import_module', lambda name: fake)
        return cli.main(['pattern'])
    return run


def test_every_command_has_a_summary_of_one_line():
    commands = cli.find_commands()
    assert {'demo', 'replay', 'convert', 'export', 'inspect', 'process', 'sample', 'pattern',
            'settings'} <= set(commands)
    assert all('\n' not in text and 10 < len(text) < 100 for text in commands.values())


@pytest.mark.parametrize('name', cli.find_commands())
def test_every_command_explains_its_arguments(name, capsys):
    with pytest.raises(SystemExit) as ending:
        cli.main([name, '--help'])
    assert ending.value.code == 0
    assert cli.find_commands()[name] in ' '.join(capsys.readouterr().out.split())


@pytest.mark.parametrize('name', ['process', 'convert', 'evaluate', 'export', 'inspect', 'sample'])
def test_the_usage_stays_short_and_the_settings_are_listed_below_it(name, capsys):
    with pytest.raises(SystemExit):
        cli.main([name, '--help'])
    usage, _, rest = capsys.readouterr().out.partition('\n\n')
    assert usage.count('\n') < 6 and '[--SETTING VALUE]' in usage
    assert '--range.min_depth X' in rest and '0.001 .. 1000.0 m, default 0.2' in ' '.join(
        rest.split())


def test_help_imports_neither_numpy_nor_ros_nor_a_simulator():
    code = ('import sys\nfrom color_stereo_ros.cli import main as cli\n'
            'try:\n    cli.main(["--help"])\nexcept SystemExit:\n    pass\n'
            'heavy = {"numpy", "numba", "cv2", "rclpy", "mitsuba", "matplotlib"}\n'
            'sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)')
    ran = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert 'evaluate' in ran.stdout


def test_commands_of_a_command_are_found_and_explained_as_others_are(capsys):
    with pytest.raises(SystemExit) as ending:
        cli.main(['calibrate', '--help'])
    assert ending.value.code == 0 and 'geometry' in capsys.readouterr().out
    inner = cli.find_commands(Path(cli.__file__).parent / 'calibrating')
    for name, summary in inner.items():
        with pytest.raises(SystemExit):
            cli.main(['calibrate', name.replace('_', '-'), '--help'])
        assert summary in ' '.join(capsys.readouterr().out.split())


@pytest.mark.parametrize('words, told', [
    (['calibrate', 'geometri'], 'did you mean geometry?'),
    (['calibrate', 'geometry', '--colums', '9'], 'did you mean --columns?'),
    (['calibrate'], 'COMMAND')])
def test_commands_of_a_command_refuse_wrong_words(words, told, capsys):
    with pytest.raises(SystemExit) as ending:
        cli.main(words)
    assert ending.value.code == 2 and told in capsys.readouterr().err


def test_an_unknown_command_is_refused_with_the_known_ones(capsys):
    with pytest.raises(SystemExit) as ending:
        cli.main(['patern'])
    assert ending.value.code == 2
    assert 'pattern' in capsys.readouterr().err


def test_a_wrong_setting_ends_with_one_line_and_status_2(failing, capsys):
    assert failing(SettingsError('range.min_depth = 7 m is wrong')) == 2
    assert capsys.readouterr().err == 'color_stereo: range.min_depth = 7 m is wrong\n'


@pytest.mark.parametrize('kind', [CalibrationError, ImageError, RecordingError])
def test_bad_input_ends_with_one_line_and_status_1(failing, capsys, kind):
    assert failing(kind('left.png: damaged')) == 1
    assert capsys.readouterr().err == 'color_stereo: left.png: damaged\n'


@pytest.mark.parametrize('words', [['settings', '--form', 'yaml'],
                                   ['settings', '--range.min', '1'], ['--vers']])
def test_options_are_never_abbreviated(words, capsys):
    with pytest.raises(SystemExit) as ending:
        cli.main(words)
    assert ending.value.code == 2
    assert capsys.readouterr().err.startswith('usage: color_stereo')


def test_a_missing_file_is_named_and_ends_with_status_1(failing, capsys):
    assert failing(FileNotFoundError(2, 'No such file or directory', 'left.yaml')) == 1
    assert capsys.readouterr().err == 'color_stereo: left.yaml: No such file or directory\n'


@pytest.mark.parametrize('module, extra', [('mitsuba', 'sim'), ('rosbags.rosbag2', 'tools'),
                                           ('rclpy', 'ros')])
def test_a_missing_extra_is_named_with_the_command_that_installs_it(failing, capsys, module,
                                                                    extra):
    assert failing(ModuleNotFoundError('no module', name=module)) == 1
    said = capsys.readouterr().err
    assert f'pip install "color_stereo_ros[{extra}]"' in said
    assert ('setup.bash' in said) == (extra == 'ros')


def test_an_unknown_missing_module_is_a_bug_and_keeps_its_traceback(failing):
    with pytest.raises(ModuleNotFoundError):
        failing(ModuleNotFoundError('no module', name='left_pad'))


def test_an_unexpected_error_keeps_its_traceback(failing):
    with pytest.raises(ZeroDivisionError):
        failing(ZeroDivisionError())


def test_an_interrupt_ends_with_status_130(failing):
    assert failing(KeyboardInterrupt()) == 130


def test_a_closed_pipe_is_no_error():
    command = f'{sys.executable} -m color_stereo_ros.cli.main settings | head -n 1'
    ran = subprocess.run(['bash', '-o', 'pipefail', '-c', command], capture_output=True, text=True)
    assert ran.stdout.startswith('pattern.type = ')
    assert ran.stderr == ''


def test_settings_as_yaml_read_back_are_the_same_settings(tmp_path, capsys):
    assert cli.main(['settings', '--format', 'yaml', '--range.min_depth', '0.25']) == 0
    path = tmp_path / 'settings.yaml'
    path.write_text(capsys.readouterr().out)
    assert read_settings(path) == flat(Settings().updated({'range.min_depth': 0.25}))


def test_options_override_the_configuration_file(tmp_path, capsys):
    path = tmp_path / 'mine.yaml'
    path.write_text(settings_text({'range.min_depth': 0.3, 'range.max_depth': 0.5}))
    cli.main(['settings', '--config', str(path), '--range.max_depth', '0.7'])
    printed = capsys.readouterr().out
    assert 'range.min_depth = 0.3 ' in printed and 'range.max_depth = 0.7 ' in printed


def test_a_setting_out_of_range_is_refused_with_the_range(tmp_path, capsys):
    assert cli.main(['pattern', str(tmp_path / 'p.png'), '--pattern.width', '3']) == 2
    assert 'pattern.width = 3 px is outside 8 .. 8192 px' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_pattern_command_writes_the_pattern(tmp_path):
    path = tmp_path / 'new' / 'pattern.png'
    assert cli.main(['pattern', str(path), '--pattern.type', 'sweep', '--pattern.width', '64',
                     '--pattern.height', '16']) == 0
    expected = make_pattern(Settings().updated(
        {'pattern.type': 'sweep', 'pattern.width': 64, 'pattern.height': 16}).pattern)
    assert np.array_equal(cv2.imread(str(path))[..., ::-1], expected)


@pytest.mark.parametrize('words, meant', [
    (['process', 'a.png', 'b.png', '--calibraton', 'l', 'r'], '--calibration'),
    (['convert', 'a', 'b', '--range.min_dept', '3'], '--range.min_depth'),
    (['convert', 'a', 'b', '--min_depth=3'], '--range.min_depth'),
    (['convert', 'a', 'b', '--left_image', '/a'], '--left-image'),
    (['replay', 'a', '-loop'], '--loop'),
    (['--versoin'], '--version'),
    (['patern', 'p.png'], 'pattern')])
def test_the_nearest_known_name_is_asked_for(words, meant, capsys):
    with pytest.raises(SystemExit) as ending:
        cli.main(words)
    assert ending.value.code == 2
    assert f'; did you mean {meant}?' in capsys.readouterr().err


def test_values_that_look_like_options_are_none(tmp_path, capsys):
    assert cli.main(['pattern', '--pattern.width', '-3', '--', str(tmp_path / '-p.png')]) == 2
    assert 'pattern.width = -3' in capsys.readouterr().err


def test_progress_is_told_line_by_line_where_there_is_no_terminal(capsys):
    with Progress(total=3, unit='pair', mininterval=0) as progress:
        for _ in range(3):
            progress.update()
        progress.say('a sentence')
    said = capsys.readouterr()
    lines = said.err.split('\n')
    assert said.out == '' and '\r' not in said.err
    assert '0/3' in lines[0] and 'a sentence' in lines
    assert any('3/3' in line for line in lines)


def test_every_long_command_shows_progress_of_this_kind():
    folder = Path(cli.__file__).parent
    users = {path.stem for path in folder.glob('*.py')
             if 'from .progress import Progress' in path.read_text()}
    assert users == {'bench', 'convert', 'evaluate', 'export', 'render', 'stress',
                     'view'}
    assert not [path for path in folder.glob('*.py')
                if 'import tqdm' in path.read_text() and path.stem != 'progress']
