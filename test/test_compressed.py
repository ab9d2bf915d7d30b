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
"""Compressed images in both directions, as the plugins of image_transport mean them."""

import struct

from color_stereo_ros.errors import ImageError
from color_stereo_ros.messages.compressing import compressed_depth, jpeg
from color_stereo_ros.messages.contents import CompressedImage
from color_stereo_ros.messages.decompressing import decompressed, look_at, opened
from color_stereo_ros.messages.reading import image_to_rgb, read_compressed_image
from color_stereo_ros.messages.synchronizer import Pair
from color_stereo_ros.recordings.types import serialized, typestore

import cv2
from known_results import HEADER, known_result, output
import numpy as np
import pytest


def decoded_depth(content):
    """Return a depth image by the formulas of compressed_depth_image_transport's decoder."""
    encoding, _, rest = content.format.partition(';')
    assert 'compressedDepth png' in rest
    data = bytes(content.data)
    kind, a, b = struct.unpack('<iff', data[:12])  # ConfigHeader
    assert kind == 0  # INV_DEPTH
    codes = cv2.imdecode(np.frombuffer(data[12:], np.uint8), cv2.IMREAD_UNCHANGED)
    assert codes.dtype == np.uint16
    if encoding == '16UC1':
        return codes
    with np.errstate(divide='ignore'):
        depth = np.float32(a) / (codes.astype(np.float32) - np.float32(b))
    return np.where(codes > 0, depth, np.float32(np.nan))


@pytest.mark.parametrize('nearest, farthest', [(0.2, 1.0), (0.001, 1000.0), (0.05, 0.06),
                                               (1.0, 20.0), (0.1, 0.5)])
def test_a_compressed_depth_is_right_to_half_a_code_within_the_limits(nearest, farthest):
    rng = np.random.default_rng(1)
    depth = (1 / rng.uniform(1 / farthest, 1 / nearest, (40, 50))).astype(np.float32)
    depth[0, :2] = nearest, farthest
    depth[3, :7] = np.nan
    content = compressed_depth(depth, '32FC1', HEADER, nearest, farthest)
    a = struct.unpack_from('<f', content.data, 4)[0]
    assert content.format == '32FC1; compressedDepth png' and content.header is HEADER
    assert a == pytest.approx(min(10100.0, 65534 / (1 / nearest - 1 / farthest)))
    found = decoded_depth(content)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(depth))
    known = np.isfinite(depth)
    bound = 0.51 * depth[known] ** 2 / a + 2e-6 * depth[known] * (1 + depth[known] * 65535 / a)
    assert (np.abs(found - depth)[known] <= bound).all()


def test_compressed_millimeters_are_exact():
    result = known_result()
    content = output('depth/image/compressedDepth', result, depth_encoding='16UC1')
    raw = output('depth/image', result, depth_encoding='16UC1')
    assert content.format == '16UC1; compressedDepth png'
    assert decoded_depth(content).tobytes() == bytes(raw.data)


def test_the_compressed_depth_topic_holds_the_depth():
    result = known_result()
    found = decoded_depth(output('depth/image/compressedDepth', result))
    np.testing.assert_array_equal(np.isnan(found), np.isnan(result.depth))
    np.testing.assert_allclose(found, result.depth, atol=2e-5)


def test_the_compressed_range_image_is_a_jpeg_of_it():
    result = known_result()
    content, raw = output('range_image/compressed', result), output('range_image', result)
    assert content.format == 'bgr8; jpeg compressed bgr8' and content.header == HEADER
    found = cv2.imdecode(np.frombuffer(content.data, np.uint8), cv2.IMREAD_UNCHANGED)
    expected = np.frombuffer(raw.data, np.uint8).reshape(found.shape)
    assert np.abs(found[12:].astype(int) - expected[12:]).mean() < 4


def test_a_jpeg_keeps_the_order_of_its_colors():
    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 0] = 200
    data = np.frombuffer(jpeg(red, HEADER).data, np.uint8)
    assert np.abs(cv2.imdecode(data, cv2.IMREAD_COLOR)[8, 8].astype(int) - (0, 0, 200)).max() < 9


def test_the_rectified_color_image_has_the_pixels_of_the_depth():
    result = known_result()
    content, depth = output('left/image_rect_color', result), output('depth/image', result)
    assert (content.encoding, content.height, content.width, content.step) == (
        'rgb8', depth.height, depth.width, 3 * depth.width)
    assert bytes(content.data) == result.image.tobytes()


# ---- the other direction

