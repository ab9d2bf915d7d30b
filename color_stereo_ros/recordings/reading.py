# SPDX-License-Identifier: Apache-2.0
"""
Read recordings: rosbag2 folders and single files, without ROS.

Needs the library `rosbags` (extra [tools]). Every failure is a RecordingError that names the
recording and what is wrong with it.

"""

from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import re

from ..errors import RecordingError
from ..messages.contents import CameraInfo, Image
from .types import typestore


@dataclass(frozen=True)
class StereoTopics:
    """The four topics that `range_node` needs, as a recording names them."""

    left_image: str
    right_image: str
    left_info: str
    right_info: str

    @property
    def names(self):
        """Return the four names."""
        return self.left_image, self.right_image, self.left_info, self.right_info


STEREO_TOPICS = StereoTopics('left/image_raw', 'right/image_raw',
                             'left/camera_info', 'right/camera_info')


@dataclass(frozen=True, eq=False)
class RecordedMessage:
    """One message of a recording, still serialized."""

    topic: str
    type: str
    """For example sensor_msgs/msg/Image."""
    time_ns: int
    """When it was recorded, ns."""
    data: bytes
    """CDR."""


class Recording:
    """
    An open recording; use it in a `with` statement.

    Parameters
    ----------
    path : str or Path
        A rosbag2 folder or a single .mcap or .db3 file.

    Raises
    ------
    RecordingError
        If there is no readable recording.

    """

    def __init__(self, path):
        from rosbags.rosbag2 import Reader
        self.path = Path(path)
        if not self.path.exists():
            raise RecordingError(f'{path}: there is no such recording')
        if self.path.is_dir() and not (self.path / 'metadata.yaml').exists():
            raise RecordingError(f'{path}: no metadata.yaml inside: not a rosbag2 folder, or its '
                                 'recorder was stopped before it had finished')
        with self._explained():
            self._reader = Reader(self.path)
            self._reader.open()
        self.topics = {item.topic: item.msgtype for item in self._reader.connections}
        """Topic names to type names."""
        self.counts = {item.topic: item.msgcount for item in self._reader.connections}
        """Topic names to numbers of messages."""
        self.latched = {item.topic for item in self._reader.connections if _is_latched(item)}
        """Names of the topics that were transient local."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._reader.close()

    @property
    def duration(self):
        """Return the time between the first and the last message, s."""
        return max(self._reader.duration - 1, 0) * 1e-9

    def messages(self, topics=None):
        """
        Yield every RecordedMessage in the order of time.

        Parameters
        ----------
        topics : iterable of str or None
            Only these topics; None = all.

        Raises
        ------
        RecordingError
            Where the file is damaged.

        """
        wanted = None if topics is None else set(topics)
        connections = [item for item in self._reader.connections
                       if wanted is None or item.topic in wanted]
        with self._explained():
            for connection, time_ns, data in self._reader.messages(connections):
                yield RecordedMessage(connection.topic, connection.msgtype, time_ns, bytes(data))

    def decoded(self, message):
        """Return a message as an object with the fields of its type, arrays as numpy arrays."""
        with self._explained():
            return typestore().deserialize_cdr(message.data, message.type)

    def stereo_topics(self, namespace=None):
        """
        Return the topics of the one stereo pair in the recording.

        Parameters
        ----------
        namespace : str or None
            The names before `left/image_raw`, for example '/cell_1'; None = find them.

        Returns
        -------
        topics : StereoTopics

        Raises
        ------
        RecordingError
            If a topic is missing, empty or of another type, or if several pairs are there.

        """
        namespace = self._namespace() if namespace is None else namespace.strip('/')
        prefix = f'/{namespace}/' if namespace else '/'
        found = StereoTopics(*(prefix + name for name in STEREO_TOPICS.names))
        for topic, expected in zip(found.names, 2 * [Image.TYPE] + 2 * [CameraInfo.TYPE]):
            self._check_topic(topic, expected)
        return found

    def _namespace(self):
        ending = '/' + STEREO_TOPICS.left_image
        found = [topic.removesuffix(ending).strip('/') for topic in self.topics
                 if topic.endswith(ending)]
        if not found:
            raise RecordingError(f'{self.path}: no topic ends with {ending}; it holds '
                                 f'{self._listing()}')
        if len(found) > 1:
            raise RecordingError(f'{self.path}: several stereo pairs, choose a namespace: '
                                 f'{", ".join("/" + name for name in sorted(found))}')
        return found[0]

    def _check_topic(self, topic, expected):
        if topic not in self.topics:
            raise RecordingError(f'{self.path}: no topic {topic}; it holds {self._listing()}')
        if self.topics[topic] != expected:
            raise RecordingError(f'{self.path}: {topic} is a {self.topics[topic]}, '
                                 f'expected {expected}')
        if not self.counts[topic]:
            raise RecordingError(f'{self.path}: {topic} has no messages')

    def _listing(self):
        return ', '.join(sorted(self.topics)) or 'no topic at all'

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


def _damage(error):
    """Return in one line, without Python's names, what `rosbags` found wrong with a file."""
    from rosbags.rosbag2 import ReaderError
    text = ' '.join(str(error).split())
    if field := re.search(r"KeyError\('(\w+)'\)", text):
        return f'metadata.yaml has no field {field.group(1)}'
    if 'Could not load YAML' in text:
        line = re.search(r'line (\d+)', text)
        return 'metadata.yaml is no YAML' + (f', see line {line.group(1)}' if line else '')
    if 'Invalid bag metadata' in text or isinstance(error, UnicodeDecodeError):
        return ('metadata.yaml' if 'metadata' in text else 'an entry') + ' has impossible contents'
    return text.rstrip('.') if isinstance(error, ReaderError) and text else 'it cannot be decoded'


def _is_latched(connection):
    profiles = connection.ext.offered_qos_profiles
    return any(profile.durability.name == 'TRANSIENT_LOCAL' for profile in profiles)
