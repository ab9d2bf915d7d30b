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
"""pattern_node over real DDS: the image of the settings, for late projectors too."""

from dataclasses import asdict, replace
import hashlib
import json
from pathlib import Path

from color_stereo_ros.core import make_pattern, PatternSettings
from color_stereo_ros.core.patterns.frames import make_frame
from color_stereo_ros.messages import contents
from color_stereo_ros.nodes.filling import message_of
from color_stereo_ros.nodes.pattern_source import serialized

import numpy as np

import pytest

from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message

from ros_rig import NodeProcess, Rig

from sensor_msgs.msg import Image

from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
SMALL = {'pattern.type': 'sweep', 'pattern.width': 96, 'pattern.height': 32}
SETTINGS = PatternSettings(type='sweep', width=96, height=32)


@pytest.fixture(scope='module')
def process(tmp_path_factory):
    """Yield a running pattern_node."""
    node = NodeProcess(tmp_path_factory.mktemp('pattern') / 'log.txt', 'pattern_node', SMALL)
    node.wait_until_said('showing sweep')
    yield node
    assert node.stop() == 0
    assert 'Traceback' not in node.text()


@pytest.fixture
def rig(process):
    """Yield a projector that comes late: the pattern has been published already."""
    rig = Rig(node_name='pattern_node')
    rig.listen(Image, 'pattern/image', LATCHED)
    rig.listen(String, 'pattern/info', LATCHED)
    yield rig
    rig.close()


def last(rig, topic):
    """Wait for a message and return the last one."""
    rig.spin_until(lambda: rig.received[topic], topic)
    return rig.received[topic][-1]


def test_a_late_projector_gets_the_pattern_of_the_settings(rig):
    msg = last(rig, 'pattern/image')
    assert (msg.encoding, msg.height, msg.width, msg.step) == ('rgb8', 32, 96, 288)
    assert bytes(msg.data) == make_pattern(SETTINGS).tobytes()
    assert msg.header.frame_id == 'projector_optical_frame'


def test_the_description_names_settings_and_hash(rig):
    info = json.loads(last(rig, 'pattern/info').data)
    assert info['pattern'] == asdict(SETTINGS)
    assert info['frame'] == 'pattern'
    assert info['sha256'] == hashlib.sha256(make_pattern(SETTINGS).tobytes()).hexdigest()


def test_a_changed_parameter_is_shown_at_once(rig):
    last(rig, 'pattern/image')
    last(rig, 'pattern/info')
    assert rig.set_parameters(pattern__cycles=3).successful
    try:
        rig.spin_until(lambda: len(rig.received['pattern/image']) == 2
                       and len(rig.received['pattern/info']) == 2, 'the new pattern')
        expected = make_pattern(replace(SETTINGS, cycles=3))
        assert bytes(rig.received['pattern/image'][-1].data) == expected.tobytes()
        assert json.loads(rig.received['pattern/info'][-1].data)['pattern']['cycles'] == 3
    finally:
        assert rig.set_parameters(pattern__cycles=1).successful


def test_an_unchanged_parameter_is_not_shown_again(rig):
    last(rig, 'pattern/image')
    assert rig.set_parameters(pattern__cycles=1).successful
    rig.spin(0.3)
    assert len(rig.received['pattern/image']) == 1


@pytest.mark.parametrize('frame', ['white', 'black', 'red', 'green', 'blue', 'blank', 'mask',
                                   'complement'])
def test_a_frame_is_shown_instead_of_the_pattern(rig, frame):
    last(rig, 'pattern/image')
    last(rig, 'pattern/info')
    assert rig.set_parameters(pattern__frame=frame).successful
    try:
        rig.spin_until(lambda: len(rig.received['pattern/image']) == 2
                       and len(rig.received['pattern/info']) == 2, 'the frame')
        image = make_frame(frame, SETTINGS)
        assert bytes(rig.received['pattern/image'][-1].data) == image.tobytes()
        info = json.loads(rig.received['pattern/info'][-1].data)
        assert info['frame'] == frame
        assert info['pattern'] == asdict(SETTINGS)
        assert info['sha256'] == hashlib.sha256(image.tobytes()).hexdigest()
    finally:
        assert rig.set_parameters(pattern__frame='pattern').successful


def test_a_frame_that_does_not_exist_is_refused(rig):
    result = rig.set_parameters(pattern__frame='purple')
    assert not result.successful
    assert "pattern.frame = 'purple' is not one of pattern, blank, white" in result.reason


def test_a_pattern_that_nobody_can_make_is_refused(rig):
    result = rig.set_parameters(pattern__type='unknown')
    assert not result.successful
    assert "pattern.type = 'unknown'" in result.reason


def test_started_bare_the_two_nodes_have_the_same_pattern():
    from color_stereo_ros.parameters.groups import PatternNodeSettings, RangeNodeSettings
    assert RangeNodeSettings().pattern == PatternNodeSettings().pattern.expected
    assert np.ptp(make_pattern(PatternNodeSettings().pattern)) > 0


def test_the_largest_pattern_takes_bounded_memory_and_the_node_answers_meanwhile(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', 'pattern_node', {
        'pattern.width': 8192, 'pattern.height': 8192}, arguments=['-r', '__ns:=/large'])
    rig = Rig('/large', node_name='pattern_node')
    node.wait_until_said('making hue_field, 8192 x 8192 px')
    assert not rig.set_parameters(pattern__type='unknown').successful
    assert 'showing' not in node.text(), 'the answer came only after the pattern'
    rig.listen(String, 'pattern/info', LATCHED)
    rig.spin_until(lambda: rig.received['pattern/info'], 'the pattern', patience=300.0)
    assert rig.set_parameters(pattern__seed=2).successful
    rig.spin_until(lambda: node.text().count('making') == 2, 'the next one')
    peak = [line.split()[1] for line in Path(f'/proc/{node.process.pid}/status').read_text()
            .splitlines() if line.startswith('VmHWM')]
    assert int(peak[0]) * 1024 < 1.2e9
    assert node.stop() == 0
    assert node.text().count('showing') == 1, 'the node ended only after the pattern'
    rig.close()


def test_the_bytes_of_an_image_are_those_of_ros():
    image = make_pattern(SETTINGS)
    content = contents.image(image, 'rgb8', contents.Header.at(7, 'frame'))
    assert deserialize_message(serialized(content), Image) == message_of(content)
