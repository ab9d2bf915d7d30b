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
"""Frames of the physical and the rectified left camera, and the transform between them."""

from dataclasses import replace
import shlex
import sys
from types import ModuleType, SimpleNamespace

from color_stereo_ros.core import StereoCalibration
from color_stereo_ros.messages.contents import Header
from color_stereo_ros.messages.frames import Frames, frames_of, rectified_name, TOPIC
from color_stereo_ros.messages.outputs import Context, OUTPUTS
from color_stereo_ros.nodes.sensor.static_frames import StaticFrames
from color_stereo_ros.parameters.groups import OutputSettings, RangeNodeSettings
from color_stereo_ros.recordings.types import serialized, typestore

import cv2

from geometry_msgs.msg import TransformStamped

from known_results import known_result
import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy

NAME = 'left_camera_optical_frame'
RECTIFIED = 'left_camera_rectified_optical_frame'


def turned(degrees, axis=(0.2, 1.0, -0.1)):
    """Return the rotation by an angle about an axis."""
    axis = np.array(axis) / np.linalg.norm(axis)
    return cv2.Rodrigues(np.radians(degrees) * axis)[0]


def with_left_r(R):
    """Return a calibration whose left R is given."""
    K = np.array([[60.0, 0, 31.5], [0, 60.0, 23.5], [0, 0, 1.0]])
    pair = StereoCalibration.from_arrays((64, 48), K, None, K, None, np.eye(3), [-0.06, 0, 0])
    return StereoCalibration(replace(pair.left, R=R), pair.right)


def matrix_of(x, y, z, w):
    """Return the matrix of a quaternion by the formula of tf2, which is an oracle here."""
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


@pytest.mark.parametrize('given, name', [
    (NAME, RECTIFIED), ('optical_frame', 'optical_frame_rectified'),
    ('cam/left_optical_frame', 'cam/left_rectified_optical_frame'),
    ('camera', 'camera_rectified'), ('left_optical', 'left_optical_rectified'), ('', '')])
def test_the_name_says_rectified(given, name):
    assert rectified_name(given) == name


@pytest.mark.parametrize('degrees, name', [(0.0, NAME), (0.09, NAME), (0.11, RECTIFIED),
                                           (15.0, RECTIFIED), (180.0, RECTIFIED)])
def test_a_camera_that_is_turned_by_a_tenth_of_a_degree_has_another_name(degrees, name):
    frames = frames_of(NAME, with_left_r(turned(degrees)), OutputSettings())
    assert frames.names == (NAME, name)
    assert frames.differ == (name != NAME)


def test_a_name_that_is_given_counts_in_any_case():
    settings = OutputSettings(frame_id='sensor')
    for degrees in (0.0, 10.0):
        frames = frames_of(NAME, with_left_r(turned(degrees)), settings)
        assert frames.names == (NAME, 'sensor') and frames.differ


def test_the_name_of_the_image_as_given_name_keeps_one_frame():
    frames = frames_of(NAME, with_left_r(turned(10.0)), OutputSettings(frame_id=NAME))
    assert frames.names == (NAME, NAME) and not frames.differ


def test_rectified_images_without_r_have_one_frame():
    frames = frames_of(NAME, with_left_r(np.zeros((3, 3))), OutputSettings())
    assert frames.names == (NAME, NAME)


@pytest.mark.parametrize('degrees', [0.2, 15.0, 90.0, 179.9, 180.0])
def test_the_transform_brings_points_back_to_the_physical_camera(degrees):
    R = turned(degrees)
    message = frames_of(NAME, with_left_r(R), OutputSettings()).transform(5_000_000_007)
    data = serialized(message)
    transform, = typestore().deserialize_cdr(data, message.TYPE).transforms
    assert (transform.header.frame_id, transform.child_frame_id) == (NAME, RECTIFIED)
    assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (5, 7)
    place, turn = transform.transform.translation, transform.transform.rotation
    assert (place.x, place.y, place.z) == (0, 0, 0)
    physical = np.random.default_rng(1).uniform(-1, 1, (100, 3)) + (0, 0, 1)
    rectified = physical @ R.T  # X_rectified = R X_camera
    parent_from_child = matrix_of(turn.x, turn.y, turn.z, turn.w)
    np.testing.assert_allclose(rectified @ parent_from_child.T, physical, atol=1e-6)
    assert turn.w >= 0


def test_points_in_both_frames_are_the_same_places():
    R = turned(15.0)
    result, calibration = known_result(), with_left_r(R)
    header, clouds = Header.at(7, NAME), {}
    for frame in ('rectified', 'camera'):
        settings = RangeNodeSettings(output=OutputSettings(
            frame=frame, point_fields='normal_x normal_y normal_z'))
        content = OUTPUTS['points'].content(result, Context.of(header, settings, calibration))
        clouds[content.header.frame_id] = np.frombuffer(content.data, np.float32).reshape(-1, 7)
    assert set(clouds) == {NAME, RECTIFIED}
    turn = frames_of(NAME, calibration, OutputSettings()).quaternion
    for part in (np.s_[:, :3], np.s_[:, 4:]):
        np.testing.assert_allclose(clouds[RECTIFIED][part] @ matrix_of(*turn).T,
                                   clouds[NAME][part], atol=1e-6)
    assert np.isfinite(clouds[NAME]).any()


