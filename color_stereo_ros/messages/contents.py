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
What a message holds, as plain data whose field names are those of the ROS message.

A content is built once and serialized by whoever sends it: `nodes.filling` makes a message of
rclpy, `recordings.types` the bytes of a recording. Numbers are Python's own, lists are tuples.
Long fields are arrays that are not copied.

"""

from array import array
from dataclasses import dataclass

import numpy as np

from .encodings import WRITTEN
from ..errors import ImageError


@dataclass(frozen=True)
class Time:
    """A moment."""

    TYPE = 'builtin_interfaces/msg/Time'

    sec: int = 0
    nanosec: int = 0


@dataclass(frozen=True)
class Header:
    """Stamp and frame."""

    TYPE = 'std_msgs/msg/Header'

    stamp: Time = Time()
    frame_id: str = ''

    @classmethod
    def of(cls, header):
        """Return the Header with the values of any object that has the same fields."""
        return cls(Time(header.stamp.sec, header.stamp.nanosec), header.frame_id)

    @classmethod
    def at(cls, time_ns, frame_id):
        """Return the Header of a moment in ns."""
        return cls(Time(*divmod(int(time_ns), 1_000_000_000)), frame_id)


@dataclass(frozen=True)
class RegionOfInterest:
    """A part of an image."""

    TYPE = 'sensor_msgs/msg/RegionOfInterest'

    x_offset: int = 0
    y_offset: int = 0
    height: int = 0
    width: int = 0
    do_rectify: bool = False


@dataclass(frozen=True, eq=False)
class Image:
    """An image."""

    TYPE = 'sensor_msgs/msg/Image'

    header: Header
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: object
    """Bytes, height * step of them: uint8 array, `array`, memoryview."""

    @classmethod
    def of(cls, msg):
        """Return the Image that shares the pixels of any object with the same fields."""
        return cls(Header.of(msg.header), msg.height, msg.width, msg.encoding, msg.is_bigendian,
                   msg.step, msg.data)


@dataclass(frozen=True, eq=False)
class CameraInfo:
    """The calibration of a camera."""

    TYPE = 'sensor_msgs/msg/CameraInfo'

    header: Header
    height: int
    width: int
    distortion_model: str
    d: np.ndarray
    """float64 (n,)."""
    k: np.ndarray
    """float64 (9,)."""
    r: np.ndarray
    """float64 (9,)."""
    p: np.ndarray
    """float64 (12,)."""
    binning_x: int = 0
    binning_y: int = 0
    roi: RegionOfInterest = RegionOfInterest()


@dataclass(frozen=True)
class PointField:
    """One number of each point."""

    TYPE = 'sensor_msgs/msg/PointField'

    FLOAT32 = 7

    name: str
    offset: int
    datatype: int = FLOAT32
    count: int = 1


@dataclass(frozen=True, eq=False)
class PointCloud2:
    """Points."""

    TYPE = 'sensor_msgs/msg/PointCloud2'

    header: Header
    height: int
    width: int
    fields: tuple
    """Of PointField."""
    is_bigendian: bool
    point_step: int
    row_step: int
    data: object
    """Bytes, as of an Image."""
    is_dense: bool


@dataclass(frozen=True, eq=False)
class DisparityImage:
    """Disparities whose depth is f t / d."""

    TYPE = 'stereo_msgs/msg/DisparityImage'

    header: Header
    image: Image
    f: float
    t: float
    valid_window: RegionOfInterest
    min_disparity: float
    max_disparity: float
    delta_d: float


@dataclass(frozen=True, eq=False)
class CompressedImage:
    """An image as the bytes of an image file."""

    TYPE = 'sensor_msgs/msg/CompressedImage'

    header: Header
    format: str  # noqa: A003
    """What the bytes are, in the words of image_transport."""
    data: object
    """Bytes, as of an Image."""

    @classmethod
    def of(cls, msg):
        """Return the CompressedImage that shares the bytes of any object with the same fields."""
        return cls(Header.of(msg.header), msg.format, msg.data)


@dataclass(frozen=True)
class Vector3:
    """A vector."""

    TYPE = 'geometry_msgs/msg/Vector3'

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass(frozen=True)
class Quaternion:
    """A rotation."""

    TYPE = 'geometry_msgs/msg/Quaternion'

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


@dataclass(frozen=True)
class Transform:
    """A rotation, and a translation after it."""

    TYPE = 'geometry_msgs/msg/Transform'

    translation: Vector3 = Vector3()
    rotation: Quaternion = Quaternion()


@dataclass(frozen=True)
class TransformStamped:
    """The pose of a frame in that of the header."""

    TYPE = 'geometry_msgs/msg/TransformStamped'

    header: Header
    child_frame_id: str
    transform: Transform


@dataclass(frozen=True)
class TFMessage:
    """Poses of frames."""

    TYPE = 'tf2_msgs/msg/TFMessage'

    transforms: tuple
    """Of TransformStamped."""


@dataclass(frozen=True)
class KeyValue:
    """A named value as text."""

    TYPE = 'diagnostic_msgs/msg/KeyValue'

    key: str
    value: str


@dataclass(frozen=True)
class DiagnosticStatus:
    """The state of one part of a robot."""

    TYPE = 'diagnostic_msgs/msg/DiagnosticStatus'

    level: int
    """0 = OK, 1 = WARN, 2 = ERROR, 3 = STALE."""
    name: str
    message: str
    hardware_id: str
    values: tuple
    """Of KeyValue."""


@dataclass(frozen=True)
class DiagnosticArray:
    """The state of a robot."""

    TYPE = 'diagnostic_msgs/msg/DiagnosticArray'

    header: Header
    status: tuple
    """Of DiagnosticStatus."""


def new_memory(size):
    """Return bytes for the field `data` of a content; the size is their number."""
    return array('B', bytes(size))


def image(pixels, encoding, header):
    """
    Return the content of an image message.

    Parameters
    ----------
    pixels : numpy.ndarray, shape (H, W) or (H, W, 3)
        Of the type that the encoding says. The content shares their memory.
    encoding : str
        One of `encodings.WRITTEN`.
    header : Header
        Stamp and frame of the message.

    Returns
    -------
    content : Image

    Raises
    ------
    ImageError
        If type or shape of the pixels do not fit the encoding.

    """
    dtype, channels = WRITTEN[encoding]
    shape = pixels.shape[:2] if channels == 1 else (*pixels.shape[:2], channels)
    if pixels.dtype != dtype or pixels.shape != shape:
        raise ImageError(
            f'an image of type {pixels.dtype} and shape {pixels.shape} is no {encoding}')
    data = np.ascontiguousarray(pixels).reshape(-1).view(np.uint8)
    return Image(header, shape[0], shape[1], encoding, 0,
                 shape[1] * channels * pixels.itemsize, data)


def camera_info(camera, header):
    """
    Return the content of the camera_info of a raw image.

    Parameters
    ----------
    camera : CameraModel
        One camera of the pair.
    header : Header
        Stamp and frame of the message.

    Returns
    -------
    content : CameraInfo

    """
    return CameraInfo(header, camera.height, camera.width, camera.distortion_model,
                      *(getattr(camera, name).ravel() for name in 'DKRP'))
