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
The messages of an MCAP file with index: chunks are unpacked ahead, by threads of their own.

`rosbags` does the same in one thread, and copies each message four times. Where a file has no
index, it reads.

"""

from concurrent.futures import ThreadPoolExecutor
import heapq
import os
import struct
from zlib import crc32

from .mcap_writing import MESSAGE_KIND, RECORD

CHUNK_HEAD = struct.Struct('<BQQQQI')
"""A record of a chunk: kind, length, first and last time, size, checksum (0: none)."""
TEXT_AND_SIZE = 4 + 8
"""Bytes around the name of the format: its length, and the number of packed bytes."""
MESSAGE_HEAD = struct.Struct('<HIQQ')
"""Channel, number, times of log and publication of a message; its CDR follows."""
THREADS = 2
"""Chosen: with two, what is done with the messages takes longer than unpacking them."""
AHEAD = THREADS + 1
"""Chunks that are unpacked before they are asked for."""


def read_by_threads(storage):
    """Let a McapReader of `rosbags` that is open read as `messages_of` does."""
    if storage.chunks:
        storage.messages = lambda *wanted: messages_of(storage, *wanted)


def messages_of(storage, connections, start=None, stop=None):
    """
    Yield messages in the order of time, those of one time in the order of the file.

    Parameters
    ----------
    storage : rosbags.rosbag2.storage_mcap.McapReader
        Is open, and has an index.
    connections : collection of Connection
        Whose messages are wanted.
    start, stop : int, optional
        Only what was recorded from `start` on, and before `stop`, ns.

    Yields
    ------
    connection : Connection
    time_ns : int
    data : memoryview

    """
    channels = {connection.id: connection for connection in connections}
    span = -1 if start is None else start, 1 << 64 if stop is None else stop
    chunks = sorted((chunk for chunk in storage.chunks
                     if span[0] <= chunk.message_end_time and chunk.message_start_time < span[1]
                     and channels.keys() & chunk.message_index_offsets.keys()),
                    key=lambda chunk: (chunk.message_start_time, chunk.chunk_start_offset))
    with _Unpacking(storage.bio.fileno(), chunks) as unpacking:
        found = (_of_chunk(unpacking, index, chunk, channels, span)
                 for index, chunk in enumerate(chunks))
        for time_ns, _, connection, data in heapq.merge(*found, key=lambda item: item[:2]):
            if connection is not None:
                yield connection, time_ns, data


def _of_chunk(unpacking, index, chunk, channels, span):
    """Yield (time, place, connection or None, data); the first item only says where it begins."""
    yield chunk.message_start_time, -1, None, None
    data, at, found = memoryview(unpacking.taken(index)), 0, []
    while at < len(data):
        kind, length = RECORD.unpack_from(data, at)
        at += RECORD.size
        if kind == MESSAGE_KIND:
            channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data, at)
            if channel in channels and span[0] <= time_ns < span[1]:
                found.append((time_ns, chunk.chunk_start_offset, channels[channel],
                              data[at + MESSAGE_HEAD.size:at + length]))
        at += length
    _check(at == len(data), 'a chunk ends within a record')
    yield from sorted(found, key=lambda item: item[0])


class _Unpacking:
    """
    Unpacks chunks ahead.

    Parameters
    ----------
    file : int
        Descriptor; it is read where it is open elsewhere, too.
    chunks : list of ChunkInfo
        In the order in which they will be taken, more or less.

    """

    def __init__(self, file, chunks):
        self._file, self._chunks = file, chunks
        self._threads = ThreadPoolExecutor(THREADS)
        self._begun = {}
        self._next = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._threads.shutdown(cancel_futures=True)

    def taken(self, index):
        """Return the bytes of a chunk, once."""
        while self._next < min(index + 1 + AHEAD, len(self._chunks)):
            self._begun[self._next] = self._threads.submit(unpacked, self._file,
                                                           self._chunks[self._next])
            self._next += 1
        return self._begun.pop(index).result()


def unpacked(file, chunk):
    """
    Return the bytes of a chunk.

    Parameters
    ----------
    file : int
        Descriptor.
    chunk : ChunkInfo
        As the index has it.

    Raises
    ------
    rosbags.rosbag2.ReaderError
        If they are not those that were written. Decoders raise errors of their own.

    """
    before = CHUNK_HEAD.size + len(chunk.compression) + TEXT_AND_SIZE
    record = os.pread(file, before + chunk.compressed_size, chunk.chunk_start_offset)
    _check(len(record) == before + chunk.compressed_size, 'a chunk is cut off')
    data = _decoder(chunk.compression)(memoryview(record)[before:])
    _check(len(data) == chunk.uncompressed_size, 'a chunk has another size than its index says')
    checksum = CHUNK_HEAD.unpack_from(record)[-1]
    _check(not checksum or crc32(data) == checksum, 'a chunk has another checksum')
    return data


def _decoder(name):
    """Return what unpacks a format of chunks."""
    from rosbags.rosbag2.reader import zstd
    from rosbags.rosbag2.storage_mcap import lz4_decompress
    decoders = {'': bytes, 'lz4': lz4_decompress, 'zstd': zstd.decompress}
    _check(name in decoders, f'its chunks are compressed as {name!r}')
    return decoders[name]


def _check(holds, otherwise):
    from rosbags.rosbag2 import ReaderError
    if not holds:
        raise ReaderError(otherwise)
