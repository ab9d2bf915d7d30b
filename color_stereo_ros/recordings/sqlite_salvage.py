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
What can still be read of a damaged SQLite file of rosbag2: every row whose pages are whole.

SQLite gives up where a page does not fit the others. Here the tree of pages is not needed: each
page that holds rows says so itself, and a row names the pages on which it goes on (the file
format: https://www.sqlite.org/fileformat2.html). There are no checksums: bytes of an image that
have changed cannot be noticed.

"""

from dataclasses import dataclass
import re
import struct

import numpy as np

ROWS = 0x0D
"""First byte of a page that holds rows of a table."""
PAGE = 4096
"""Bytes of a page where the head of the file does not say it; SQLite's own default."""
LARGEST = 1 << 31
"""Bytes of a row at most, as SQLite has it."""
INTEGERS = {0: 0, 1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8, 8: 0, 9: 0}
"""Bytes of a value by the type of a column."""
TYPE = re.compile(r'\w+(/\w+)+')
SPAN = 1000
"""Numbers of rows; chosen: a wider gap in the numbers is a damaged number, not lost rows."""


@dataclass(frozen=True)
class Row:
    """Where a row lies, and what its columns hold."""

    number: int
    offset: int
    """Of its bytes in the file."""
    local: int
    """How many of them are there."""
    size: int
    """Bytes of the row, columns and their types."""
    following: int
    """Number of the page on which it goes on, 0: none."""
    columns: tuple
    """(type, place of the value in the row, bytes of the value)."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A message."""

    pages: object
    """_Pages of the file."""
    row: Row
    connection: object
    start: int
    """When it was recorded, ns."""

    @property
    def end(self):
        """Return the time of its last message, which is the only one."""
        return self.start

    def messages(self, topics):
        """Yield (Connection, time in ns, data), if the topic is one of some topics."""
        if self.connection.topic in topics:
            _, place, size = self.row.columns[3]
            content = self.pages.content(self.row)
            yield self.connection, self.start, content[place:place + size]


def sqlite_pieces(file, loss, found):
    """
    Return the messages of a damaged file in the order of time.

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
    pages = _Pages(file, loss)
    topics, messages = {}, {}
    for row in pages.rows():
        if _is_topic(row):
            _add_topic(topics, row, pages, found)
        elif _is_message(row):
            messages.setdefault(row.number, row)
    whole = pages.whole(list(messages.values()))
    pieces = [Piece(pages, row, topics[key], time) for row in whole
              for key, time in [_key_and_time(row, pages)] if key in topics and time >= 0]
    for piece in pieces:
        piece.connection.msgcount += 1
    loss.messages += _missing(messages, len(pieces))
    return sorted(pieces, key=lambda piece: (piece.start, piece.row.number))


def _is_message(row):
    """Tell whether a row has the columns id, topic_id, timestamp and data."""
    kinds = [kind for kind, *_ in row.columns]
    return len(kinds) == 4 and kinds[0] == 0 and 0 not in kinds[1:] and (
        kinds[1] in INTEGERS and kinds[2] in INTEGERS and kinds[3] >= 12 and kinds[3] % 2 == 0)


def _is_topic(row):
    """Tell whether a row may have the columns id, name, type, serialization_format and more."""
    kinds = [kind for kind, *_ in row.columns]
    return 4 <= len(kinds) <= 6 and kinds[0] == 0 and all(
        kind >= 13 and kind % 2 for kind in kinds[1:4])


def _add_topic(topics, row, pages, found):
    try:
        content = pages.content(row)
        texts = [content[place:place + size].decode('utf-8')
                 for kind, place, size in row.columns if kind >= 12]
    except (ValueError, UnicodeDecodeError):
        return
    if texts[0].startswith('/') and TYPE.fullmatch(texts[1]) and texts[2] == 'cdr':
        topics[row.number] = found.of(texts[0], texts[1], ''.join(texts[3:4]))


def _key_and_time(row, pages):
    """Return the number of the topic of a message, and its time, ns."""
    content = pages.start(row)
    return tuple(_integer(content, *column) for column in row.columns[1:3])


def _integer(content, kind, place, size):
    return kind - 8 if kind >= 8 else int.from_bytes(content[place:place + size], 'big',
                                                     signed=True)


def _missing(messages, read):
    """Return how many messages are damaged: rows are numbered from 1 without a gap."""
    numbers = np.sort(np.array([0, *messages], np.int64))
    gaps = np.diff(numbers) - 1
    return int(gaps[gaps < SPAN].sum()) + len(messages) - read


class _Pages:
    """
    The pages of a file.

    Parameters
    ----------
    file : Path
    loss : Loss
        Takes that the file ends early.

    """

    def __init__(self, file, loss):
        self._bytes = np.memmap(file, np.uint8, 'r')
        head = bytes(self._bytes[:100]).ljust(100, b'\0')
        size, reserved, count = (struct.unpack_from(form, head, place)[0]
                                 for form, place in (('>H', 16), ('B', 20), ('>I', 28)))
        size = 65536 if size == 1 else size
        self._size = size if size >= 512 and not size & size - 1 else PAGE
        self._usable = self._size - (reserved if reserved <= 32 else 0)
        self._count = len(self._bytes) // self._size
        if len(self._bytes) < count * self._size:
            loss.cut.append(f'{file.name} ends at byte {len(self._bytes)} of '
                            f'{count * self._size}')
        pages = self._bytes[:self._count * self._size].reshape(self._count, self._size)
        self._next = pages[:, :4].copy().view('>u4').ravel().astype(np.int64)
        self._kinds = pages[:, 0].copy()

    def rows(self):
        """Yield the Rows of all pages that hold some."""
        for index in np.flatnonzero(self._kinds[1:] == ROWS) + 1:  # the first describes tables
            start = int(index) * self._size
            page = bytes(self._bytes[start:start + self._usable])
            count, = struct.unpack_from('>H', page, 3)
            if 8 + 2 * count > len(page):
                continue
            for place in struct.unpack_from(f'>{count}H', page, 8):
                row = self._row(page, place, start)
                if row is not None:
                    yield row

    def _row(self, page, place, start):
        """Return the Row at a place of a page, None where its bytes are none."""
        try:
            size, place = _varint(page, place)
            number, place = _varint(page, place)
            number -= (number >> 63) << 64
            local = self._local(size)
            if not 0 < size < LARGEST or place + local > len(page):
                return None
            following = 0 if local == size else struct.unpack_from('>I', page, place + local)[0]
            columns = _columns(page[place:place + local], size)
        except (IndexError, struct.error):
            return None
        return columns and Row(number, start + place, local, size, following, columns)

    def _local(self, size):
        """Return how many bytes of a row of some size lie on its first page."""
        most = self._usable - 35
        if size <= most:
            return size
        least = (self._usable - 12) * 32 // 255 - 23
        local = least + (size - least) % (self._usable - 4)
        return local if local <= most else least

    def start(self, row):
        """Return the bytes of a row on its first page."""
        return bytes(self._bytes[row.offset:row.offset + row.local])

    def _chain(self, row):
        """Return the indices of the further pages of a row; None: they do not fit together."""
        count = -(-(row.size - row.local) // (self._usable - 4))
        if not count:
            return np.empty(0, np.int64)
        first = row.following - 1
        if 0 < first <= self._count - count:
            straight = np.arange(first, first + count)
            if (self._next[straight[:-1]] == straight[1:] + 1).all():
                return straight if self._next[straight[-1]] == 0 else None
        chain, page = [], row.following
        while len(chain) < count and 1 < page <= self._count:
            chain.append(page - 1)
            page = int(self._next[page - 1])
        return np.array(chain) if len(chain) == count and page == 0 else None

    def whole(self, rows):
        """Return the rows all of whose pages are there, each page in one row alone."""
        chains = [(row, self._chain(row)) for row in rows]
        used = np.zeros(self._count, np.int64)
        for _, chain in chains:
            if chain is not None:
                np.add.at(used, chain, 1)
        return [row for row, chain in chains if chain is not None and (used[chain] <= 1).all()]

    def content(self, row):
        """Return the bytes of a row; ValueError where its pages do not fit together."""
        chain = self._chain(row)
        if chain is None:
            raise ValueError('pages are missing')
        pages = self._bytes[:self._count * self._size].reshape(self._count, self._size)
        rest = pages[chain, 4:self._usable].tobytes()
        return self.start(row) + rest[:row.size - row.local]


def _columns(content, size):
    """Return (type, place, bytes) of the columns of a row, None where they do not fill it."""
    head, place = _varint(content, 0)
    columns, value = [], head
    while place < head:
        kind, place = _varint(content, place)
        length = (kind - 12) // 2 if kind >= 12 else INTEGERS.get(kind)
        if length is None:
            return None
        columns.append((kind, value, length))
        value += length
    return tuple(columns) if value == size else None


def _varint(content, place):
    """Return an integer of SQLite's variable length, and the place behind it."""
    value = 0
    for count in range(9):
        byte = content[place + count]
        if count == 8:
            return value << 8 | byte, place + 9
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, place + count + 1
    raise IndexError
