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
"""Damaged recordings: what is whole is used, what is lost is told, nothing is wrong."""

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import RecordingError
from color_stereo_ros.recordings.reading import open_readable, Recording
from color_stereo_ros.recordings.writing import write_recording

import numpy as np

import pytest

from scenes import hue_pair, parallel_rig

SECOND = 1_000_000_000
COUNT = 60
IMAGE = 256, 64  # px, so large that a chunk holds few messages
PAPER = ['--matching.method', 'paper', '--pattern.type', 'sweep', '--color.smoothing', '0',
         '--range.min_depth', '0.2', '--range.max_depth', '9', '--workers', '1']


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Return a recording of several chunks, its images with noise that nothing compresses."""
    path = tmp_path_factory.mktemp('salvage') / 'bag'
    width, height = IMAGE
    rig = parallel_rig(width, height)
    noise = np.random.default_rng(3).integers(0, 60, (COUNT, height, width, 3), np.uint8)
    left, right = hue_pair(9, width, height)
    with write_recording(path) as writer:
        for index in range(COUNT):
            writer.write_pair((1 + index) * SECOND, np.maximum(left, 60) - noise[index], right,
                              rig)
    return path


def copy(whole, folder, change):
    """Return a copy of a recording whose file is what `change` makes of its bytes."""
    folder.mkdir()
    (folder / 'metadata.yaml').write_bytes((whole / 'metadata.yaml').read_bytes())
    content = (whole / 'bag.mcap').read_bytes()
    (folder / 'bag.mcap').write_bytes(change(content))
    return folder


def contents(recording):
    """Return topic, time and bytes of all messages of an open recording."""
    return {(message.topic, message.time_ns, bytes(message.data))
            for message in recording.messages()}


def test_a_whole_recording_is_salvaged_as_a_whole(whole):
    with Recording(whole) as one, Recording(whole, salvaged=True) as other:
        assert other.loss == 'only the index is lost'
        assert contents(other) == contents(one) and other.counts == one.counts
        assert other.latched == one.latched
        assert other.duration == pytest.approx(one.duration)


def test_what_lies_before_the_cut_is_read(tmp_path, whole, effort):
    with Recording(whole) as recording:
        everything = contents(recording)
    found = []
    for seed in effort.seeds(6, 100):
        kept = np.random.default_rng(seed).uniform(0.02, 0.999)
        cut = copy(whole, tmp_path / f'cut_{seed}',
                   lambda content, kept=kept: content[:int(kept * len(content))])
        told = []
        try:
            with open_readable(cut, told.append) as recording:
                read = contents(recording)
        except RecordingError as error:
            assert 'no message of it can be read' in str(error)
            read = set()
        assert read <= everything and len(read) >= (kept - 0.2) * len(everything)
        assert not read or 'can be read up to byte' in told[0]
        found.append(len(read))
    assert max(found) > len(everything) / 2


def test_one_damaged_chunk_costs_its_messages_and_nothing_else(tmp_path, whole, effort):
    with Recording(whole) as recording:
        everything = contents(recording)
    for seed in effort.seeds(6, 100):
        generator = np.random.default_rng(seed)

        def flip(content, generator=generator):
            damaged = bytearray(content)
            place = int(generator.integers(len(content) // 5, 4 * len(content) // 5))
            damaged[place:place + 8] = bytes(value ^ 0xFF for value in damaged[place:place + 8])
            return bytes(damaged)

        with Recording(copy(whole, tmp_path / f'flip_{seed}', flip), salvaged=True) as recording:
            read = contents(recording)
            assert read <= everything and len(read) >= 0.6 * len(everything)
            assert len(read) == len(everything) or 'damaged' in recording.loss \
                or 'up to byte' in recording.loss


@pytest.mark.parametrize('kind', ['cut', 'flipped'])
def test_a_damaged_recording_is_converted_as_far_as_it_can_be_read(tmp_path, whole, kind, capsys):
    def change(content):
        half = len(content) // 2
        return content[:half] if kind == 'cut' else (
            content[:half] + bytes(8) + content[half + 8:])

    bag = copy(whole, tmp_path / 'bag', change)
    assert cli.main(['convert', str(whole), str(tmp_path / 'all'), *PAPER]) == 0
    capsys.readouterr()
    assert cli.main(['convert', str(bag), str(tmp_path / 'some'), *PAPER]) == cli.PARTLY
    said = capsys.readouterr().err
    assert 'read is what is whole' in said and 'Traceback' not in said
    with Recording(tmp_path / 'all') as one, Recording(tmp_path / 'some') as other:
        some = values(other)
        assert COUNT / 4 < len(some) < COUNT
        expected = values(one)
        assert all(expected[time] == data for time, data in some.items())


def values(recording):
    """Return the depth of all pairs by time."""
    return {message.time_ns: recording.decoded(message).data.tobytes()
            for message in recording.messages(['/depth/image'])}


def test_nothing_that_can_be_read_is_an_error(tmp_path, whole):
    bag = copy(whole, tmp_path / 'bag', lambda content: content[:40])
    with pytest.raises(RecordingError, match='no message of it can be read'):
        open_readable(bag, print)
