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
"""sim_rig_node over real DDS: alone, and in a closed loop with pattern_node and range_node."""

from color_stereo_ros.core import make_pattern, PatternSettings

import numpy as np

import pytest

from rclpy.qos import QoSDurabilityPolicy, QoSProfile

from ros_rig import floats, image_message, NodeProcess, Rig

from sensor_msgs.msg import CameraInfo, Image

DEPTH = 0.5
"""m, of the card before the simulated rig."""
SCENE = """
name: card
rig:
  base: effector
  cameras: {width: 160, height: 120, focal: 150}
objects:
  - {shape: plane, position: [0, 0, 0.5], size: [2.0, 2.0]}
"""
PATTERN = {'pattern.width': 256, 'pattern.height': 192, 'pattern.feature_size': 8.0}
SMALL = PatternSettings(width=256, height=192, feature_size=8.0)
LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
SCALAR = {'COLOR_STEREO_SIM_VARIANT': 'scalar_rgb'}
TOPICS = tuple((side, kind, f'{side}/{topic}') for side in ('left', 'right')
               for kind, topic in ((Image, 'image_raw'), (CameraInfo, 'camera_info')))


@pytest.fixture(scope='module')
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp('scene') / 'card.yaml'
    path.write_text(SCENE)
    return path


@pytest.fixture(scope='module')
def sim_node(tmp_path_factory, scene_file):
    node = NodeProcess(
        tmp_path_factory.mktemp('log') / 'sim.txt', 'sim_rig_node',
        {'sim.scene': scene_file, 'sim.rate': 5.0, 'sim.samples': 2}, environment=SCALAR)
    yield node
    assert node.stop() == 0


@pytest.fixture(scope='module')
def rig(sim_node):
    listener = Rig(node_name='sim_rig_node')
    for publisher in listener.publishers.values():
        listener.node.destroy_publisher(publisher)
    for _, kind, topic in TOPICS:
        listener.listen(kind, topic)
    listener.pattern = listener.node.create_publisher(Image, 'pattern/image', LATCHED)
    yield listener
    listener.close()


def shown(rig, pattern):
    """Show a pattern and return the first left image under it."""
    before = rig.received['left/image_raw'][-1] if rig.received['left/image_raw'] else None
    old = None if before is None else pixels(before).mean(axis=(0, 1))
    rig.pattern.publish(image_message(pattern))

    def changed():
        images = rig.received['left/image_raw']
        return images and (old is None or np.abs(
            pixels(images[-1]).mean(axis=(0, 1)) - old).max() > 5) and images[-1]
    return rig.spin_until(changed, 'an image under the new pattern', patience=120.0)


def pixels(message):
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)


def uniform(color):
    return np.full((192, 256, 3), color, np.uint8)


def test_nothing_is_published_before_a_pattern_is_shown(rig, sim_node):
    sim_node.wait_until_said('waiting for /pattern/image')
    rig.wait_for_publishers()
    rig.spin(0.5)
    assert not any(rig.received.values())


def test_the_images_show_the_color_of_the_pattern_and_change_with_it(rig):
    red = pixels(shown(rig, uniform((255, 0, 0)))).mean(axis=(0, 1))
    green = pixels(shown(rig, uniform((0, 255, 0)))).mean(axis=(0, 1))
    assert red[0] > 10 * red[1]
    assert green[1] > 10 * green[0]


def test_a_pair_and_its_calibration_carry_one_stamp_and_the_frames_of_the_cameras(rig):
    shown(rig, make_pattern(SMALL))
    for messages in rig.received.values():
        messages.clear()
    # the first one may have lost its partner to `clear`
    stamp = rig.spin_until(lambda: rig.stamps('right/image_raw')[1:], 'two pairs')[0]
    for side, _, topic in TOPICS:
        message = rig.await_output(topic, stamp)
        assert message.header.frame_id == f'{side}_camera_optical_frame'
    info = rig.await_output('right/camera_info', stamp)
    assert (info.width, info.height) == (160, 120)
    assert info.p[3] == pytest.approx(-150 * 0.06)


def test_every_frame_has_its_own_noise(rig):
    rig.received['left/image_raw'].clear()
    rig.spin_until(lambda: len(rig.received['left/image_raw']) > 1, 'two images')
    first, second = (pixels(message).astype(int) for message in
                     rig.received['left/image_raw'][:2])
    assert 0.5 < np.abs(first - second).mean() < 10


def test_a_scene_that_does_not_exist_is_refused_with_the_nearest_name(rig):
    result = rig.set_parameters(sim__scene='solidz')
    assert not result.successful
    assert "did you mean 'solids'" in result.reason


def test_the_node_answers_while_it_renders(rig, sim_node):
    assert rig.get_parameter('sim.samples') == 2  # from now on the services are known here
    since = len(sim_node.text())
    assert rig.set_parameters(sim__samples=6).successful
    assert rig.get_parameter('sim.samples') == 6
    assert 'rendered in' not in sim_node.text()[since:], 'the answer came after the images'
    sim_node.wait_until_said('rendered in', since=since)
    assert rig.set_parameters(sim__samples=2).successful


def test_three_nodes_close_the_loop_and_measure_the_card(rig, tmp_path):
    pattern = NodeProcess(tmp_path / 'pattern.txt', 'pattern_node', PATTERN)
    ranger = NodeProcess(tmp_path / 'range.txt', 'range_node',
                         {**PATTERN, 'range.min_depth': 0.35, 'range.max_depth': 0.75})
    rig.listen(Image, 'depth/image')
    try:
        rig.spin_until(lambda: rig.received['depth/image'], 'a depth image', patience=240.0)
        pattern.wait_until_said('showing')
        depth = rig.spin_until(lambda: _good(rig.received['depth/image']), 'a depth image under '
                               'the pattern of pattern_node', patience=120.0)
    finally:
        statuses = ranger.stop(), pattern.stop()
    # 1 px of disparity is 5.6 % of the distance on this tiny rig
    assert np.nanmedian(depth[0]) == pytest.approx(DEPTH, rel=0.005)
    assert statuses == (0, 0)


def _good(messages):
    """Return the depth images of which more than half is known."""
    return [depth for depth in map(floats, messages) if np.isfinite(depth).mean() > 0.5]
