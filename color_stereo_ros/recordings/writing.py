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
Write recordings: rosbag2 folders with one MCAP file, without ROS.

Needs the library `rosbags` (extra [tools]). A recording appears under its name only when it is
whole.

"""

from contextlib import contextmanager
from pathlib import Path

from .mcap_writing import ChunkWriter
from .types import serialized_parts, typestore
from ..errors import RecordingError
from ..files.atomic import folder_written_whole
from ..messages.contents import camera_info, Header, image


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
        with open_writer(unfinished) as writer:
            yield writer


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
def open_writer(path, compression='small'):
    """
    Write a recording under a name that nobody else uses.

    Parameters
    ----------
    path : Path
        The folder, which is made; its file has the same name.
    compression : str
        One of `mcap_writing.COMPRESSIONS`.

    Yields
    ------
    writer : RecordingWriter

    """
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    writer = Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
    # STORAGE = compressed chunks inside the MCAP file, which every reader of MCAP knows.
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        writer.storage = ChunkWriter(writer.storage, compression)
        yield RecordingWriter(writer)


class RecordingWriter:
    """
    Appends messages to a recording; made by `open_writer`.

    Parameters
    ----------
    writer : rosbags.rosbag2.Writer
        Is open; its storage takes messages in parts, as ChunkWriter does.

    """

    def __init__(self, writer):
        self._writer = writer
        self._connections = {}

    def write(self, topic, type_name, time_ns, *parts, latched=False):
        """
        Append a serialized message.

        Parameters
        ----------
        topic : str
            Its name in the recording.
        type_name : str
            For example sensor_msgs/msg/Image.
        time_ns : int
            When it was recorded, ns.
        parts : bytes-like
            CDR; they are joined.
        latched : bool
            The topic is transient local: who comes late gets its last message.

        """
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, type_name, typestore=typestore(),
                offered_qos_profiles=[_quality_of_service(latched)])
        self._writer.write(self._connections[topic], time_ns, parts)

    def write_content(self, topic, time_ns, content, *, latched=False):
        """
        Append a message.

        Parameters
        ----------
        topic : str
            Its name in the recording.
        time_ns : int
            When it was recorded, ns.
        content : object
            One of `messages.contents`.
        latched : bool
            As for `write`.

        """
        self.write(topic, content.TYPE, time_ns, *serialized_parts(content), latched=latched)

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
            Of the two cameras.
        namespace : str
            Goes before `left/image_raw` and the others.

        """
        prefix = _prefix(namespace)
        sides = (('left', left, calibration.left), ('right', right, calibration.right))
        for side, pixels, camera in sides:
            header = Header.at(time_ns, f'{side}_camera_optical_frame')
            self.write_content(f'{prefix}{side}/camera_info', time_ns, camera_info(camera, header))
            self.write_content(f'{prefix}{side}/image_raw', time_ns, image(pixels, 'rgb8', header))

    def write_pattern(self, time_ns, pattern, *, namespace=''):
        """Append what the projector shows, uint8 (H, W, 3) RGB, as `pattern/image`, latched."""
        header = Header.at(time_ns, 'projector_optical_frame')
        self.write_content(f'{_prefix(namespace)}pattern/image', time_ns,
                           image(pattern, 'rgb8', header), latched=True)


def _prefix(namespace):
    """Return what goes before the topics of a namespace."""
    return f'/{namespace.strip("/")}/' if namespace.strip('/') else '/'


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
