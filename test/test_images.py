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
"""Image files: the pixels as the camera took them, whatever tags say; odd samples are named."""

import struct
import zlib

from color_stereo_ros.core import ImageError
from color_stereo_ros.files.image import read_image, read_image_as_is
import cv2
import numpy as np
import pytest

IMAGE = np.random.default_rng(2).integers(0, 256, (6, 9, 3), np.uint8)
ORIENTATION = 274


def exif(orientation, order='<'):
    """Return a TIFF header with one tag, the content of an EXIF block."""
    head = b'II*\0' if order == '<' else b'MM\0*'
    entry = struct.pack(f'{order}HHIHH', ORIENTATION, 3, 1, orientation, 0)
    return head + struct.pack(f'{order}IH', 8, 1) + entry + bytes(4)


def jpeg(image, orientation, order):
    data = cv2.imencode('.jpg', image)[1].tobytes()
    block = b'Exif\0\0' + exif(orientation, order)
    return data[:2] + b'\xff\xe1' + struct.pack('>H', len(block) + 2) + block + data[2:]


def png(image, orientation, order):
    data = cv2.imencode('.png', image)[1].tobytes()
    block = b'eXIf' + exif(orientation, order)
    chunk = struct.pack('>I', len(block) - 4) + block + struct.pack('>I', zlib.crc32(block))
    return data[:33] + chunk + data[33:]  # behind signature and IHDR


def tiff(image, orientation, order):
    """Return an uncompressed RGB TIFF of 8 or 16 bits."""
    height, width = image.shape[:2]
    samples = np.ascontiguousarray(image[..., ::-1]).astype(
        image.dtype.newbyteorder(order)).tobytes()
    bits = 8 * image.itemsize
    tags = [(256, 3, 1, width), (257, 3, 1, height), (258, 3, 3, None), (259, 3, 1, 1),
            (262, 3, 1, 2), (273, 4, 1, None), (ORIENTATION, 3, 1, orientation), (277, 3, 1, 3),
            (278, 3, 1, height), (279, 4, 1, len(samples)), (284, 3, 1, 1)]
    behind = 8 + 2 + 12 * len(tags) + 4
    places = {258: behind, 273: behind + 6}
    entries = b''
    for tag, kind, count, value in tags:
        number = places.get(tag, value)
        short = kind == 3 and count == 1
        entries += struct.pack(f'{order}HHI' + ('HH' if short else 'I'), tag, kind, count,
                               *((number, 0) if short else (number,)))
    head = b'II*\0' if order == '<' else b'MM\0*'
    return (head + struct.pack(f'{order}IH', 8, len(tags)) + entries + bytes(4)
            + struct.pack(f'{order}3H', bits, bits, bits) + samples)


@pytest.mark.parametrize('orientation', range(1, 9))
@pytest.mark.parametrize('order', ['<', '>'])
@pytest.mark.parametrize('encode', [jpeg, png, tiff])
def test_the_orientation_that_a_tag_says_is_ignored(tmp_path, encode, order, orientation):
    path = tmp_path / 'tagged'
    path.write_bytes(encode(IMAGE, 1, order))
    plain = read_image(path), read_image_as_is(path), read_image_as_is(path, cv2.IMREAD_COLOR)
    path.write_bytes(encode(IMAGE, orientation, order))
    tagged = read_image(path), read_image_as_is(path), read_image_as_is(path, cv2.IMREAD_COLOR)
    for expected, found in zip(plain, tagged):
        np.testing.assert_array_equal(found, expected)
    if encode is not jpeg:
        np.testing.assert_array_equal(plain[0], IMAGE[..., ::-1])


def test_the_orientation_of_a_big_tiff_is_ignored(tmp_path):
    path = tmp_path / 'big.tiff'
    classic = tiff(IMAGE, 3, '<')
    samples = IMAGE[..., ::-1].tobytes()
    count, = struct.unpack_from('<H', classic, 8)
    entries = [classic[10 + 12 * i:22 + 12 * i] for i in range(count)]
    place = 16 + 8 + 20 * count + 8
    big = b'II+\0' + struct.pack('<HHQQ', 8, 0, 16, count)
    for entry in entries:
        tag, kind, number = struct.unpack_from('<HHI', entry)
        value = entry[8:] + bytes(4)
        if tag == 258:
            value = struct.pack('<4H', 8, 8, 8, 0)
        if tag == 273:
            value = struct.pack('<Q', place)
        big += struct.pack('<HHQ', tag, kind, number) + value
    path.write_bytes(big + bytes(8) + samples)
    np.testing.assert_array_equal(read_image(path), IMAGE[..., ::-1])


def test_of_16_bits_the_upper_8_count(tmp_path):
    path = tmp_path / 'deep'
    deep = IMAGE.astype(np.uint16) << 8 | 0x80
    for data in (cv2.imencode('.png', deep)[1].tobytes(), tiff(deep, 6, '<'), tiff(deep, 6, '>')):
        path.write_bytes(data)
        np.testing.assert_array_equal(read_image(path), IMAGE[..., ::-1])


@pytest.mark.parametrize('suffix, dtype, words', [
    ('.tiff', np.float32, '32-bit float'), ('.tiff', np.float64, '64-bit float'),
    ('.tiff', np.int32, '32-bit signed integer'), ('.hdr', np.float32, '32-bit float'),
    ('.pfm', np.float32, '32-bit float')])
@pytest.mark.parametrize('channels', [1, 3])
def test_other_samples_than_8_and_16_bits_are_named(tmp_path, capfd, suffix, dtype, words,
                                                    channels):
    path = tmp_path / f'odd{suffix}'
    cv2.imwrite(str(path), (IMAGE[..., :channels] / 255).astype(dtype))
    capfd.readouterr()
    with pytest.raises(ImageError, match=f'odd{suffix}: {words}: 8 or 16 bits are expected'):
        read_image(path)
    assert capfd.readouterr().err == ''
