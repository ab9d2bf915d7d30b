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
Messages to arrays: steps, byte order and serialized images.

Messages are read by their fields only, so that those of rclpy, of the `rosbags` library and plain
objects do alike.

"""

import struct

import cv2
import numpy as np

from .contents import CompressedImage, Header, Image, Time
from .encodings import complaint, conversion, MONO, PLAIN, READ
from ..errors import ImageError

_MIN_BAYER_SIZE = 3
MAX_SIDE = 32767
"""px: OpenCV's remap stores coordinates in 16 bits."""


def image_to_rgb(msg, significant_bits=16):
    """
    Return the image of a message as RGB.

    Parameters
    ----------
    msg : sensor_msgs.msg.Image
        Any of `encodings.READ`.
    significant_bits : int
        8 .. 16: of 16-bit Bayer and gray images, whose full scale is 2^significant_bits - 1. The
        highest 8 of these bits are used; larger values count as full scale.

    Returns
    -------
    rgb : numpy.ndarray, uint8, shape (H, W, 3)
        C-contiguous; gray images have three equal channels. Shares memory with the message if
        that is rgb8 without padding.

    Raises
    ------
    ImageError
        For an unknown encoding, a size of zero, a step too small, or data that
        are shorter or longer than height * step.

    """
    pixels, code = check_image(msg), conversion(msg.encoding)
    if msg.encoding in PLAIN:
        return np.ascontiguousarray(pixels) if code is None else cv2.cvtColor(pixels, code)
    if pixels.shape[2] == 2 and significant_bits < 16:
        shifted = _words(msg, pixels) >> (significant_bits - 8)
        return cv2.cvtColor(np.minimum(shifted, 255).astype(np.uint8), code)
    high_byte = pixels.shape[2] - 1 if not msg.is_bigendian else 0
    return cv2.cvtColor(np.ascontiguousarray(pixels[..., high_byte]), code)


def largest_value(msg):
    """Return the largest value of a 16-bit Bayer or gray image, 0 .. 65535; -1 for others."""
    pixels = check_image(msg)
    if msg.encoding in PLAIN or pixels.shape[2] != 2:
        return -1
    return int(_words(msg, pixels).max())


def _words(msg, pixels):
    """Return the values of the pixels of a 16-bit image, uint16 (H, W), without copying them."""
    return pixels.view('>u2' if msg.is_bigendian else '<u2')[..., 0]


def check_image(msg):
    """
    Return the bytes of an image message without copying them; cheap, it reads no pixel.

    Parameters
    ----------
    msg : sensor_msgs.msg.Image
        As it was received.

    Returns
    -------
    pixels : numpy.ndarray, uint8, shape (H, W, bytes per pixel)

    Raises
    ------
    ImageError
        Where `image_to_rgb` does.

    """
    if msg.encoding not in READ:
        raise ImageError(complaint(msg.encoding))
    if msg.encoding in PLAIN:
        return _pixels(msg, PLAIN[msg.encoding][0])
    pixels = _pixels(msg, 1 if msg.encoding.endswith('8') else 2)
    mosaic = msg.encoding.removesuffix('16').removesuffix('8') not in MONO
    if mosaic and min(msg.width, msg.height) < _MIN_BAYER_SIZE:
        raise ImageError(f'{msg.width} x {msg.height} px is too small for {msg.encoding}, '
                         f'expected at least {_MIN_BAYER_SIZE} x {_MIN_BAYER_SIZE} px')
    return pixels


_CDR_BYTE_ORDERS = {b'\x00\x00': '>', b'\x00\x01': '<'}


def read_image(data, otherwise=None):
    """
    Read a serialized sensor_msgs/Image without copying its pixels.

    Parameters
    ----------
    data : bytes
        CDR, as a raw subscription gets it.
    otherwise : callable, optional
        Called with bytes that are not CDR, which another middleware may send; returns an object
        with the fields of an Image.

    Returns
    -------
    image : Image
        The content of the message.

    Raises
    ------
    ImageError
        If the bytes are no image.

    """
    return _read(data, _read_cdr_image, Image, otherwise)


def read_compressed_image(data, otherwise=None):
    """Read a serialized sensor_msgs/CompressedImage; otherwise as `read_image`."""
    return _read(data, _read_cdr_compressed_image, CompressedImage, otherwise)


def _read(data, read, kind, otherwise):
    """Return the content in bytes, by read(data, byte order) where they are CDR."""
    order = _CDR_BYTE_ORDERS.get(data[:2])
    if order is None:
        return _read_otherwise(data, kind, otherwise)
    try:
        return read(data, order)
    except (struct.error, UnicodeDecodeError) as error:
        raise ImageError(f'the message is damaged: {error}') from error


def _read_otherwise(data, kind, read):
    """Return the content in bytes of a middleware whose format only its own library knows."""
    if read is None:
        raise ImageError(f'the message is damaged: it begins with the bytes {data[:4].hex(" ")}, '
                         'expected CDR')
    try:
        return kind.of(read(data))
    except Exception as error:  # the middleware decides what it raises
        raise ImageError(f'the message is damaged: {error}') from error


def _read_cdr_image(data, order):
    """Return the Image in CDR bytes; numbers are aligned to their size after the first four."""
    header, at = _read_cdr_header(data, order)
    at += -at % 4
    height, width = struct.unpack_from(f'{order}II', data, at)
    encoding, at = _read_cdr_text(data, at + 8, order)
    is_bigendian = data[at] if at < len(data) else 0
    at += 1
    at += -at % 4
    step, = struct.unpack_from(f'{order}I', data, at)
    return Image(header, height, width, encoding, is_bigendian, step,
                 _read_cdr_bytes(data, at + 4, order))


def _read_cdr_compressed_image(data, order):
    """Return the CompressedImage in CDR bytes."""
    header, at = _read_cdr_header(data, order)
    text, at = _read_cdr_text(data, at + -at % 4, order)
    return CompressedImage(header, text, _read_cdr_bytes(data, at + -at % 4, order))


def _read_cdr_header(data, order):
    """Return the Header that a message begins with, and the place behind it."""
    sec, nanosec = struct.unpack_from(f'{order}iI', data, 4)
    frame_id, at = _read_cdr_text(data, 12, order)
    return Header(Time(sec, nanosec), frame_id), at


def _read_cdr_bytes(data, at, order):
    """Return the bytes of a field `data`, which are not copied."""
    size, = struct.unpack_from(f'{order}I', data, at)
    if at + 4 + size > len(data):
        raise struct.error(f'{size} bytes of pixels are announced, {len(data) - at - 4} came')
    return memoryview(data)[at + 4:at + 4 + size]


def _read_cdr_text(data, at, order):
    """Return a text and the place behind it."""
    length, = struct.unpack_from(f'{order}I', data, at)
    return bytes(data[at + 4:at + 4 + length]).rstrip(b'\x00').decode(), at + 4 + length


def _pixels(msg, channels):
    """Return the bytes of the pixels without copying them, uint8 (H, W, channels)."""
    height, width, step = msg.height, msg.width, msg.step
    if height == 0 or width == 0:
        raise ImageError(f'the image is empty: width = {width} px, height = {height} px')
    if max(height, width) > MAX_SIDE:
        raise ImageError(f'the image is too large: width = {width} px, height = {height} px, '
                         f'expected at most {MAX_SIDE} px')
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
