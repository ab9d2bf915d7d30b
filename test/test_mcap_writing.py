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
"""Recordings are written without copies, and as every reader of MCAP expects them."""

from pathlib import Path
import subprocess
import sys

from color_stereo_ros.messages.contents import (camera_info, CompressedImage, Header, image,
                                                PointCloud2, PointField)
from color_stereo_ros.recordings.mcap_writing import CHUNK_SIZE, COMPRESSIONS
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.types import serialized, serialized_parts
from color_stereo_ros.recordings.writing import open_writer, write_recording
from mcap.reader import make_reader
import numpy as np
import pytest
from scenes import parallel_rig

SECOND = 1_000_000_000
HEIGHT, WIDTH = 120, 160
COUNT = 40
BLOCK = 4 << 20  # bytes
FAULTS = f"""
import resource, sys
from color_stereo_ros.recordings.memory import keep_memory
if sys.argv[1] == 'kept':
    keep_memory()
content = b'x' * {BLOCK}
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(5):
    blocks = [bytearray(content) for _ in range(3)]
    del blocks
before = faults()
for _ in range(20):
    blocks = [bytearray(content) for _ in range(3)]
    del blocks
print((faults() - before) / 20)
"""


def cloud(frame, seed=1):
    """Return a cloud of noise in which half of the points are unknown."""
    generator = np.random.default_rng(seed)
    points = generator.normal(size=(HEIGHT, WIDTH, 4)).astype(np.float32)
    points[:, :WIDTH // 2, :3] = np.nan
    fields = tuple(PointField(name, 4 * place) for place, name in enumerate('xyz'))
    return PointCloud2(Header.at(SECOND, frame), HEIGHT, WIDTH, fields, False, 16, 16 * WIDTH,
                       points.reshape(-1).view(np.uint8), False)


@pytest.mark.parametrize('frame', ['', 'a', 'ab', 'abc', 'abcd'])
def test_the_parts_of_a_message_are_its_bytes(frame):
    header = Header.at(5 * SECOND + 7, frame)
    pixels = np.random.default_rng(2).integers(0, 256, (5, 7, 3), np.uint8)
    contents = [image(pixels, 'rgb8', header), cloud(frame),
                CompressedImage(header, 'png' + frame, np.arange(11, dtype=np.uint8)),
                camera_info(parallel_rig().left, header)]
    for content in contents:
        assert b''.join(serialized_parts(content)) == bytes(serialized(content))


def test_the_pixels_of_a_message_are_not_copied():
    pixels = np.zeros((5, 7, 3), np.uint8)
    _, _, data, _ = serialized_parts(image(pixels, 'rgb8', Header()))
    assert np.shares_memory(np.asarray(data), pixels)


@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_what_is_written_in_parts_is_read_by_others(tmp_path, compression):
    contents = [cloud('left', seed) if seed % 3 else camera_info(parallel_rig().left, Header())
                for seed in range(COUNT)]
    with open_writer(tmp_path / 'made', compression) as writer:
        for index, content in enumerate(contents):
            topic = '/points' if isinstance(content, PointCloud2) else '/info'
            writer.write_content(topic, (1 + index) * SECOND, content)
    with open(tmp_path / 'made' / 'made.mcap', 'rb') as file:
        reader = make_reader(file, validate_crcs=True)
        found = [(message.log_time, message.data) for _, _, message in reader.iter_messages()]
        summary = reader.get_summary()
    expected = [((1 + index) * SECOND, bytes(serialized(content)))
                for index, content in enumerate(contents)]
    assert found == expected
    assert len(summary.chunk_indexes) > 3
    assert all(chunk.uncompressed_size < CHUNK_SIZE + BLOCK for chunk in summary.chunk_indexes)
    assert summary.statistics.message_count == COUNT
    with Recording(tmp_path / 'made') as recording:
        assert [(message.time_ns, message.data) for message in recording.messages()] == expected
        assert [len(recording.record_times(topic)) for topic in ('/points', '/info')] == [26, 14]


def test_the_memory_of_a_chunk_holds_nothing_of_the_one_before(tmp_path):
    # a long chunk, then a short one in the same memory
    with open_writer(tmp_path / 'made') as writer:
        writer.write('/text', 'std_msgs/msg/String', 1, b'\0\1\0\0', bytes(3 * CHUNK_SIZE))
        writer.write('/text', 'std_msgs/msg/String', 2, b'\0\1\0\0', b'\1\0\0\0\0')
    with Recording(tmp_path / 'made') as recording:
        assert [len(message.data) for message in recording.messages()] == [4 + 3 * CHUNK_SIZE, 9]


def test_small_files_are_smaller_and_hold_the_same(tmp_path):
    sizes, held = [], []
    for compression in ('fast', 'small'):
        path = tmp_path / compression
        with open_writer(path, compression) as writer:
            writer.write_content('/points', SECOND, cloud('left'))
        sizes.append((path / f'{compression}.mcap').stat().st_size)
        with Recording(path) as recording:
            held.append([message.data for message in recording.messages()])
    assert held[0] == held[1]
    assert sizes[1] < 0.95 * sizes[0]


def test_a_process_that_keeps_its_memory_does_not_ask_for_it_again():
    faults = [float(subprocess.run([sys.executable, '-c', FAULTS, word], check=True, text=True,
                                   capture_output=True,
                                   env={'PYTHONPATH': str(Path(__file__).parents[1])}).stdout)
              for word in ('returned', 'kept')]
    assert faults[1] < 0.1 * faults[0]


def test_a_damaged_chunk_is_noticed(tmp_path):
    path = tmp_path / 'made'
    with write_recording(path) as writer:
        writer.write_content('/points', SECOND, cloud('left'))
    file = path / 'made.mcap'
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    with Recording(path) as recording, pytest.raises(Exception, match='damaged'):
        list(recording.messages())
