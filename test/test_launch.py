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
"""Launch files and layouts name only what the package has."""

import json
import os
from pathlib import Path
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

from color_stereo_ros.core.settings import flat
from color_stereo_ros.messages.outputs import OUTPUTS
from color_stereo_ros.parameters.groups import RangeNodeSettings, SimRigSettings

import pytest

import yaml

ROOT = Path(__file__).resolve().parents[1]
LAUNCH = sorted((ROOT / 'launch').glob('*.launch.xml'))
PARAMETERS = {**flat(RangeNodeSettings()), **flat(SimRigSettings()), 'use_sim_time': False}
INPUTS = {f'{side}/{topic}' for side in ('left', 'right')
          for topic in ('image_raw', 'camera_info')}


@pytest.mark.parametrize('path', LAUNCH, ids=lambda path: path.name)
def test_a_launch_file_starts_what_the_package_installs(path):
    executables = set(re.findall(r"f'(\w+) = \{NAME\}", (ROOT / 'setup.py').read_text()))
    nodes = [node for node in ElementTree.parse(path).iter('node')
             if node.get('pkg') == 'color_stereo_ros']
    assert nodes
    for node in nodes:
        assert node.get('exec') in executables
        assert {p.get('name') for p in node.iter('param') if p.get('name')} <= set(PARAMETERS)
        assert {r.get('from') for r in node.iter('remap')} <= INPUTS


@pytest.mark.parametrize('path', LAUNCH, ids=lambda path: path.name)
def test_a_launch_file_uses_only_arguments_that_it_declares(path):
    root = ElementTree.parse(path).getroot()
    declared = {arg.get('name') for arg in root.findall('arg')}
    assert set(re.findall(r'\$\(var (\w+)\)', path.read_text())) == declared


@pytest.mark.parametrize('path', LAUNCH, ids=lambda path: path.name)
def test_a_launch_file_names_only_files_that_are_installed(path):
    for name in re.findall(r'\$\(find-pkg-share color_stereo_ros\)/([\w./]+)', path.read_text()):
        assert (ROOT / name).is_file(), name


def test_an_included_file_gets_only_arguments_that_it_has():
    include = ElementTree.parse(ROOT / 'launch/sim.launch.xml').getroot().find('include')
    bringup = ElementTree.parse(ROOT / 'launch/bringup.launch.xml').getroot()
    known = {arg.get('name') for arg in bringup.findall('arg')}
    assert {arg.get('name') for arg in include.findall('arg')} <= known


def test_rviz_shows_outputs_with_their_qos():
    layout = yaml.safe_load((ROOT / 'config/range_node.rviz').read_text())
    displays = layout['Visualization Manager']['Displays']
    assert {display['Topic']['Value'] for display in displays} <= set(OUTPUTS)
    for display in displays:
        assert display['Topic']['Reliability Policy'] == 'Reliable'
        assert display['Topic']['Durability Policy'] == 'Volatile'


FOXGLOVE_KEYS = {
    '3D': {'cameraState', 'followMode', 'scene', 'transforms', 'topics', 'layers', 'publish',
           'imageMode'},
    'Image': {'cameraState', 'followMode', 'scene', 'transforms', 'topics', 'layers', 'publish',
              'imageMode'},
    'DiagnosticSummary': {'minLevel', 'pinnedIds', 'hardwareIdFilter', 'topicToRender',
                          'sortByLevel'}}
CLOUD_KEYS = {'visible', 'colorField', 'colorMode', 'pointSize'}


def test_foxglove_knows_all_keys():
    layout = json.loads((ROOT / 'config/foxglove_layout.json').read_text())
    assert set(layout) == {'configById', 'globalVariables', 'userNodes', 'playbackConfig',
                           'layout'}
    for name, panel in layout['configById'].items():
        assert set(panel) <= FOXGLOVE_KEYS[name.partition('!')[0]], name
    assert set(layout['configById']['3D!points']['topics']['/points']) <= CLOUD_KEYS
    for panel in ('Image!range', 'Image!left'):
        assert set(layout['configById'][panel]['imageMode']) <= {'imageTopic', 'calibrationTopic'}


def test_the_command_of_the_docs_puts_the_layout_into_a_namespace():
    page = (ROOT / 'docs/nodes.md').read_text()
    command = re.search(r'^    sed (.*) \\$', page, re.MULTILINE)[1]
    text = subprocess.run(f'sed {command} config/foxglove_layout.json', shell=True, check=True,
                          cwd=ROOT, capture_output=True, text=True).stdout
    panels = json.loads(text)['configById']
    assert panels['Image!range']['imageMode']['imageTopic'] == '/cell_1/range_image'
    assert panels['Image!left']['imageMode'] == {
        'imageTopic': '/cell_1/left/image_raw', 'calibrationTopic': '/cell_1/left/camera_info'}
    assert set(panels['3D!points']['topics']) == {'/cell_1/points'}
    assert panels['DiagnosticSummary!all']['topicToRender'] == '/diagnostics'


