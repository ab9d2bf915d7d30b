# SPDX-License-Identifier: Apache-2.0
"""
Read and write recordings: rosbag2 folders with one MCAP file, without ROS.

Needs the library `rosbags` (extra [tools]). Every failure is a RecordingError that names the
recording and what is wrong with it; a recording appears under its name only when it is whole.

"""

from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import re

import numpy as np

from ..errors import RecordingError
from ..files.atomic import folder_written_whole

IMAGE = 'sensor_msgs/msg/Image'
CAMERA_INFO = 'sensor_msgs/msg/CameraInfo'


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
        for topic, expected in zip(found.names, (IMAGE, IMAGE, CAMERA_INFO, CAMERA_INFO)):
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


def typestore():
    """Return the message types of ROS 2 Jazzy."""
    from rosbags.typesys import Stores, get_typestore
    return get_typestore(Stores.ROS2_JAZZY)


@contextmanager
def write_recording(path, *, overwrite=False):
    """
    Write a recording that appears only when it is complete.

    Parameters
    ----------
    path : str or Path
        The folder to make.
    overwrite : bool
        Replace a recording that is there.

    Yields
    ------
    writer : RecordingWriter

    Raises
    ------
    RecordingError
        If the path exists and may not be overwritten.

    """
    path = Path(path)
    check_writable(path, overwrite)
    # The unfinished folder has the final name: the file in it is named after it.
    with folder_written_whole(path, replace=overwrite) as unfinished:
        with _open_writer(unfinished) as writer:
            yield RecordingWriter(writer)


def check_writable(path, overwrite):
    """Raise RecordingError unless a recording may be written to a path."""
    path = Path(path)
    if not path.exists():
        return
    if not overwrite:
        raise RecordingError(f'{path}: exists already; --overwrite replaces it')
    if not (path / 'metadata.yaml').exists():
        raise RecordingError(f'{path}: is no recording, so it is not overwritten')


@contextmanager
def _open_writer(path):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    writer = Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
    # STORAGE = compressed chunks inside the MCAP file, which every reader of MCAP knows.
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        yield writer


class RecordingWriter:
    """Appends messages to a recording; made by `write_recording`."""

    def __init__(self, writer):
        self._writer = writer
        self._types = typestore()
        self._connections = {}

    def write(self, topic, type_name, time_ns, data, *, latched=False):
        """
        Append a serialized message.

        Parameters
        ----------
        topic : str
        type_name : str
            For example sensor_msgs/msg/Image.
        time_ns : int
        data : bytes
            CDR.
        latched : bool
            The topic is transient local: who comes late gets its last message.

        """
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, type_name, typestore=self._types,
                offered_qos_profiles=[_quality_of_service(latched)])
        self._writer.write(self._connections[topic], time_ns, data)

    def write_pair(self, time_ns, left, right, calibration, *, namespace=''):
        """
        Append a pair of raw images and the two CameraInfo.

        Parameters
        ----------
        time_ns : int
            Stamp of all four messages.
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            RGB.
        calibration : StereoCalibration
        namespace : str
            Goes before `left/image_raw` and the others.

        """
        prefix = f'/{namespace.strip("/")}/' if namespace.strip('/') else '/'
        sides = (('left', left, calibration.left), ('right', right, calibration.right))
        for side, image, camera in sides:
            header = self._header(time_ns, f'{side}_camera_optical_frame')
            self._append(f'{prefix}{side}/camera_info', time_ns, self._camera_info(header, camera))
            self._append(f'{prefix}{side}/image_raw', time_ns, self._image(header, image))

    def write_pattern(self, time_ns, pattern, *, namespace=''):
        """Append what the projector shows, uint8 (H, W, 3) RGB, as `pattern/image`, latched."""
        prefix = f'/{namespace.strip("/")}/' if namespace.strip('/') else '/'
        header = self._header(time_ns, 'projector_optical_frame')
        self._append(f'{prefix}pattern/image', time_ns, self._image(header, pattern), latched=True)

    def _append(self, topic, time_ns, message, *, latched=False):
        type_name = message.__msgtype__
        self.write(topic, type_name, time_ns,
                   self._types.serialize_cdr(message, type_name), latched=latched)

    def _header(self, time_ns, frame_id):
        seconds, nanoseconds = divmod(int(time_ns), 1_000_000_000)
        stamp = self._types.types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds)
        return self._types.types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame_id)

    def _image(self, header, rgb):
        height, width = rgb.shape[:2]
        return self._types.types[IMAGE](
            header=header, height=height, width=width, encoding='rgb8', is_bigendian=0,
            step=3 * width, data=np.ascontiguousarray(rgb).reshape(-1))

    def _camera_info(self, header, camera):
        region = self._types.types['sensor_msgs/msg/RegionOfInterest'](
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        return self._types.types[CAMERA_INFO](
            header=header, height=camera.height, width=camera.width,
            distortion_model=camera.distortion_model, d=np.array(camera.D),
            k=np.array(camera.K).ravel(), r=np.array(camera.R).ravel(),
            p=np.array(camera.P).ravel(), binning_x=0, binning_y=0, roi=region)


def _quality_of_service(latched):
    """Return reliable, keep last; transient local for a latched topic."""
    from rosbags.interfaces import (Qos, QosDurability, QosHistory, QosLiveliness, QosReliability,
                                    QosTime)
    forever = QosTime(sec=9223372036, nsec=854775807)
    return Qos(
        history=QosHistory.KEEP_LAST, depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=forever, lifespan=forever, liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=forever, avoid_ros_namespace_conventions=False)
