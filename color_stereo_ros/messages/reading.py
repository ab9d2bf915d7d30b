# SPDX-License-Identifier: Apache-2.0
"""
Messages to arrays and back: the only place that knows encodings, steps, byte order, PointField.

Reading is duck-typed, so that messages of the `rosbags` library are read without ROS; only the
builders import message classes, when they are called. A builder refills the message that it is
given: its byte array is reused while the size stays the same, and `publish` copies it anyway.

"""

from array import array
from dataclasses import dataclass
import struct

import cv2
import numpy as np

from ..core.triangulation import rays
from ..errors import ImageError
from .cloud_kernels import fill_points

_PLAIN = {'rgb8': (3, None), 'bgr8': (3, cv2.COLOR_BGR2RGB),
          'rgba8': (4, cv2.COLOR_RGBA2RGB), 'bgra8': (4, cv2.COLOR_BGRA2RGB)}
# ROS names the first two pixels of rows 0 and 1. OpenCV's older two-letter names start at pixel
# (1, 1) instead (its BayerBG is rggb); these four-letter names mean the same as in ROS.
_BAYER = {'bayer_rggb': cv2.COLOR_BayerRGGB2RGB, 'bayer_bggr': cv2.COLOR_BayerBGGR2RGB,
          'bayer_gbrg': cv2.COLOR_BayerGBRG2RGB, 'bayer_grbg': cv2.COLOR_BayerGRBG2RGB}
ENCODINGS = (*_PLAIN, *(name + bits for bits in ('8', '16') for name in _BAYER))
"""The encodings that `image_to_rgb` reads."""

_COLORLESS = ('mono8', 'mono16', '8UC1', '16UC1', '32FC1', '64FC1')
_MIN_BAYER_SIZE = 3
_MAX_SIDE = 32767  # OpenCV's remap stores coordinates in 16 bits


def image_to_rgb(msg):
    """
    Return the image of a message as RGB.

    Parameters
    ----------
    msg : sensor_msgs.msg.Image
        Any of `ENCODINGS`. Of 16-bit Bayer images (full scale 65535) the high byte is used.

    Returns
    -------
    rgb : numpy.ndarray, uint8, shape (H, W, 3)
        C-contiguous; shares memory with the message if that is rgb8 without padding.

    Raises
    ------
    ImageError
        For an encoding without color or unknown, a size of zero, a step too small, or data that
        are shorter or longer than height * step.

    """
    pixels = check_image(msg)
    if msg.encoding in _PLAIN:
        code = _PLAIN[msg.encoding][1]
        return np.ascontiguousarray(pixels) if code is None else cv2.cvtColor(pixels, code)
    high_byte = pixels.shape[2] - 1 if not msg.is_bigendian else 0
    mosaic = np.ascontiguousarray(pixels[..., high_byte])
    return cv2.cvtColor(mosaic, _BAYER[_bayer_name(msg.encoding)])


def check_image(msg):
    """
    Return the bytes of an image message without copying them; cheap, it reads no pixel.

    Parameters
    ----------
    msg : sensor_msgs.msg.Image

    Returns
    -------
    pixels : numpy.ndarray, uint8, shape (H, W, bytes per pixel)

    Raises
    ------
    ImageError
        Where `image_to_rgb` does.

    """
    if msg.encoding not in ENCODINGS:
        raise ImageError(_encoding_complaint(msg.encoding))
    if msg.encoding in _PLAIN:
        return _pixels(msg, _PLAIN[msg.encoding][0])
    pixels = _pixels(msg, 1 if msg.encoding.endswith('8') else 2)
    if min(msg.width, msg.height) < _MIN_BAYER_SIZE:
        raise ImageError(f'{msg.width} x {msg.height} px is too small for {msg.encoding}, '
                         f'expected at least {_MIN_BAYER_SIZE} x {_MIN_BAYER_SIZE} px')
    return pixels


@dataclass(frozen=True, eq=False)
class RawImage:
    """A sensor_msgs/Image whose pixels still lie in the bytes that came."""

    header: object
    """std_msgs.msg.Header."""
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: memoryview


_CDR_BYTE_ORDERS = {b'\x00\x00': '>', b'\x00\x01': '<'}


def read_image(data):
    """
    Read a serialized sensor_msgs/Image without copying its pixels.

    Parameters
    ----------
    data : bytes
        CDR, as a raw subscription gets it. What another middleware may send is given to rclpy.

    Returns
    -------
    image : RawImage or sensor_msgs.msg.Image

    Raises
    ------
    ImageError
        If the bytes are no image.

    """
    order = _CDR_BYTE_ORDERS.get(data[:2])
    if order is None:
        return _deserialized_image(data)
    try:
        return _read_cdr_image(data, order)
    except (struct.error, UnicodeDecodeError) as error:
        raise ImageError(f'the message is damaged: {error}') from error


