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
"""What can still be read of damaged recordings; each format has a module of its own."""

from pathlib import Path

import numpy as np

from .losses import Connections, Loss
from .mcap_salvage import mcap_pieces
from .sqlite_salvage import sqlite_pieces
from ..errors import RecordingError

FORMATS = {b'\x89MCAP0\r\n': ('.mcap', mcap_pieces),
           b'SQLite format 3\x00': ('.db3', sqlite_pieces)}
"""How files begin, how their names end, and what reads them when they are damaged."""
ZSTD = b'\x28\xb5\x2f\xfd'
"""How a message begins that the recorder has compressed; no CDR does."""


def is_salvageable(path):
    """Return whether a path holds MCAP or SQLite files."""
    return bool(_files(path))


def _files(path):
    """Return (file, reader) of a path, those of a folder in the order of their numbers."""
    path = Path(path)
    suffixes = [suffix for suffix, _ in FORMATS.values()]
    files = [path] if path.is_file() else sorted(
        (file for suffix in suffixes for file in path.glob(f'*{suffix}')),
        key=lambda file: (len(file.name), file.name))
    found = []
    for file in files:
        try:
            with open(file, 'rb') as opened:
                start = opened.read(max(map(len, FORMATS)))
        except OSError:
            continue
        found += [(file, reader) for magic, (_, reader) in FORMATS.items()
                  if start.startswith(magic)]
    return found


class Salvaged:
    """
    A damaged recording; the twin of `sources.Rosbag2`.

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
        self.loss, found = Loss(), Connections()
        self._pieces = [piece for file, reader in _files(path)
                        for piece in reader(file, self.loss, found)]
        if not self._pieces:
            raise RecordingError(f'{path}: is damaged, and no message of it can be read')
        self.connections = found.used()

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
        """Do nothing: what is open is closed when it is forgotten."""

    def messages(self, topics, start=None, stop=None):
        """Yield (connection, time in ns, CDR, what is wrong or None) in the order of the file."""
        for piece in self._pieces:
            if (start is not None and piece.end < start) or (
                    stop is not None and piece.start >= stop):
                continue
            for connection, time_ns, data in piece.messages(topics):
                if (start is None or time_ns >= start) and (stop is None or time_ns < stop):
                    yield connection, time_ns, *_unpacked(data)


def _unpacked(data):
    """Return the CDR of a message, and what is wrong with it or None."""
    if not data.startswith(ZSTD):
        return data, None
    from rosbags.rosbag2.reader import zstd
    try:
        return zstd.decompress(data), None
    except Exception:  # whatever the library makes of damaged bytes
        return b'', 'it cannot be unpacked'
