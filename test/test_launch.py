# SPDX-License-Identifier: Apache-2.0
"""Launch files and layouts name only what the package has."""

import json
from pathlib import Path
import re
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
