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
"""`color_stereo project` on a real X server: the display holds the pattern, pixel by pixel."""

import os
from pathlib import Path
import shutil
import struct
import subprocess
import sys
import time

from color_stereo_ros.calibration.projector import ProjectorResponse
from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import make_pattern, PatternSettings
from color_stereo_ros.core.patterns.frames import make_frame
from color_stereo_ros.files.image import write_image
import numpy as np
import pytest
from ros_rig import NodeProcess, Rig

SIZE = 640, 400
SETTINGS = PatternSettings(width=SIZE[0], height=SIZE[1])
PATIENCE = 60.0
COMMAND = 'from color_stereo_ros.cli.main import main; raise SystemExit(main())'


class Display:
    """An X server without a monitor; it keeps its picture in a file."""

    def __init__(self, folder):
        self._folder = folder
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ['Xvfb', '-displayfd', str(write), '-screen', '0', f'{SIZE[0]}x{SIZE[1]}x24',
             '-fbdir', str(folder), '-nolisten', 'tcp'], pass_fds=[write],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as pipe:
            self.name = f':{pipe.readline().strip()}'

    def picture(self):
        """Return what the display shows, uint8 (H, W, 3), RGB, from the XWD file of Xvfb."""
        data = (self._folder / 'Xvfb_screen0').read_bytes()
        header = struct.unpack('>25I', data[:100])
        size, width, height, stride, colors = (header[n] for n in (0, 4, 5, 12, 19))
        pixels = np.frombuffer(data, np.uint8, stride * height, size + 12 * colors)
        little = header[7] == 0
        rows = pixels.reshape(height, stride)[:, :4 * width].reshape(height, width, 4)
        return rows[..., 2::-1] if little else rows[..., 1:]

    def wait_for(self, expected, process):
        """Wait until the display shows an image; say how many pixels differ otherwise."""
        end = time.monotonic() + PATIENCE
        while not np.array_equal(self.picture(), expected):
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < end, np.count_nonzero(self.picture() != expected)
            time.sleep(0.1)


@pytest.fixture(scope='module')
def display(tmp_path_factory):
    """Yield a display of the size of the pattern."""
    if shutil.which('Xvfb') is None:
        pytest.skip('cannot run: no Xvfb is installed')
    display = Display(tmp_path_factory.mktemp('display'))
    yield display
    display.server.terminate()
    display.server.wait()


@pytest.fixture
def project(display):
    """Yield a function that starts `color_stereo project`; all are ended at the end."""
    started = []

    def start(*words):
        environment = {key: value for key, value in os.environ.items()
                       if key not in ('WAYLAND_DISPLAY', 'SDL_VIDEODRIVER')}
        started.append(subprocess.Popen(
            [sys.executable, '-c', COMMAND, 'project', *map(str, words)], text=True,
            env={**environment, 'DISPLAY': display.name, 'SDL_VIDEODRIVER': 'x11'},
            stdout=subprocess.PIPE, stderr=subprocess.PIPE))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_the_display_shows_a_file_pixel_by_pixel(display, project, tmp_path):
    pattern = make_pattern(SETTINGS)
    write_image(tmp_path / 'pattern.png', pattern)
    process = project(tmp_path / 'pattern.png')
    display.wait_for(pattern, process)
    changed = make_frame('mask', SETTINGS)
    write_image(tmp_path / 'pattern.png', changed)
    display.wait_for(changed, process)
    process.terminate()
    assert 'showing 640 x 400 px' in process.communicate()[0]


def test_the_gamma_of_the_projector_is_corrected(display, project, tmp_path):
    pattern = make_pattern(SETTINGS)
    response = ProjectorResponse((2.2, 1.8, 2.0))
    response.write(tmp_path / 'projector.yaml')
    write_image(tmp_path / 'pattern.png', pattern)
    process = project(tmp_path / 'pattern.png', '--response', tmp_path / 'projector.yaml')
    display.wait_for(response.corrected(pattern), process)


def test_a_gray_level_fills_the_display_and_the_command_ends_in_time(display, project):
    process = project('--level', 96, '--seconds', 8)
    display.wait_for(np.full((SIZE[1], SIZE[0], 3), 96, np.uint8), process)
    assert process.wait(PATIENCE) == 0


def test_a_smaller_image_is_not_scaled_and_warned_of(display, project, tmp_path):
    small = make_pattern(PatternSettings(width=320, height=200))
    write_image(tmp_path / 'small.png', small)
    process = project(tmp_path / 'small.png')
    expected = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    expected[100:300, 160:480] = small
    display.wait_for(expected, process)
    process.terminate()
    assert 'is not scaled: pattern.width = 640 and pattern.height = 400' in (
        process.communicate()[1])


def test_the_display_follows_pattern_node(display, project, tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', 'pattern_node', {
        'pattern.width': SIZE[0], 'pattern.height': SIZE[1]},
        arguments=['-r', '__ns:=/shown'])
    rig = Rig('/shown', node_name='pattern_node')
    node.wait_until_said('showing hue_field')
    process = project('--namespace', 'shown')
    display.wait_for(make_pattern(SETTINGS), process)
    assert rig.set_parameters(pattern__frame='mask').successful
    display.wait_for(make_frame('mask', SETTINGS), process)
    rig.close()
    assert node.stop() == 0


def test_a_display_that_does_not_exist_is_refused_with_those_that_do(display, project):
    process = project('--level', 10, '--display', 7)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert '--display 7: there are the displays 0 (640 x 400 px)' in said


def test_without_a_display_server_the_reason_is_given(project, monkeypatch):
    environment = {key: value for key, value in os.environ.items() if key != 'WAYLAND_DISPLAY'}
    process = subprocess.run(
        [sys.executable, '-c', COMMAND, 'project', '--level', '10'], capture_output=True,
        text=True, env={**environment, 'DISPLAY': ':4711', 'SDL_VIDEODRIVER': 'x11'},
        timeout=PATIENCE)
    assert process.returncode == 1
    assert 'no display can be used' in process.stderr


@pytest.mark.parametrize('words, message', [
    (['--level', '300'], '--level = 300 is outside 0 .. 255'),
    (['a.png', '--level', '3'], 'exclude each other'),
    (['a.png', '--gamma', '9'], '--gamma = 9.0 is outside 0.2 .. 5.0'),
    (['--level', '3', '--gamma', '2'], 'no --response and no --gamma')])
def test_wrong_arguments_are_refused(words, message, capsys):
    assert cli.main(['project', *words]) == 2
    assert message in capsys.readouterr().err


def test_a_missing_file_is_named(capsys):
    assert cli.main(['project', str(Path('nowhere') / 'a.png')]) == 1
    assert 'nowhere/a.png' in capsys.readouterr().err
