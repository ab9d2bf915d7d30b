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

from contextlib import contextmanager

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import RecordingError
from color_stereo_ros.recordings.reading import open_readable, Recording
from color_stereo_ros.recordings.writing import RecordingWriter, write_recording
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from scenes import hue_pair, parallel_rig

SECOND = 1_000_000_000
COUNT = 60
PAGE = 4096  # bytes of SQLite
IMAGE = 256, 64  # px, so large that a chunk holds few messages
PAPER = ['--matching.method', 'paper', '--pattern.type', 'sweep', '--color.smoothing', '0',
         '--range.min_depth', '0.2', '--range.max_depth', '9', '--workers', '1']


@pytest.fixture(scope='module', params=['mcap', 'db3'])
def whole(request, tmp_path_factory):
    """Return a recording of several chunks, its images with noise that nothing compresses."""
    path = tmp_path_factory.mktemp('salvage') / 'bag'
    with (write_recording(path) if request.param == 'mcap' else sqlite_recording(path)) as writer:
        write_noise(writer)
    return path


@pytest.fixture(scope='module')
def sqlite(tmp_path_factory):
    """Return the same as an SQLite recording, which has pages and no checksums."""
    path = tmp_path_factory.mktemp('salvage') / 'bag'
    with sqlite_recording(path) as writer:
        write_noise(writer)
    return path


class Joined:
    """The storage of a writer, which then takes messages in parts."""

    def __init__(self, storage):
        self._storage = storage

    def __getattr__(self, name):
        return getattr(self._storage, name)

    def write(self, connection, timestamp, parts):
        """Append a message."""
        self._storage.write(connection, timestamp, b''.join(parts))


@contextmanager
def sqlite_recording(path):
    """Write an SQLite recording."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        writer.storage = Joined(writer.storage)
        yield RecordingWriter(writer)


def write_noise(writer):
    """Write pairs of a plane with noise."""
    width, height = IMAGE
    rig = parallel_rig(width, height)
    noise = np.random.default_rng(3).integers(0, 60, (COUNT, height, width, 3), np.uint8)
    left, right = hue_pair(9, width, height)
    for index in range(COUNT):
        writer.write_pair((1 + index) * SECOND, np.maximum(left, 60) - noise[index], right, rig)


def file_of(bag):
    """Return the one file of a recording that holds its messages."""
    file, = (path for path in bag.iterdir() if path.name != 'metadata.yaml')
    return file


def copy(whole, folder, change):
    """Return a copy of a recording whose file is what `change` makes of its bytes."""
    folder.mkdir()
    (folder / 'metadata.yaml').write_bytes((whole / 'metadata.yaml').read_bytes())
    file = file_of(whole)
    (folder / file.name).write_bytes(change(file.read_bytes()))
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
        assert not read or 'can be read up to byte' in told[0] or 'ends at byte' in told[0]
        found.append(len(read))
    assert max(found) > len(everything) / 2


def test_one_damaged_chunk_costs_its_messages_and_nothing_else(tmp_path, whole, effort):
    wrong = 0 if file_of(whole).suffix == '.mcap' else 1  # SQLite has no checksums
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
            assert len(read - everything) <= wrong and len(read) >= 0.6 * len(everything)
            assert len(read) == len(everything) or 'damaged' in recording.loss \
                or 'up to byte' in recording.loss


def test_a_damaged_pointer_of_a_page_costs_one_message(tmp_path, sqlite, effort):
    with Recording(sqlite) as recording:
        everything = contents(recording)
    for seed in effort.seeds(6, 100):
        generator = np.random.default_rng(seed)

        def flip(content, generator=generator):
            damaged, pages = bytearray(content), len(content) // PAGE
            place = PAGE * int(generator.integers(pages // 5, pages))
            damaged[place:place + 4] = int(generator.integers(1, pages)).to_bytes(4, 'big')
            return bytes(damaged)

        with Recording(copy(sqlite, tmp_path / f'flip_{seed}', flip), salvaged=True) as recording:
            read = contents(recording)
            assert read <= everything and len(read) >= len(everything) - 2
            assert len(read) == len(everything) or 'damaged' in recording.loss


def test_rows_that_are_lost_without_an_error_are_noticed(tmp_path, sqlite, capsys):
    rows = 0x0D  # first byte of a page of rows

    def change(content):
        damaged, pages = bytearray(content), range(len(content) // PAGE // 2, len(content) // PAGE)
        place = PAGE * next(page for page in pages if content[PAGE * page] == rows)
        count = int.from_bytes(content[place + 3:place + 5], 'big')
        damaged[place + 3:place + 5] = (count - 4).to_bytes(2, 'big')
        return bytes(damaged)

    bag = copy(sqlite, tmp_path / 'bag', change)
    assert cli.main(['convert', str(bag), str(tmp_path / 'out'), *PAPER]) == cli.PARTLY
    said = capsys.readouterr().err
    assert 'damaged messages: 4' in said and said.count(str(bag)) == 1


def test_rows_without_a_table_of_topics_are_no_recording(tmp_path, sqlite):
    def change(content):
        return content.replace(b'sensor_msgs/msg/', b'sensor_msgs-msg-')
    with pytest.raises(RecordingError, match='no message of it can be read'):
        Recording(copy(sqlite, tmp_path / 'bag', change), salvaged=True)


@pytest.mark.parametrize('kind', ['cut', 'flipped'])
def test_a_damaged_recording_is_converted_as_far_as_it_can_be_read(tmp_path, whole, kind, capsys):
    def change(content):
        half = len(content) // 2 // PAGE * PAGE
        return content[:half] if kind == 'cut' else (
            content[:half] + bytes(8) + content[half + 8:])

    bag = copy(whole, tmp_path / 'bag', change)
    assert cli.main(['convert', str(whole), str(tmp_path / 'all'), *PAPER]) == 0
    capsys.readouterr()
    assert cli.main(['convert', str(bag), str(tmp_path / 'some'), *PAPER]) == cli.PARTLY
    out, said = capsys.readouterr()
    assert said.count('read is what is whole') == 1 and 'Traceback' not in said
    assert said.count(str(bag)) == 1 and 'a damaged recording' in out
    with Recording(tmp_path / 'all') as one, Recording(tmp_path / 'some') as other:
        some = values(other)
        assert COUNT / 4 < len(some) < COUNT
        expected = values(one)
        assert all(expected[time] == data for time, data in some.items())


def test_a_page_of_a_damaged_recording_has_the_status_of_one(tmp_path, whole, capsys):
    bag = copy(whole, tmp_path / 'bag', lambda content: content[:len(content) // 2])
    page = tmp_path / 'page.html'
    assert cli.main(['view', str(bag), '--html', str(page), *PAPER[:-2]]) == cli.PARTLY
    assert page.stat().st_size and capsys.readouterr().err.count('read is what is whole') == 1


def values(recording):
    """Return the depth of all pairs by time."""
    return {message.time_ns: recording.decoded(message).data.tobytes()
            for message in recording.messages(['/depth/image'])}


def test_nothing_that_can_be_read_is_an_error(tmp_path, whole):
    bag = copy(whole, tmp_path / 'bag', lambda content: content[:40])
    with pytest.raises(RecordingError, match='no message of it can be read'):
        open_readable(bag, print)
