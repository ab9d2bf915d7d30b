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
"""Contents as messages of rclpy: filled, used again, and the same values as in a recording."""

from array import array
import dataclasses

from color_stereo_ros.messages import contents
from color_stereo_ros.messages.contents import Header
from color_stereo_ros.messages.outputs import Context, OUTPUTS
from color_stereo_ros.messages.reading import read_image
from color_stereo_ros.nodes.filling import fill, message_class, message_of, Reused
from color_stereo_ros.parameters.groups import RangeNodeSettings
from color_stereo_ros.recordings.types import serialized, typestore

from known_results import HEADER, known_result, output

import numpy as np

import pytest

from rclpy.serialization import deserialize_message, serialize_message

from sensor_msgs.msg import Image


def test_a_refilled_message_keeps_its_memory_and_takes_a_new_size():
    def content(shape, value):
        return contents.image(np.full(shape, value, np.uint8), 'mono8', HEADER)

    message = fill(Image(), content((4, 5), 0))
    memory = message.data
    assert fill(message, content((4, 5), 9)) is message
    assert message.data is memory and set(memory) == {9}
    fill(message, content((2, 3), 8))
    assert bytes(message.data) == b'\x08' * 6


@pytest.mark.parametrize('frame', ['', 'a', 'four', 'left_camera_optical_frame', 'Kamera ä'])
@pytest.mark.parametrize('encoding', ['rgb8', 'bayer_rggb8', ''])
def test_a_serialized_image_is_read_as_rclpy_reads_it(frame, encoding):
    content = contents.Image(Header.at(-5, frame), 3, 5, encoding, 1, 16,
                             np.arange(48, dtype=np.uint8))
    data = serialize_message(message_of(content))
    assert message_of(read_image(data)) == deserialize_message(data, Image)


def values_of(msg):
    """Return what a message of rclpy or of rosbags holds, as plain values."""
    if isinstance(msg, (bool, int, float, str)):
        return msg
    if isinstance(msg, bytes):  # an octet
        return msg[0]
    if isinstance(msg, list):
        return [values_of(item) for item in msg]
    if isinstance(msg, (np.ndarray, array)):
        return np.asarray(msg).tolist()
    kind = message_class(msg.__msgtype__) if hasattr(msg, '__msgtype__') else msg
    return {name: values_of(getattr(msg, name)) for name in kind.get_fields_and_field_types()}


def test_every_output_is_known_to_rclpy_and_to_recordings():
    for topic, each in OUTPUTS.items():
        content = output(topic, known_result())
        assert content.TYPE == each.type and each.description
        names = message_class(each.type).get_fields_and_field_types()
        assert list(names) == [spec.name for spec in dataclasses.fields(content)]


@pytest.mark.parametrize('settings', [{}, {
    'depth_encoding': '16UC1', 'compact_points': True, 'frame': 'camera'}])
@pytest.mark.parametrize('topic', OUTPUTS)
def test_node_and_recording_serialize_the_same_values(topic, settings):
    content = output(topic, known_result(), **settings)
    sent = deserialize_message(serialize_message(message_of(content)),
                               message_class(content.TYPE))
    stored = serialized(content)
    assert values_of(typestore().deserialize_cdr(stored, content.TYPE)) == values_of(sent)
    assert values_of(deserialize_message(bytes(stored), type(sent))) == values_of(sent)


@pytest.mark.parametrize('topic', OUTPUTS)
def test_a_message_that_is_used_again_holds_the_new_content_only(topic):
    reused = Reused(OUTPUTS[topic].type)
    context = Context(HEADER, RangeNodeSettings(), memory=reused.memory)
    reused.filled(OUTPUTS[topic].content(known_result(), context))
    other = known_result(unknown=[(0, 0)])
    again = reused.filled(OUTPUTS[topic].content(other, context))
    assert values_of(again) == values_of(message_of(output(topic, other)))


def test_points_are_written_into_the_message_itself():
    reused = Reused(OUTPUTS['points'].type)
    context = Context(HEADER, RangeNodeSettings(), memory=reused.memory)
    content = OUTPUTS['points'].content(known_result(), context)
    memory = reused.message.data
    assert content.data is memory
    assert reused.filled(content).data is memory
