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
What can still be read of a damaged MCAP file: every chunk that is whole, index or no index.

The library `mcap` reads records. It ends at the first one that is damaged; here the others count.
An index at the end of the file, where it is whole, leads to what lies behind the damage.

"""

from dataclasses import dataclass
from pathlib import Path
import struct

HEAD = struct.Struct('<BQ')  # of a record: kind and length
MAGIC = b'\x89MCAP0\r\n'
SCHEMA, CHANNEL, MESSAGE, CHUNK, FOOTER = 0x03, 0x04, 0x05, 0x06, 0x02


@dataclass(frozen=True, eq=False)
class Piece:
    """A record that holds messages: a chunk, or a message outside of chunks."""

    file: Path
    offset: int
    length: int
    kind: int
    start: int
    """Time of its first message, ns."""
    end: int
    channels: dict
    """Of the file: numbers of channels to Connections."""

    def messages(self, topics):
        """Yield (Connection, time in ns, data) of some topics in the order of time."""
        from mcap.records import Message
        records = [record for record in _records(self.file, self.offset, self.length, self.kind)
                   if isinstance(record, Message)]
        for record in sorted(records, key=lambda item: item.log_time):
            connection = self.channels[record.channel_id]
            if connection.topic in topics:
                yield connection, record.log_time, record.data


def mcap_pieces(file, loss, found):
    """
    Return the pieces of a damaged file.

    Parameters
    ----------
    file : Path
        Of the recording; it is only read.
    loss : Loss
        Takes what cannot be read.
    found : Connections
        Gets the topics, whose messages are counted.

    Returns
    -------
    pieces : list of Piece

    """
    return _File(file, found).pieces(loss)


class _File:
    """A file while it is looked through."""

    def __init__(self, file, found):
        self._file, self._found = file, found
        self._schemas, self._channels = {}, {}

    def pieces(self, loss):
        """Return the pieces that are whole."""
        summary, pieces = _summary(self._file), []
        if summary is not None:
            self._schemas = {key: schema.name for key, schema in summary.schemas.items()}
            for channel in summary.channels.values():
                if channel.schema_id in self._schemas:
                    self._learn(channel)
        for place in sorted({*_scanned(self._file, loss), *_indexed(summary)}):
            try:
                times = self._times(*place)
            except Exception:  # whatever parsers make of damaged bytes
                loss.pieces += 1
                continue
            if times:
                pieces.append(Piece(self._file, *place, min(times), max(times), self._channels))
        return pieces

    def _times(self, offset, length, kind):
        """Return the times of the messages of a piece; their channels are known then."""
        from mcap.records import Channel, Message, Schema
        messages = []
        for record in _records(self._file, offset, length, kind):
            if isinstance(record, Schema):
                self._schemas[record.id] = record.name
            elif isinstance(record, Channel):
                self._learn(record)
            elif isinstance(record, Message):
                messages.append((self._channels[record.channel_id], record.log_time))
        for connection, _ in messages:
            connection.msgcount += 1
        return [time for _, time in messages]

    def _learn(self, channel):
        self._channels[channel.id] = self._found.of(
            channel.topic, self._schemas[channel.schema_id],
            channel.metadata.get('offered_qos_profiles', ''))


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