def _deserialized_image(data):
    """Return the Image in bytes of a middleware whose format only rclpy knows."""
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import Image
    try:
        return deserialize_message(data, Image)
    except Exception as error:  # the middleware decides what it raises
        raise ImageError(f'the message is damaged: {error}') from error


def _read_cdr_image(data, order):
    """Return the RawImage in CDR bytes; numbers are aligned to their size after the first four."""
    from std_msgs.msg import Header
    header = Header()
    header.stamp.sec, header.stamp.nanosec = struct.unpack_from(f'{order}iI', data, 4)
    header.frame_id, at = _read_cdr_text(data, 12, order)
    at += -at % 4
    height, width = struct.unpack_from(f'{order}II', data, at)
    encoding, at = _read_cdr_text(data, at + 8, order)
    is_bigendian = data[at] if at < len(data) else 0
    at += 1
    at += -at % 4
    step, size = struct.unpack_from(f'{order}II', data, at)
    if at + 8 + size > len(data):
        raise struct.error(f'{size} bytes of pixels are announced, {len(data) - at - 8} came')
    return RawImage(header, height, width, encoding, is_bigendian, step,
                    memoryview(data)[at + 8:at + 8 + size])


def _read_cdr_text(data, at, order):
    """Return a text and the place behind it."""
    length, = struct.unpack_from(f'{order}I', data, at)
    return bytes(data[at + 4:at + 4 + length]).rstrip(b'\x00').decode(), at + 4 + length


def _bayer_name(encoding):
    return encoding.removesuffix('16').removesuffix('8')


def _encoding_complaint(encoding):
    if encoding in _COLORLESS:
        reason = 'has no color, but the pattern is told apart by its color'
    elif encoding in ('8UC3', '8UC4'):
        reason = 'does not tell the order of its channels'
    elif encoding == '':
        reason = 'is empty'
    else:
        reason = 'is not supported'
    return f'encoding = {encoding!r} {reason}; expected one of {", ".join(ENCODINGS)}'


def _pixels(msg, channels):
    """Return the bytes of the pixels without copying them, uint8 (H, W, channels)."""
    height, width, step = msg.height, msg.width, msg.step
    if height == 0 or width == 0:
        raise ImageError(f'the image is empty: width = {width} px, height = {height} px')
    if max(height, width) > _MAX_SIDE:
        raise ImageError(f'the image is too large: width = {width} px, height = {height} px, '
                         f'expected at most {_MAX_SIDE} px')
    if step < width * channels:
        raise ImageError(f'step = {step} bytes is too small for width = {width} px of '
                         f'{msg.encoding}, expected at least {width * channels} bytes')
    data = np.frombuffer(msg.data, np.uint8)
    if data.size != height * step:
        kind = 'truncated' if data.size < height * step else 'too long'
        raise ImageError(f'data is {kind}: {data.size} bytes, expected height * step = '
                         f'{height} * {step} = {height * step} bytes')
    return np.ndarray((height, width, channels), np.uint8, data, strides=(step, channels, 1))


def stamp_ns(header):
    """Return the stamp of a header in ns."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


_CHANNELS = {'rgb8': (np.uint8, 3), 'bgr8': (np.uint8, 3), 'mono8': (np.uint8, 1),
             '16UC1': (np.uint16, 1), '32FC1': (np.float32, 1)}


def image_message(image, encoding, header, message=None):
    """
    Return an image message.

    Parameters
    ----------
    image : numpy.ndarray, shape (H, W) or (H, W, 3)
        Of the type that the encoding says.
    encoding : str
        rgb8, bgr8, mono8, 16UC1 or 32FC1.
    header : std_msgs.msg.Header
    message : sensor_msgs.msg.Image, optional
        A message to refill.

    Returns
    -------
    message : sensor_msgs.msg.Image

    Raises
    ------
    ImageError
        If type or shape of the image do not fit the encoding.

    """
    from sensor_msgs.msg import Image
    dtype, channels = _CHANNELS[encoding]
    shape = image.shape[:2] if channels == 1 else (*image.shape[:2], channels)
    if image.dtype != dtype or image.shape != shape:
        raise ImageError(
            f'an image of type {image.dtype} and shape {image.shape} is no {encoding}')
    message = message or Image()
    message.header = header
    message.height, message.width = shape[:2]
    message.encoding = encoding
    message.is_bigendian = 0
    message.step = shape[1] * channels * np.dtype(dtype).itemsize
    np.copyto(_view(message, shape, dtype), image)
    return message


def _view(message, shape, dtype):
    """Return an array over the bytes of a message, which are replaced if their number differs."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    if len(message.data) != size:
        # array.array is the one type that rclpy assigns fast with and without its field checks
        message.data = array('B', bytes(size))
    return np.frombuffer(message.data, dtype).reshape(shape)


def millimeters(depth):
    """Return depth (m, NaN = unknown) as uint16 mm, 0 = unknown or beyond 65.535 m (REP 118)."""
    scaled = np.rint(np.nan_to_num(depth, nan=0.0) * np.float32(1000.0))
    scaled[scaled > 65535.0] = 0.0
    return scaled.astype(np.uint16)