def test_everything_but_points_is_in_the_rectified_frame_in_any_case():
    settings = RangeNodeSettings(output=OutputSettings(frame='camera'))
    context = Context.of(Header.at(7, NAME), settings, with_left_r(turned(15.0)))
    for topic, output in OUTPUTS.items():
        header = output.content(known_result(), context).header
        assert header.frame_id == (NAME if topic == 'points' else RECTIFIED)
        assert header.stamp == context.header.stamp


def test_the_command_says_the_same_as_the_transform():
    frames = Frames(NAME, RECTIFIED, turned(-20.0))
    words = shlex.split(frames.command)
    assert words[:5] == ['ros2', 'run', 'tf2_ros', 'static_transform_publisher', '--x']
    options = dict(zip(words[4::2], words[5::2]))
    assert (options['--frame-id'], options['--child-frame-id']) == (NAME, RECTIFIED)
    turn = [float(options[f'--q{name}']) for name in 'xyzw']
    np.testing.assert_allclose(matrix_of(*turn), turned(-20.0), atol=1e-7)


# ---- the node's publisher

class TFMessage:
    """A stand-in for the class of tf2_msgs, by its definition TransformStamped[] transforms."""

    def __init__(self):
        self.transforms = []


class FakeNode:
    """Keeps what is published and said."""

    def __init__(self):
        self.topics, self.published, self.warned, self.destroyed = [], [], [], []

    def get_logger(self):
        """Return a logger that keeps warnings."""
        return SimpleNamespace(info=lambda text: None, warning=self.warned.append)

    def get_clock(self):
        """Return a clock that stands."""
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=3_000_000_004))

    def create_publisher(self, kind, topic, qos, **_):
        """Return a publisher that keeps what it gets."""
        self.topics.append((kind, topic, qos))
        return SimpleNamespace(publish=lambda message: self.published.append(
            list(message.transforms)))

    def destroy_publisher(self, publisher):
        """Keep that it is gone."""
        self.destroyed.append(publisher)


@pytest.fixture
def tf2_msgs(monkeypatch):
    """Let there be a package tf2_msgs."""
    module = ModuleType('tf2_msgs.msg')
    module.TFMessage = TFMessage
    monkeypatch.setitem(sys.modules, 'tf2_msgs', ModuleType('tf2_msgs'))
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', module)
    yield
    message_class_of().cache_clear()


@pytest.fixture
def no_tf2_msgs(monkeypatch):
    """Let there be no package tf2_msgs."""
    monkeypatch.setitem(sys.modules, 'tf2_msgs', None)
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)
    message_class_of().cache_clear()


def message_class_of():
    """Return the function that remembers classes of messages."""
    from color_stereo_ros.nodes.filling import message_class
    return message_class


def test_the_transform_is_published_latched_and_once(tf2_msgs):
    node, calibration = FakeNode(), with_left_r(turned(10.0))
    frames = StaticFrames(node)
    for _ in range(3):
        frames.note(NAME, calibration, OutputSettings())
    (kind, topic, qos), = node.topics
    assert (kind, topic) == (TFMessage, TOPIC) and topic == '/tf_static'
    assert (qos.durability, qos.reliability, qos.history, qos.depth) == (
        DurabilityPolicy.TRANSIENT_LOCAL, ReliabilityPolicy.RELIABLE, HistoryPolicy.KEEP_LAST, 1)
    (transform,), = node.published
    assert isinstance(transform, TransformStamped)
    assert (transform.header.frame_id, transform.child_frame_id) == (NAME, RECTIFIED)
    assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (3, 4)
    turn = transform.transform.rotation
    np.testing.assert_allclose(matrix_of(turn.x, turn.y, turn.z, turn.w), turned(10.0).T,
                               atol=1e-6)
    frames.destroy()
    assert len(node.destroyed) == 1


def test_a_change_of_name_or_rotation_is_published(tf2_msgs):
    node = FakeNode()
    frames = StaticFrames(node)
    frames.note(NAME, with_left_r(turned(10.0)), OutputSettings())
    frames.note(NAME, with_left_r(turned(10.0)), OutputSettings())  # the same from a new message
    assert len(node.published) == 1
    frames.note(NAME, with_left_r(turned(11.0)), OutputSettings())
    frames.note(NAME, with_left_r(turned(11.0)), OutputSettings(frame_id='sensor'))
    assert [each.child_frame_id for each, in node.published] == [RECTIFIED] * 2 + ['sensor']
    assert len(node.topics) == 1


def test_parallel_cameras_have_no_transform(tf2_msgs):
    node = FakeNode()
    frames = StaticFrames(node)
    frames.note(NAME, with_left_r(np.eye(3)), OutputSettings())
    frames.note('', with_left_r(turned(10.0)), OutputSettings())
    assert not node.topics and not node.warned
    frames.destroy()


def test_without_tf2_msgs_a_warning_names_the_command_once(no_tf2_msgs):
    node, calibration = FakeNode(), with_left_r(turned(10.0))
    frames = StaticFrames(node)
    for _ in range(3):
        frames.note(NAME, calibration, OutputSettings())
    command = frames_of(NAME, calibration, OutputSettings()).command
    assert not node.topics
    warning, = node.warned
    assert 'tf2_msgs is missing' in warning and warning.endswith(command)