def test_rviz_takes_the_topics_of_its_namespace():
    layout = yaml.safe_load((ROOT / 'config/range_node.rviz').read_text())
    displays = layout['Visualization Manager']['Displays']
    assert not any(display['Topic']['Value'].startswith('/') for display in displays)
    for path in LAUNCH:
        for group in ElementTree.parse(path).iter('group'):
            for node in group.iter('node'):
                if node.get('exec') == 'show_rviz':
                    assert group.find('push-ros-namespace') is not None


def launched(function, *words, path, programs=('ros2', 'ros2bag', 'rviz2')):
    """Run a program of the launch files; others on the PATH print their arguments."""
    path.mkdir(exist_ok=True)
    if 'ros2bag' in programs:  # the verb `bag` of ros2 is a module
        (path / 'ros2bag.py').touch()
    for name in programs:
        program = path / name
        program.write_text(f'#!{sys.executable}\nimport sys\nprint("\\n".join(sys.argv[1:]))\n')
        program.chmod(0o755)
    code = f'from color_stereo_ros.nodes.launching import {function} as main; ' \
           'raise SystemExit(main())'
    return subprocess.run([sys.executable, '-c', code, *words], cwd=ROOT, capture_output=True,
                          text=True,
                          env={**os.environ, 'PATH': str(path), 'PYTHONPATH': str(path)})


@pytest.mark.parametrize('text, options', [
    ('--loop', ['--loop']), ('', []), ('-l -r 0.5', ['-l', '-r', '0.5']),
    ('--remap "/a b:=/c"', ['--remap', '/a b:=/c'])])
def test_options_of_the_player_are_any_number_of_words(text, options, tmp_path):
    ran = launched('play_recording', '/tmp/my recording', text, path=tmp_path / 'bin')
    assert ran.stdout.splitlines() == ['bag', 'play', '--clock', '100', '--delay', '3', *options,
                                       '/tmp/my recording']


@pytest.mark.parametrize('words, programs, said', [
    (('', '--loop'), ('ros2',), 'no recording to play'),
    (('bag', '"open'), ('ros2',), 'No closing quotation'),
    (('bag', '--loop'), (), 'source the setup.bash of ROS 2'),
    (('bag', '--loop'), ('ros2',), '`ros2 bag` is not installed')])
def test_a_recording_that_cannot_be_played_is_told(words, programs, said, tmp_path):
    ran = launched('play_recording', *words, path=tmp_path / 'bin', programs=programs)
    assert ran.returncode == 1 and said in ran.stderr and 'Traceback' not in ran.stderr


def test_rviz_gets_its_arguments_and_is_told_to_be_missing_where_it_is(tmp_path):
    words = '-d', 'layout.rviz', '--ros-args', '-r', '__ns:=/cell_1'
    ran = launched('show_rviz', *words, path=tmp_path / 'bin')
    assert ran.stdout.splitlines() == list(words) and ran.returncode == 0
    ran = launched('show_rviz', *words, path=tmp_path / 'none', programs=())
    assert ran.returncode == 0 and 'rviz2 is not installed' in ran.stderr


def test_the_launch_file_hands_on_the_options_of_the_player_as_one_word():
    [player] = ElementTree.parse(ROOT / 'launch/replay.launch.xml').getroot().iter('executable')
    assert player.get('cmd').split('/')[-1] == 'play_recording $(var bag) $(var play_args)'


def test_foxglove_shows_topics_that_exist():
    text = (ROOT / 'config/foxglove_layout.json').read_text()
    panels = json.loads(text)['configById']
    topics = {panels['Image!range']['imageMode']['imageTopic'], *panels['3D!points']['topics']}
    assert topics <= {f'/{topic}' for topic in OUTPUTS}
    assert panels['Image!left']['imageMode']['imageTopic'].lstrip('/') in INPUTS


def test_the_dds_profile_has_room_for_several_clouds():
    root = ElementTree.parse(ROOT / 'config/fastdds_shm.xml').getroot()
    sizes = [int(node.text) for node in root.iter() if node.tag.endswith('segment_size')]
    assert sizes == [64 * 2**20] and sizes[0] > 8 * 640 * 480 * 16