def picture(height=24, width=32):
    """Return a smooth RGB picture with three different channels."""
    v, u = np.mgrid[:height, :width]
    return np.stack([40 + 5 * u, 200 - 4 * v, 90 + 2 * v + u], axis=-1).clip(0, 255).astype(
        np.uint8)


def message(pixels, text, suffix='.png', *options):
    """Return a message with pixels as they are handed to OpenCV's encoder."""
    data = cv2.imencode(suffix, pixels, options)[1]
    return CompressedImage(HEADER, text, data.tobytes())


@pytest.mark.parametrize('text', ['bgr8; png compressed bgr8', 'rgb8; png compressed bgr8',
                                  'png', '', 'bgr8; png', 'rgba8; png compressed bgr8'])
def test_a_png_in_the_order_of_opencv_is_read(text):
    if text == 'bgr8; png':  # what is not said to be bgr was handed over as rgb
        found = decompressed(message(picture(), text))
    else:
        found = decompressed(message(picture()[..., ::-1], text))
    np.testing.assert_array_equal(image_to_rgb(found), picture())
    assert found.header is HEADER and (found.height, found.width) == (24, 32)


def test_colors_that_were_handed_over_as_rgb_are_read():
    found = decompressed(message(picture(), 'rgb8; png compressed '))
    np.testing.assert_array_equal(image_to_rgb(found), picture())


@pytest.mark.parametrize('text', ['bgr8; jpeg compressed bgr8', 'jpeg', 'rgb8; jpeg compressed '
                                  'bgr8'])
def test_a_jpeg_is_read(text):
    found = decompressed(message(picture()[..., ::-1], text, '.jpg',
                                 cv2.IMWRITE_JPEG_QUALITY, 100))
    assert np.abs(image_to_rgb(found).astype(int) - picture()).mean() < 2


@pytest.mark.parametrize('name', ['rggb', 'bggr', 'gbrg', 'grbg'])
@pytest.mark.parametrize('bits', [8, 16])
def test_a_mosaic_stays_a_mosaic(name, bits):
    mosaic = np.random.default_rng(2).integers(0, 1 << bits, (24, 32)).astype(f'u{bits // 8}')
    found = decompressed(message(mosaic, f'bayer_{name}{bits}; png compressed '))
    assert found.encoding == f'bayer_{name}{bits}'
    assert bytes(found.data) == mosaic.tobytes() and found.step == mosaic[0].nbytes


def test_a_mosaic_in_a_jpeg_is_kept_unless_it_was_made_gray():
    mosaic = np.full((24, 32), 77, np.uint8)
    old = message(mosaic, 'bayer_rggb8; jpeg compressed ', '.jpg')
    assert decompressed(old).encoding == 'bayer_rggb8'
    gray = message(mosaic, 'bayer_rggb8; jpeg compressed mono8', '.jpg')
    with pytest.raises(ImageError, match='gray JPEGs of bayer_rggb8 images, so the color is lost'):
        look_at(gray)


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
def test_a_gray_image_stays_gray(dtype):
    gray = (np.arange(24 * 32).reshape(24, 32) * 80 % 256).astype(dtype)
    found = decompressed(message(gray, 'mono; png compressed '))
    assert found.encoding == f'mono{8 * gray.itemsize}' and bytes(found.data) == gray.tobytes()


def test_colors_of_16_bits_are_read_by_their_high_byte():
    wide = picture()[..., ::-1].astype(np.uint16) * 256 + 99
    found = decompressed(message(wide, 'bgr16; png compressed bgr16'))
    np.testing.assert_array_equal(image_to_rgb(found), picture())


def test_an_alpha_channel_is_dropped():
    with_alpha = np.dstack([picture()[..., ::-1], np.full((24, 32), 9, np.uint8)])
    found = decompressed(message(with_alpha, 'bgra8; png compressed bgr8'))
    assert found.encoding == 'bgra8'
    np.testing.assert_array_equal(image_to_rgb(found), picture())


def with_exif(data, orientation):
    """Return a JPEG with an EXIF block that says how the camera was held."""
    tiff = b'MM\0*' + struct.pack('>IHHHIHHI', 8, 1, 0x112, 3, 1, orientation, 0, 0)
    block = b'Exif\0\0' + tiff
    return data[:2] + b'\xff\xe1' + struct.pack('>H', len(block) + 2) + block + data[2:]


