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
"""
What can still be read of damaged MCAP files: every chunk that is whole, index or no index.

The library `mcap` reads records. It ends at the first one that is damaged; here the others count.
An index at the end of the file, where it is whole, leads to what lies behind the damage.

"""

from dataclasses import dataclass, field
from pathlib import Path
import struct

import numpy as np

from ..errors import RecordingError

HEAD = struct.Struct('<BQ')  # of a record: kind and length
MAGIC = b'\x89MCAP0\r\n'
SCHEMA, CHANNEL, MESSAGE, CHUNK, FOOTER = 0x03, 0x04, 0x05, 0x06, 0x02


@dataclass(eq=False)
class Connection:
    """One topic of a damaged recording."""

    topic: str
    msgtype: str
    is_latched: bool
    msgcount: int = 0


@dataclass(frozen=True)
class Piece:
    """A record that holds messages: a chunk, or a message outside of chunks."""

    file: Path
    offset: int
    length: int
    kind: int
    start: int
    """Time of its first message, ns."""
    end: int


@dataclass
class Loss:
    """What cannot be read."""

    cut: list = field(default_factory=list)
    """Texts about files that end early."""
    pieces: int = 0
    """Chunks and messages that are damaged."""

    def __str__(self):
        damaged = [f'{self.pieces} chunks are damaged'] if self.pieces else []
        return '; '.join([*self.cut, *damaged]) or 'only the index is lost'


def is_salvageable(path):
    """Return whether a path holds MCAP files."""
    return bool(mcap_files(path))


def mcap_files(path):
    """Return the MCAP files of a path, those of a folder in the order of their numbers."""
    path = Path(path)
    files = [path] if path.is_file() else sorted(
        path.glob('*.mcap'), key=lambda file: (len(file.name), file.name))
    found = []
    for file in files:
        try:
            with open(file, 'rb') as opened:
                if opened.read(len(MAGIC)) == MAGIC:
                    found.append(file)
        except OSError:
            continue
    return found


class SalvagedMcap:
    """
    A damaged recording of MCAP files; the twin of `sources.Rosbag2`.

    Parameters
    ----------
    path : Path
        A folder or a file.

    Raises
    ------
    RecordingError
        If nothing can be read.

    """

    def __init__(self, path):
        self.loss = Loss()
        self._channels, self._pieces, self._by_topic = {}, [], {}
        for file in mcap_files(path):
            self._look_through(file)
        if not self._pieces:
            raise RecordingError(f'{path}: is damaged, and no message of it can be read')
        self.connections = list(self._by_topic.values())

    @property
    def start_ns(self):
        """Return when the first message was recorded, ns."""
        return min(piece.start for piece in self._pieces)

    @property
    def duration_ns(self):
        """Return the time between the first and the last message, ns."""
        return max(piece.end for piece in self._pieces) - self.start_ns

    @staticmethod
    def record_times(_):
        """Return no time: the index is not trusted."""
        return np.empty(0, np.int64)

    @staticmethod
    def is_latched(connection):
        """Tell whether a topic is transient local."""
        return connection.is_latched

    def close(self):
        """Do nothing: no file is kept open."""

    def messages(self, topics, start=None, stop=None):
        """Yield (connection, time in ns, CDR, None) in the order of the file."""
        for piece in self._pieces:
            if (start is not None and piece.end < start) or (
                    stop is not None and piece.start >= stop):
                continue
            for message in sorted(self._messages_of(piece), key=lambda item: item.log_time):
                connection = self._connection(piece.file, message)
                if connection.topic in topics and (start is None or message.log_time >= start) \
                        and (stop is None or message.log_time < stop):
                    yield connection, message.log_time, message.data, None

    def _connection(self, file, message):
        return self._channels[file, message.channel_id]

    def _look_through(self, file):
        """Note the pieces of a file, and count their messages."""
        known, summary = {}, _summary(file)
        if summary is not None:
            known = {key: schema.name for key, schema in summary.schemas.items()}
            for channel in summary.channels.values():
                if channel.schema_id in known:
                    self._learn(file, channel, known)
        for piece in sorted({*_scanned(file, self.loss), *_indexed(summary)}):
            try:
                messages = self._parsed(file, *piece, known)
            except Exception:  # whatever parsers make of damaged bytes
                self.loss.pieces += 1
                continue
            if messages:
                times = [message.log_time for message in messages]
                self._pieces.append(Piece(file, *piece, min(times), max(times)))

    def _parsed(self, file, offset, length, kind, schemas):
        """Return the messages of a piece; their channels are known then."""
        from mcap.records import Channel, Message, Schema
        records = _records(file, offset, length, kind)
        messages = []
        for record in records:
            if isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel):
                self._learn(file, record, schemas)
            elif isinstance(record, Message):
                messages.append(record)
        for message in messages:
            self._connection(file, message).msgcount += 1
        return messages

    def _learn(self, file, channel, schemas):
        quality = channel.metadata.get('offered_qos_profiles', '')
        self._channels[file, channel.id] = self._by_topic.setdefault(channel.topic, Connection(
            channel.topic, schemas[channel.schema_id],
            'transient_local' in quality or 'durability: 1' in quality))

    def _messages_of(self, piece):
        from mcap.records import Message
        records = _records(piece.file, piece.offset, piece.length, piece.kind)
        return [record for record in records if isinstance(record, Message)]


def _scanned(file, loss):
    """Yield (offset, length, kind) of the records from the start of a file until it breaks off."""
    size = file.stat().st_size
    with open(file, 'rb') as opened:
        offset = len(MAGIC)
        while True:
            opened.seek(offset)
            head = opened.read(HEAD.size)
            kind, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
            if kind == FOOTER:
                return
            if not kind or offset + HEAD.size + length > size:
                loss.cut.append(f'{file.name} can be read up to byte {offset} of {size}')
                return
            if kind in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
                yield offset, length, kind
            offset += HEAD.size + length


def _summary(file):
    """Return the summary at the end of a file, None where it is not whole."""
    from mcap.reader import SeekingReader
    try:
        with open(file, 'rb') as opened:
            return SeekingReader(opened).get_summary()
    except Exception:  # whatever the library makes of damaged bytes
        return None


def _indexed(summary):
    """Return (offset, length, kind) of the chunks that a summary knows."""
    return [(index.chunk_start_offset, index.chunk_length - HEAD.size, CHUNK)
            for index in (summary.chunk_indexes if summary else ())]


def _records(file, offset, length, kind):
    """Return the records of a chunk, or the one record that lies outside of chunks."""
    from io import BytesIO

    from mcap.data_stream import ReadDataStream
    from mcap.records import Channel, Chunk, Message, Schema
    from mcap.stream_reader import breakup_chunk
    with open(file, 'rb') as opened:
        opened.seek(offset + HEAD.size)
        stream = ReadDataStream(BytesIO(opened.read(length)))
    if kind == CHUNK:
        return breakup_chunk(Chunk.read(stream), validate_crc=True)
    if kind == MESSAGE:
        return [Message.read(stream, length)]
    return [(Schema if kind == SCHEMA else Channel).read(stream)]
