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
"""Chunks of MCAP files are unpacked ahead, and give what `rosbags` reads."""

from color_stereo_ros.core import RecordingError
from color_stereo_ros.recordings.mcap_reading import (AHEAD, CHUNK_HEAD, messages_of,
                                                      TEXT_AND_SIZE)
from color_stereo_ros.recordings.mcap_writing import MESSAGE_KIND
from color_stereo_ros.recordings.reading import Recording
from mcap.writer import CompressionType, Writer
import numpy as np
import pytest
from rosbags.rosbag2 import Reader

COUNT = 60
SIZE = 300  # bytes of a message
CHUNK = 1000  # bytes


def write(path, times, compression=CompressionType.ZSTD, crcs=True):
    """Write a file of two topics in turn with messages of noise at some times."""
    generator = np.random.default_rng(4)
    with open(path, 'wb') as file:
        writer = Writer(file, chunk_size=CHUNK, compression=compression, enable_crcs=crcs)
        writer.start(profile='ros2', library='test')
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        channels = [writer.register_channel(topic, 'cdr', schema) for topic in ('/a', '/b')]
        for index, time_ns in enumerate(times):
            writer.add_message(channels[index % 2], int(time_ns), generator.bytes(SIZE),
                               int(time_ns))
        writer.finish()


@pytest.mark.parametrize('compression', CompressionType)
@pytest.mark.parametrize('crcs', [True, False])
def test_messages_are_those_that_rosbags_reads(tmp_path, compression, crcs):
    path = tmp_path / 'file.mcap'
    # stamps that go back, some of them equal: chunks overlap
    times = np.random.default_rng(5).integers(0, 8, COUNT) + 10 * np.arange(COUNT) // 40
    write(path, times, compression, crcs)
    with Reader(path) as reader:
        storage = reader.storage
        assert len(storage.chunks) > 2 * AHEAD
        for connections in (storage.connections, storage.connections[:1]):
            for span in ((None, None), (3, None), (None, 9), (4, 12), (30, 40)):
                found = [(connection.topic, time_ns, bytes(data)) for connection, time_ns, data
                         in messages_of(storage, connections, *span)]
                expected = [(connection.topic, time_ns, bytes(data)) for connection, time_ns, data
                            in storage.messages(connections, *span)]
                assert found == expected


def test_a_recording_can_be_read_twice_at_once_and_in_part(tmp_path):
    path = tmp_path / 'file.mcap'
    write(path, range(COUNT))
    with Recording(path) as recording:
        first, second = recording.messages(), recording.messages(['/b'])
        assert [next(first).time_ns for _ in range(5)] == list(range(5))
        assert [next(second).time_ns for _ in range(5)] == [1, 3, 5, 7, 9]
        first.close()
        assert [message.time_ns for message in second] == list(range(11, COUNT, 2))


@pytest.mark.parametrize('crcs', [True, False])
def test_a_chunk_that_is_cut_off_is_told(tmp_path, crcs):
    path = tmp_path / 'file.mcap'
    write(path, range(COUNT), CompressionType.NONE, crcs)
    content = bytearray(path.read_bytes())
    with Recording(path) as recording:
        chunk = recording._source._storages[0].chunks[1]
    first = chunk.chunk_start_offset + CHUNK_HEAD.size + TEXT_AND_SIZE
    assert content[first] == MESSAGE_KIND
    content[first + 1:first + 9] = (1 << 40).to_bytes(8, 'little')  # its length
    path.write_bytes(content)
    with Recording(path) as recording, pytest.raises(RecordingError, match='damaged'):
        list(recording.messages())
