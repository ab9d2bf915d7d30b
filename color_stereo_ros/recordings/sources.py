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
The formats of recordings: what a path holds, and its messages as CDR.

`rosbags` reads the files. What is no recording, or one that must be given in another way, is
refused in one sentence that says what to do.

"""

import numpy as np

from .record_times import times_in
from .types import new_typestore
from ..errors import RecordingError

_ZSTD = b'\x28\xb5\x2f\xfd'
_ROS1 = b'#ROSBAG V'
_KINDS = 'a rosbag2 folder, an .mcap or .db3 file, or a ROS 1 bag'
_PACKED = {_ZSTD: ('zstd', 'zstd -d'), b'\x1f\x8b': ('gzip', 'gunzip'),
           b'BZh': ('bzip2', 'bunzip2'), b'\xfd7zXZ': ('xz', 'unxz'),
           b'\x04\x22\x4d\x18': ('lz4', 'unlz4'), b'PK\x03\x04': ('zip', 'unzip')}
_SUFFIXES = {b'\x89MCAP0\r\n': '.mcap', b'SQLite format 3\x00': '.db3'}


def opened(path):
    """
    Open a recording.

    Parameters
    ----------
    path : Path
        Of the file.

    Returns
    -------
    source : Rosbag2 or Rosbag1

    Raises
    ------
    RecordingError
        If there is no recording that can be read. `rosbags` raises other errors, too, where a
        file is damaged.

    """
    if not path.exists():
        raise RecordingError(f'{path}: there is no such recording')
    if path.is_dir():
        _check_folder(path)
        return Rosbag2(path)
    with open(path, 'rb') as file:
        start = file.read(16)
    if start.startswith(_ROS1):
        return Rosbag1(path)
    _check_file(path, start)
    source = Rosbag2(path)
    try:
        _check_single(path, source)
    except BaseException:
        source.close()
        raise
    return source


def _check_folder(path):
    """Refuse a folder that is no rosbag2 recording."""
    if (path / 'metadata.yaml').exists():
        return
    inside = sorted(path.iterdir())
    files = [item.name for item in inside if item.suffix in ('.mcap', '.db3', '.bag')]
    folders = [item.name for item in inside if (item / 'metadata.yaml').exists()]
    if folders and not files:
        raise RecordingError(f'{path}: is no recording, but holds {", ".join(folders[:5])}: name '
                             f'{"it" if len(folders) == 1 else "one of these"}, such as '
                             f'{path / folders[0]}')
    advice = f'; it holds {", ".join(files[:5])}: name one of these files' if files else ''
    raise RecordingError(f'{path}: no metadata.yaml inside: not a rosbag2 folder, or its recorder '
                         f'was stopped before it had finished{advice}')


def _check_file(path, start):
    """Refuse a file that is no recording, or one that says so only by its contents."""
    for magic, (name, command) in _PACKED.items():
        if start.startswith(magic):
            raise RecordingError(
                f'{path}: is a file compressed with {name}, not a recording: give the folder with '
                f'its metadata.yaml, or unpack it with `{command} {path.name}`')
    if path.name == 'metadata.yaml':
        raise RecordingError(f'{path}: is a part of a recording: give its folder')
    for magic, suffix in _SUFFIXES.items():
        if start.startswith(magic) and path.suffix != suffix:
            raise RecordingError(f'{path}: is a recording, but its name must end with {suffix}')
    if not start:
        raise RecordingError(f'{path}: is empty')
    if not any(start.startswith(magic) for magic in _SUFFIXES):
        raise RecordingError(f'{path}: is no recording: neither MCAP, SQLite nor a ROS 1 bag '
                             f'begins as it does; expected {_KINDS}')


def _check_single(path, source):
    """Refuse a single file of compressed messages: only metadata.yaml says that they are."""
    first = next(source.messages({item.topic for item in source.connections}), None)
    if first is not None and first[2].startswith(_ZSTD):
        raise RecordingError(f'{path}: its messages are compressed with zstd, which only the '
                             f'metadata.yaml beside it says: give the folder {path.parent}')


def _chosen(reader, topics, start, stop):
    """Return the messages of some topics; to `rosbags` an empty choice means all."""
    wanted = [item for item in reader.connections if item.topic in topics]
    return reader.messages(wanted, start, stop) if wanted else ()


class Bag:
    """
    What both kinds of recordings have in common; a subclass decodes, and knows latched topics.

    Parameters
    ----------
    reader : rosbags.rosbag1.Reader or rosbags.rosbag2.Reader
        Is opened here.

    """

    def __init__(self, reader):
        self._reader = reader
        self._reader.open()

    @property
    def connections(self):
        """Return what `rosbags` knows of each publisher of each topic."""
        return self._reader.connections

    @property
    def start_ns(self):
        """Return when the first message was recorded, ns."""
        return self._reader.start_time

    @property
    def duration_ns(self):
        """Return the time between the first and the last message, ns."""
        return self._reader.duration - 1

    def messages(self, topics, start=None, stop=None):
        """Yield (connection, time in ns, CDR, what is wrong with it or None)."""
        for connection, time_ns, data in _chosen(self._reader, topics, start, stop):
            try:
                decoded, damage = bytes(self._decoded(connection, data)), None
            except Exception:  # the decoder decides what it raises: nearly anything
                decoded, damage = b'', self._damage(connection)
            yield connection, time_ns, decoded, damage

    def close(self):
        """Close the files."""
        self._reader.close()


class Rosbag2(Bag):
    """An open rosbag2 folder or file."""

    def __init__(self, path):
        from rosbags.rosbag2 import Reader
        super().__init__(Reader(path))
        self._unpacked = self._take_over_unpacking()

    def _take_over_unpacking(self):
        """Return the function that unpacks a message; within `rosbags` one failure ends all."""
        if self._reader.compression_mode != 'message':
            return bytes
        from rosbags.rosbag2.reader import zstd
        storage = self._reader.storage
        storage.metadata = storage.metadata._replace(compression_mode=None)
        return zstd.decompress

    def is_latched(self, connection):
        """Tell whether a topic is transient local."""
        return any(profile.durability.name == 'TRANSIENT_LOCAL'
                   for profile in connection.ext.offered_qos_profiles)

    def _decoded(self, _, data):
        return self._unpacked(data)

    def record_times(self, topic):
        """Return when the messages of a topic were recorded, int64 (n,), ns, where known."""
        storages = getattr(self._reader.storage, 'storages', [self._reader.storage])
        return np.concatenate([times_in(storage, topic) for storage in storages])

    @staticmethod
    def _damage(_):
        return 'it cannot be unpacked'


class Rosbag1(Bag):
    """An open ROS 1 bag; its messages become those of ROS 2."""

    def __init__(self, path):
        from rosbags.rosbag1 import Reader
        super().__init__(Reader(path))
        self._types = new_typestore()
        for connection in self.connections:
            self._learn(connection)

    def _learn(self, connection):
        """Add a type that ROS 2 does not have; one that cannot be read is refused with its use."""
        from rosbags.typesys import get_types_from_msg
        if connection.msgtype in self._types.fielddefs:
            return
        try:
            found = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            self._types.register({name: fields for name, fields in found.items()
                                  if name not in self._types.fielddefs})
        except Exception:  # whatever the parser makes of damaged text
            return

    def is_latched(self, connection):
        """Tell whether a topic was latched."""
        return bool(connection.ext.latching)

    def record_times(self, topic):
        """Return when the messages of a topic were recorded, int64 (n,), ns."""
        return np.array([entry.time for item in self.connections if item.topic == topic
                         for entry in self._reader.indexes[item.id]], np.int64)

    def _decoded(self, connection, data):
        return self._types.ros1_to_cdr(data, connection.msgtype)

    @staticmethod
    def _damage(connection):
        return f'its bytes are no {connection.msgtype} of ROS 1'
