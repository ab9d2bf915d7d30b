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
Read recordings: rosbag2 folders, single files and ROS 1 bags, without ROS.

Needs the library `rosbags` (extra [tools]). Every failure is a RecordingError that names the
recording and what is wrong with it.

"""

from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import re

import numpy as np

from .salvage import is_salvageable, SalvagedMcap
from .sources import opened
from .topics import NOTHING_NAMED, stereo_topics
from .types import typestore
from ..errors import RecordingError


@dataclass(frozen=True, eq=False)
class RecordedMessage:
    """One message of a recording, still serialized."""

    topic: str
    type: str  # noqa: A003
    """For example sensor_msgs/msg/Image."""
    time_ns: int
    """When it was recorded, ns."""
    data: bytes
    """CDR."""
    damage: str = None
    """What is wrong with the message, or None while nothing is known to be wrong."""

    @property
    def place(self):
        """Return topic and time of the message as text."""
        return f'{self.topic} at {seconds(self.time_ns)} s'


class Recording:
    """
    An open recording; use it in a `with` statement.

    Parameters
    ----------
    path : str or Path
        A rosbag2 folder, a single .mcap or .db3 file, or a ROS 1 bag.
    salvaged : bool
        Take what can be read of damaged MCAP files; `loss` tells what is missing.

    Raises
    ------
    RecordingError
        If there is no readable recording.

    """

    def __init__(self, path, salvaged=False):
        self.path = Path(path)
        self.loss = None
        """What cannot be read of a salvaged recording, as text; None: it is taken as whole."""
        if salvaged:
            self._take(SalvagedMcap(self.path))
            self.loss = str(self._source.loss)
            return
        with self._explained():
            self._take(opened(self.path))

    def _take(self, source):
        """Read from a source from now on."""
        self._source = source
        connections = self._source.connections
        self.topics = {item.topic: item.msgtype for item in connections}
        """Topic names to type names."""
        self.counts = dict.fromkeys(self.topics, 0)
        """Topic names to numbers of messages."""
        for item in connections:
            self.counts[item.topic] += item.msgcount
        self.latched = {item.topic for item in connections if self._source.is_latched(item)}
        """Names of the topics that were transient local (ROS 1: latched)."""

    def salvage(self):
        """
        Go on with what can be read of damaged MCAP files.

        Raises
        ------
        RecordingError
            If nothing can be read.

        """
        source = SalvagedMcap(self.path)
        self._source.close()
        self._take(source)
        self.loss = str(source.loss)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._source.close()

    @property
    def start_ns(self):
        """Return when the first message was recorded, ns; meaningless without messages."""
        return self._source.start_ns

    @property
    def duration(self):
        """Return the time between the first and the last message, s."""
        return max(self._source.duration_ns, 0) * 1e-9

    def record_times(self, topic):
        """
        Return when the messages of a topic were recorded, without reading them.

        Returns
        -------
        times : numpy.ndarray, int64, shape (n,)
            ns, in order; empty where the file has no index.

        """
        with self._explained():
            return np.sort(self._source.record_times(topic))

    def messages(self, topics=None, start=None, stop=None):
        """
        Yield every RecordedMessage in the order of time, also those that cannot be decoded.

        Parameters
        ----------
        topics : iterable of str or None
            Only these topics; None = all.
        start, stop : int, optional
            Only what was recorded from `start` on, and before `stop`, ns.

        Raises
        ------
        RecordingError
            Where the file is damaged.

        """
        wanted = set(self.topics if topics is None else topics)
        with self._explained():
            for connection, time_ns, data, damage in self._source.messages(wanted, start, stop):
                yield RecordedMessage(connection.topic, connection.msgtype, time_ns, data, damage)

    def decoded(self, message):
        """
        Return a message as an object with the fields of its type, arrays as numpy arrays.

        Raises
        ------
        RecordingError
            If the message is damaged; names its topic and time.

        """
        if message.damage is None:
            try:
                return typestore().deserialize_cdr(message.data, message.type)
            except Exception as error:  # nearly anything, on damaged bytes
                raise self._refusal(message, f'its bytes are no {message.type}') from error
        raise self._refusal(message, message.damage)

    def check(self, message):
        """Raise RecordingError for a damaged message; types that are not known here pass."""
        if message.damage is not None or message.type in typestore().fielddefs:
            self.decoded(message)

    def _refusal(self, message, reason):
        return RecordingError(f'{self.path}: the message on {message.place} is damaged: {reason}')

    def stereo_topics(self, namespace=None, named=NOTHING_NAMED, compressed=False):
        """Return the StereoTopics of the one stereo pair, see `topics.stereo_topics`."""
        return stereo_topics(self, namespace, named, compressed)

    @contextmanager
    def _explained(self):
        """Turn whatever `rosbags` raises on damaged files (nearly anything) into our error."""
        try:
            yield
        except RecordingError:
            raise
        except Exception as error:
            raise RecordingError(f'{self.path}: damaged or only half written: '
                                 f'{_damage(error)}') from error


def open_readable(path, say):
    """
    Open a recording; of damaged MCAP files, open what can be read.

    Parameters
    ----------
    path : str or Path
        Of the file or folder.
    say : callable
        Called with a sentence about what is lost.

    Returns
    -------
    recording : Recording

    Raises
    ------
    RecordingError
        If nothing can be read.

    """
    try:
        return Recording(path)
    except RecordingError as error:
        if 'metadata.yaml' in str(error) or not is_salvageable(path):
            raise
        recording = Recording(path, salvaged=True)
        say(f'{error}; read is what is whole: {recording.loss}')
        return recording


def _damage(error):
    """Return in one line, without Python's names, what `rosbags` found wrong with a file."""
    from rosbags import rosbag1, rosbag2
    text = ' '.join(str(error).split())
    if field := re.search(r"KeyError\('(\w+)'\)", text):
        return f'metadata.yaml has no field {field.group(1)}'
    if 'Could not load YAML' in text:
        line = re.search(r'line (\d+)', text)
        return 'metadata.yaml is no YAML' + (f', see line {line.group(1)}' if line else '')
    if 'Invalid bag metadata' in text or isinstance(error, UnicodeDecodeError):
        return ('metadata.yaml' if 'metadata' in text else 'an entry') + ' has impossible contents'
    known = rosbag1.ReaderError, rosbag2.ReaderError
    if 'File end magic' in text:
        return 'its end is missing; `mcap recover` makes a new file of what is whole'
    return text.rstrip('.') if isinstance(error, known) and text else 'it cannot be decoded'


def seconds(time_ns):
    """Return a time in ns as text in s, without rounding."""
    whole, rest = divmod(abs(time_ns), 1_000_000_000)
    return f'{"-" * (time_ns < 0)}{whole}.{rest:09d}'
