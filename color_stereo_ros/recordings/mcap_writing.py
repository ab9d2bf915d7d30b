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
Chunks of MCAP files, written without copying images about.

`rosbags` copies a message four times on its way into a file, into new memory each time. Here it
is copied once, into the chunk that is compressed, and memory is used again.

"""

from functools import partial
from io import BytesIO
import struct

CHUNK_SIZE = 1 << 20
"""Bytes from which on a chunk is closed; that of `rosbags`."""
FORMAT = b'zstd'
RECORD = struct.Struct('<BQ')
"""Kind and length of a record."""
MESSAGE = struct.Struct('<BQHIQQ')
"""A record of a message: its channel, number, times of log and publication, ns; then the CDR."""
CHUNK = struct.Struct('<BQQQQII4sQ')
"""A record of a chunk: first and last time, size, checksum, format, bytes; then the bytes."""
INDEX = struct.Struct('<BQHI')
"""A record of an index: its channel, bytes of the entries; then the entries."""
PLACE = struct.Struct('<QQ')
"""Entry of an index: time, ns, and place of a message in its chunk."""
SUMMARY = struct.Struct('<QQQQI')
"""Summary of a chunk: first and last time, place and length of the record, bytes of the map."""
WHERE = struct.Struct('<HQ')
"""Entry of the map: a channel, and the place of its index."""
SIZES = struct.Struct('<QI4sQQ')
"""End of the summary: bytes of all indexes, format, bytes, size."""
COMPRESSIONS = {
    'fast': {'compression_level': -1, 'hash_log': 8, 'min_match': 7, 'target_length': 3},
    'small': {'compression_level': 1, 'hash_log': 6, 'min_match': 7}}
"""
Of zstd. Ranges repeat nothing but unknown pixels. Long matches and a small table find these, and
are faster than those of the levels. `small` codes the other bytes by their frequency, too, which
takes most of the time that compressing takes. docs/scale.md compares.
"""
DEFAULT_COMPRESSION = 'fast'
"""Of `convert`, whose time is that of many pairs; what is written once is `small`."""
CHECKSUM = {'checksum_flag': 1}
"""Lets readers notice damage: `rosbags` leaves out that of MCAP."""
MESSAGE_KIND, CHUNK_KIND, INDEX_KIND = 0x05, 0x06, 0x07
NO_TIME = 2**63 - 1
"""First time of a chunk without messages, as `rosbags` has it."""


def compressor(name):
    """
    Return what compresses a chunk, called with its bytes.

    Parameters
    ----------
    name : str
        One of COMPRESSIONS.

    """
    from rosbags.rosbag2.writer import zstd
    options = {getattr(zstd.CompressionParameter, option): value
               for option, value in (CHECKSUM | COMPRESSIONS[name]).items()}
    return partial(zstd.compress, options=options)


class ChunkWriter:
    """
    The storage of a rosbags.rosbag2.Writer with MCAP; what it does not do itself, that one does.

    Parameters
    ----------
    storage : rosbags.rosbag2.storage_mcap.McapWriter
        Has just been opened.
    compression : str
        One of COMPRESSIONS.

    """

    def __init__(self, storage, compression):
        self._storage = storage
        self._compress = compressor(compression)

    def __getattr__(self, name):
        """Return what `rosbags` knows of the file."""
        return getattr(self._storage, name)

    def write(self, connection, timestamp, data):
        """Append a message; `data` is a sequence of its parts, bytes-like."""
        storage, chunk, memory = self._storage, self._storage.chunk, self._storage.chunk.bio
        for times in (storage, chunk):
            times.message_start_time = min(timestamp, times.message_start_time)
            times.message_end_time = max(timestamp, times.message_end_time)
        storage.channel_stats[connection.id] += 1
        chunk.msgs[connection.id].append((timestamp, memory.tell()))
        size = MESSAGE.size - RECORD.size + sum(map(len, data))
        memory.write(MESSAGE.pack(MESSAGE_KIND, size, connection.id, 0, timestamp, timestamp))
        for part in data:
            memory.write(part)
        if memory.tell() > CHUNK_SIZE:
            self._close_chunk()

    def _close_chunk(self):
        """Write the chunk and the indexes of its messages; its memory is that of the next one."""
        chunk, file, size = self._storage.chunk, self._storage.bio, self._storage.chunk.bio.tell()
        times = chunk.message_start_time, chunk.message_end_time
        with chunk.bio.getbuffer() as memory, memory[:size] as filled:
            packed = self._compress(filled)
        start = file.tell()
        file.write(CHUNK.pack(CHUNK_KIND, CHUNK.size - RECORD.size + len(packed), *times, size, 0,
                              len(FORMAT), FORMAT, len(packed)))
        file.write(packed)
        end = file.tell()
        places = b''.join(_indexed(file, *item) for item in chunk.msgs.items())
        self._storage.chunks.append(BytesIO())
        self._storage.chunks[-1].write(
            SUMMARY.pack(*times, start, end - start, len(places)) + places
            + SIZES.pack(file.tell() - end, len(FORMAT), FORMAT, len(packed), size))
        chunk.message_start_time, chunk.message_end_time = NO_TIME, 0
        chunk.msgs.clear()
        chunk.bio.seek(0)

    def close(self, version, metadata):
        """Write the last chunk, and what ends the file."""
        if self._storage.chunk.bio.tell():
            self._close_chunk()
        self._storage.close(version, metadata)


def _indexed(file, channel, messages):
    """Write the index of one channel of a chunk; return its entry of the summary."""
    place = file.tell()
    entries = b''.join(PLACE.pack(*message) for message in messages)
    file.write(INDEX.pack(INDEX_KIND, INDEX.size - RECORD.size + len(entries), channel,
                          len(entries)) + entries)
    return WHERE.pack(channel, place)