def test_exif_does_not_turn_an_image():
    plain = message(picture()[..., ::-1], 'jpeg', '.jpg')
    turned = CompressedImage(HEADER, 'jpeg', with_exif(plain.data, 6))
    upright = cv2.imdecode(np.frombuffer(turned.data, np.uint8), cv2.IMREAD_COLOR)
    assert upright.shape == (32, 24, 3)  # OpenCV obeys the tag unless told otherwise
    assert bytes(decompressed(turned).data) == bytes(decompressed(plain).data)


SAMPLINGS = {'4:2:0': ('420', (2, 2)), '4:2:2': ('422', (2, 1)), '4:4:0': ('440', (1, 2)),
             '4:1:1': ('411', (4, 1)), '4:4:4': ('444', (1, 1))}


@pytest.mark.parametrize('name', SAMPLINGS)
def test_the_sampling_of_a_jpeg_is_read_from_its_frame_header(name):
    digits, factors = SAMPLINGS[name]
    flag = getattr(cv2, f'IMWRITE_JPEG_SAMPLING_FACTOR_{digits}')
    msg = message(picture(40, 56)[..., ::-1], 'jpeg', '.jpg', cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
                  flag)
    look = look_at(CompressedImage(HEADER, 'jpeg', with_exif(msg.data, 1)))
    assert (look.width, look.height, look.subsampling) == (56, 40, factors)
    if name == '4:4:4':
        assert look.doubt is None
    else:
        assert f'JPEG {name}: {factors[0]} x {factors[1]} px share one color' in look.doubt


def test_gray_jpegs_and_pngs_have_no_sampling():
    gray = message(picture()[..., 0], 'mono8; jpeg compressed mono8', '.jpg')
    assert look_at(gray).doubt is None
    look = look_at(message(picture(40, 56), 'png'))
    assert (look.width, look.height, look.doubt) == (56, 40, None)


def test_progressive_jpegs_are_looked_at():
    msg = message(picture(40, 56), 'jpeg', '.jpg', cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    assert (look_at(msg).width, look_at(msg).height) == (56, 40)


@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
def test_an_image_that_ends_too_early_is_refused(suffix):
    whole = message(picture(), 'x', suffix).data
    for length in range(0, len(whole) - 8, 7):
        with pytest.raises(ImageError):
            decompressed(CompressedImage(HEADER, 'x', whole[:length]))


def test_other_formats_are_refused_by_name():
    with pytest.raises(ImageError, match="format = 'bgr8; tiff compressed ': the bytes are nei"):
        look_at(message(picture(), 'bgr8; tiff compressed ', '.tiff'))


@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
def test_compressed_images_with_random_damage_are_read_or_refused(suffix, effort, figures):
    seeds = effort.seeds(200, 20000)
    whole, refused = message(picture(), 'bgr8; x compressed bgr8', suffix).data, 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        data = bytearray(whole)
        for _ in range(rng.integers(1, 8)):
            data[rng.integers(min(len(data), 200))] = rng.integers(256)
        try:
            found = decompressed(CompressedImage(HEADER, 'x', bytes(data)))
            assert image_to_rgb(found).shape == (found.height, found.width, 3)
        except ImageError:
            refused += 1
    figures(f'damaged {suffix} images refused', refused, 'images', over=seeds)


def test_a_pair_is_opened_and_errors_name_the_camera():
    left, right = message(picture()[..., ::-1], 'png'), message(picture()[..., ::-1], 'jpeg',
                                                                '.jpg')
    pair = Pair(left, right, 1, 0, 0.0)
    found = opened(pair)
    np.testing.assert_array_equal(image_to_rgb(found.left), picture())
    assert found.right.encoding == 'bgr8' and found.stamp == pair.stamp
    assert opened(found) is found
    alone = opened(Pair(left, None, 1, 0, 0.0))
    assert alone.right is None
    with pytest.raises(ImageError, match='^right image: '):
        opened(Pair(left, CompressedImage(HEADER, 'jpeg', b''), 1, 0, 0.0))


@pytest.mark.parametrize('text', ['jpeg', 'bgr8; jpeg compressed bgr8', ''])
def test_a_serialized_compressed_image_is_read_as_rosbags_reads_it(text):
    msg = message(picture(), text)
    data = bytes(serialized(CompressedImage(HEADER, text, np.frombuffer(msg.data, np.uint8))))
    found, known = read_compressed_image(data), typestore().deserialize_cdr(data, msg.TYPE)
    assert found.header == HEADER and found.format == known.format == text
    assert bytes(found.data) == bytes(known.data) == msg.data
    for length in (3, 12, 30, len(data) - 1):
        with pytest.raises(ImageError, match='damaged'):
            read_compressed_image(data[:length])