def camera_info_message(geometry, header):
    """
    Return the rectified left camera as a sensor_msgs/CameraInfo.

    The images that go with it are rectified: D = 0, R = I, and K is the left part of P.

    """
    from sensor_msgs.msg import CameraInfo
    fx, fy = geometry.focal_x, geometry.focal_y
    cx, cy = geometry.center_x_left, geometry.center_y
    return CameraInfo(
        header=header, width=geometry.width, height=geometry.height,
        distortion_model='plumb_bob', d=[0.0] * 5,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])


POINT_STEP = 16
"""Bytes of a point: x, y, z (float32, m) and rgb (0x00RRGGBB)."""


def cloud_message(result, header, *, compact=False, rotation=None, message=None):
    """
    Return the points of a result as a sensor_msgs/PointCloud2.

    Parameters
    ----------
    result : RangeResult
    header : std_msgs.msg.Header
    compact : bool
        False: organized H x W, NaN = unknown. True: one row of the known points only.
    rotation : numpy.ndarray, shape (3, 3), optional
        Turns the points from the rectified left camera into another frame.
    message : sensor_msgs.msg.PointCloud2, optional
        A message to refill.

    Returns
    -------
    message : sensor_msgs.msg.PointCloud2
        Fields x y z rgb; rgb as rviz and PCL read it, the bytes B, G, R, 0.

    """
    from sensor_msgs.msg import PointCloud2
    message = message or PointCloud2()
    if not message.fields:
        message.fields = _point_fields()
    message.header = header
    message.is_bigendian = False
    message.point_step = POINT_STEP
    message.is_dense = compact
    known = np.isfinite(result.depth) if compact else None
    rows, columns = (1, int(np.count_nonzero(known))) if compact else result.depth.shape
    message.height, message.width = rows, columns
    message.row_step = POINT_STEP * columns
    view = _view(message, (rows, columns, 4), np.float32)
    if compact:
        records = np.empty((*result.depth.shape, 4), np.float32)
        _fill_points(records, result, rotation)
        # complex128 has the 16 bytes of a point: they are picked as one
        view.view(np.complex128)[0, :, 0] = records.view(np.complex128)[..., 0][known]
    else:
        _fill_points(view, result, rotation)
    return message


def _point_fields():
    from sensor_msgs.msg import PointField
    return [PointField(name=name, offset=4 * index, datatype=PointField.FLOAT32, count=1)
            for index, name in enumerate(('x', 'y', 'z', 'rgb'))]


def _fill_points(records, result, rotation):
    """Write x, y, z and the bits of the color into float32 (H, W, 4)."""
    fill_points(result.depth, result.image, *rays(result.geometry), records)
    if rotation is not None:
        points = np.ascontiguousarray(records[..., :3])
        records[..., :3] = cv2.transform(points, rotation.astype(np.float32))


def disparity_message(result, header, message=None):
    """
    Return the disparities of a result as a stereo_msgs/DisparityImage.

    Its convention is Z = f t / d, so cx_left - cx_right is taken from the pixels and from the
    limits alike; unknown pixels lie 1 px below `min_disparity`.

    Parameters
    ----------
    result : RangeResult
    header : std_msgs.msg.Header
    message : stereo_msgs.msg.DisparityImage, optional
        A message to refill.

    Returns
    -------
    message : stereo_msgs.msg.DisparityImage

    """
    from stereo_msgs.msg import DisparityImage
    message = message or DisparityImage()
    geometry, offset = result.geometry, result.geometry.principal_offset
    lowest, highest = result.disparity_limits
    message.header = header
    message.f, message.t = float(geometry.focal_x), float(geometry.baseline)
    message.min_disparity = float(lowest - offset)
    message.max_disparity = float(highest - offset)
    message.delta_d = _disparity_step(result)
    _fill_valid_window(message.valid_window, result)
    shifted = result.disparity - np.float32(offset)
    # the limits are rounded to float32 by the message: keep the last ulp of a match inside them
    np.clip(shifted, np.float32(message.min_disparity), np.float32(message.max_disparity),
            out=shifted)
    shifted[np.isnan(shifted)] = np.float32(message.min_disparity - 1.0)
    image_message(shifted, '32FC1', header, message.image)
    return message


def _disparity_step(result):
    """Return the smallest step that the disparities resolve: their median deviation, px."""
    known = result.disparity_std[::4, ::4]
    known = known[np.isfinite(known)]
    return float(np.median(known)) if known.size else 1.0


def _fill_valid_window(window, result):
    """Set the columns whose partner can lie inside the right image: 0 <= x - d <= width - 1."""
    width, height = result.geometry.width, result.geometry.height
    lowest, highest = result.disparity_limits
    first = int(np.clip(np.floor(lowest), 0, width))
    beyond = int(np.clip(np.ceil(width + highest), first, width))
    window.x_offset, window.width = first, beyond - first
    window.y_offset, window.height = 0, height
    window.do_rectify = False
