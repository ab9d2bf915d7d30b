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
"""Messages to arrays and results to contents, bit for bit, without ROS."""

import dataclasses
from random import Random
import struct

from color_stereo_ros.errors import ImageError
from color_stereo_ros.messages import contents, reading
from color_stereo_ros.messages.cloud import cloud
from color_stereo_ros.messages.contents import Header
from color_stereo_ros.messages.disparity import disparity
from color_stereo_ros.messages.outputs import millimeters, Output, OUTPUTS
from color_stereo_ros.messages.significant_bits import SignificantBits
from color_stereo_ros.messages.synchronizer import Pair
from color_stereo_ros.recordings.types import serialized as cdr_of

from known_results import HEADER, known_result, output

import numpy as np

import pytest

BAYER = {'rggb': 'RGGB', 'bggr': 'BGGR', 'gbrg': 'GBRG', 'grbg': 'GRBG'}


def raw_message(encoding, pixels, padding=0, **changes):
    """Return an image message around an array (H, W, bytes per pixel)."""
    height, width = pixels.shape[:2]
    rows = np.full((height, pixels[0].nbytes + padding), 0xAB, np.uint8)
    rows[:, :pixels[0].nbytes] = pixels.view(np.uint8).reshape(height, -1)
    msg = contents.Image(HEADER, height, width, encoding, 0, rows.shape[1], rows.tobytes())
    return dataclasses.replace(msg, **changes)


def picture(height=6, width=8, seed=1):
    """Return a random RGB image."""
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)


def in_encoding(rgb, encoding):
    """Return the bytes of an RGB image in one of the plain encodings."""
    alpha = np.full((*rgb.shape[:2], 1), 77, np.uint8)
    order = rgb if encoding.startswith('rgb') else rgb[..., ::-1]
    return np.concatenate((order, alpha), axis=2) if 'a' in encoding else order.copy()


@pytest.mark.parametrize('bigendian', [0, 1])
@pytest.mark.parametrize('padding', [0, 5])
@pytest.mark.parametrize('encoding', ['rgb8', 'bgr8', 'rgba8', 'bgra8'])
def test_plain_encodings_become_rgb(encoding, padding, bigendian):
    rgb = picture()
    msg = raw_message(encoding, in_encoding(rgb, encoding), padding, is_bigendian=bigendian)
    image = reading.image_to_rgb(msg)
    np.testing.assert_array_equal(image, rgb)
    assert image.flags.c_contiguous


def test_rgb8_without_padding_is_not_copied():
    msg = raw_message('rgb8', picture())
    assert np.shares_memory(reading.image_to_rgb(msg), np.frombuffer(msg.data, np.uint8))


def mosaic_of(color, pattern, size=(6, 8)):
    """Return the mosaic that a sensor of this pattern sees of a uniform color."""
    values = dict(zip('RGB', color))
    mosaic = np.empty((*size, 1), np.uint8)
    for index, name in enumerate(pattern):
        mosaic[index // 2::2, index % 2::2] = values[name]
    return mosaic


@pytest.mark.parametrize('padding', [0, 3])
@pytest.mark.parametrize('name', BAYER)
def test_bayer_images_of_a_uniform_color_have_that_color(name, padding):
    color = (200, 90, 30)
    msg = raw_message(f'bayer_{name}8', mosaic_of(color, BAYER[name]), padding)
    np.testing.assert_array_equal(reading.image_to_rgb(msg), np.full((6, 8, 3), color))


@pytest.mark.parametrize('bigendian', [0, 1])
@pytest.mark.parametrize('name', BAYER)
def test_bayer_images_of_16_bits_give_their_high_byte(name, bigendian):
    color = (200, 90, 30)
    high = mosaic_of(color, BAYER[name])
    low = np.full_like(high, 0x55)
    pair = (high, low) if bigendian else (low, high)
    msg = raw_message(f'bayer_{name}16', np.concatenate(pair, axis=2), is_bigendian=bigendian)
    np.testing.assert_array_equal(reading.image_to_rgb(msg), np.full((6, 8, 3), color))


def words_message(name, values, bigendian=0, padding=0):
    """Return a 16-bit Bayer message that holds values, uint16 (H, W)."""
    data = values.astype('>u2' if bigendian else '<u2')
    return raw_message(f'{name}16', data[..., None].view(np.uint8).reshape(*values.shape, 2),
                       padding, is_bigendian=bigendian)


@pytest.mark.parametrize('padding', [0, 3])
@pytest.mark.parametrize('bigendian', [0, 1])
@pytest.mark.parametrize('bits', [8, 10, 12, 14, 16])
def test_bayer_images_of_so_many_significant_bits_give_the_highest_eight(
        bits, bigendian, padding):
    color = np.array((200, 90, 30))
    values = mosaic_of(color, BAYER['rggb'])[..., 0].astype(np.uint16) << (bits - 8)
    values |= (1 << (bits - 8)) - 1  # the bits below do not count
    msg = words_message('bayer_rggb', values, bigendian, padding)
    np.testing.assert_array_equal(reading.image_to_rgb(msg, bits), np.full((6, 8, 3), color))
    assert reading.largest_value(msg) == values.max()


def test_values_beyond_the_significant_bits_count_as_full_scale():
    msg = words_message('bayer_rggb', np.full((6, 8), 5000, np.uint16))
    assert (reading.image_to_rgb(msg, 12) == 255).all()


def test_only_16_bit_images_have_values_to_watch():
    assert reading.largest_value(raw_message('rgb8', picture())) == -1
    mosaic = mosaic_of((9, 9, 9), BAYER['rggb'])
    assert reading.largest_value(raw_message('bayer_rggb8', mosaic)) == -1


def watched(largest, pairs=30, darker=None):
    """Return what is known after pairs whose images have these largest values."""
    found = SignificantBits()
    left, right = (words_message('bayer_rggb', np.full((6, 8), value, np.uint16))
                   for value in (largest // 2 if darker is None else darker, largest))
    for _ in range(pairs):
        found.note(Pair(left, right, 0, 0, 0.0))
    return found


@pytest.mark.parametrize('largest, bits, words', [
    (1023, 16, 'largest value of the 16-bit images is 1023 of 65535'),
    (1023, 16, '(10 or more'), (1024, 16, '(11 or more'), (4095, 16, '(12 or more'),
    (200, 16, 'if the scene is dark, expose longer'), (16383, 16, 'input.significant_bits'),
    (16384, 16, None), (65535, 16, None), (4095, 12, None), (200, 12, None),
    (4096, 12, 'is 4096, but input.significant_bits = 12 expects 0 .. 4095'),
    (1024, 10, 'expects 0 .. 1023')])
def test_values_that_do_not_fit_their_bits_are_a_doubt(largest, bits, words):
    found = watched(largest)
    doubt = found.doubt(bits)
    assert (doubt is None) if words is None else words in doubt
    assert found.news(bits) == doubt and found.news(bits) is None


def test_a_few_dark_images_are_no_doubt_and_a_bright_one_ends_it():
    assert watched(1023, pairs=9).doubt(16) is None
    found = watched(1023)
    bright = words_message('bayer_rggb', np.full((6, 8), 60_000, np.uint16))
    found.note(Pair(bright, bright, 0, 0, 0.0))
    assert found.doubt(16) is None


@pytest.mark.parametrize('left, right, bits, doubtful', [
    (4095, 65535, 16, True), (16383, 65535, 16, True), (1000, 4095, 12, True),
    (0, 60000, 16, True), (20000, 65535, 16, False), (1100, 4095, 12, False), (0, 900, 12, False)])
def test_cameras_of_different_numbers_of_bits_are_a_doubt(left, right, bits, doubtful):
    found = watched(right, darker=left)
    words = f'is {left} on the left and {right} on the right'
    assert (words in (found.doubt(bits) or '')) == doubtful
    assert (found.news(bits) is not None) == doubtful and found.news(bits) is None
    assert watched(right, pairs=9, darker=left).doubt(bits) is None


def test_a_camera_of_8_bits_beside_one_of_16_is_no_doubt():
    found = SignificantBits()
    bright = words_message('bayer_rggb', np.full((6, 8), 60_000, np.uint16))
    for _ in range(30):
        found.note(Pair(bright, raw_message('rgb8', picture()), 0, 0, 0.0))
    assert found.doubt(16) is None


def test_gray_images_get_three_equal_channels():
    image = np.arange(48, dtype=np.uint8).reshape(6, 8)
    rgb = reading.image_to_rgb(raw_message('mono8', image[..., None]))
    np.testing.assert_array_equal(rgb, np.repeat(image[..., None], 3, 2))


@pytest.mark.parametrize('bits, divisor', [(16, 256), (12, 16)])
def test_gray_words_keep_their_highest_bits(bits, divisor):
    words = np.arange(48, dtype=np.uint16).reshape(6, 8) * 80
    rgb = reading.image_to_rgb(words_message('mono', words), bits)
    np.testing.assert_array_equal(rgb, np.repeat((words // divisor)[..., None], 3, 2))


@pytest.mark.parametrize('encoding, reason', [
    ('8UC1', 'does not tell what'), ('32FC1', 'does not tell what its numbers are'),
    ('8UC3', 'does not tell the order'), ('', 'is empty'), ('yuv422', 'is not supported'),
    ('RGB8', 'is not supported'), ('bayer_rggb', 'is not supported'),
    ('bayer_rggb168', 'is not supported')])
def test_other_encodings_are_refused_by_name(encoding, reason):
    msg = raw_message(encoding, picture())
    with pytest.raises(ImageError, match=f'encoding = {encoding!r} {reason}.*rgb8, bgr8'):
        reading.image_to_rgb(msg)


@pytest.mark.parametrize('changes, reason', [
    ({'step': 23}, 'step = 23 bytes is too small for width = 8 px of rgb8.* at least 24'),
    ({'step': 0}, 'step = 0 bytes is too small'),
    ({'height': 0}, 'is empty: width = 8 px, height = 0 px'),
    ({'width': 0}, 'is empty: width = 0 px'),
    ({'width': 2**32 - 1}, 'is too large: width = 4294967295 px'),
    ({'height': 7}, 'truncated: 144 bytes, expected height .* = 168'),
    ({'height': 5}, 'too long: 144 bytes, expected height .* = 120'),
    ({'data': b''}, 'truncated: 0 bytes'),
    ({'step': 2**32 - 1}, 'truncated: 144 bytes')])
def test_impossible_layouts_are_refused_with_their_values(changes, reason):
    with pytest.raises(ImageError, match=reason):
        reading.image_to_rgb(raw_message('rgb8', picture(), **changes))


def test_a_bayer_image_without_neighbors_is_refused():
    with pytest.raises(ImageError, match='2 x 2 px is too small for bayer_rggb8'):
        reading.image_to_rgb(raw_message('bayer_rggb8', np.zeros((2, 2, 1), np.uint8)))


@pytest.mark.parametrize('encoding, dtype, channels', [
    ('rgb8', np.uint8, 3), ('bgr8', np.uint8, 3), ('mono8', np.uint8, 1),
    ('16UC1', np.uint16, 1), ('32FC1', np.float32, 1)])
def test_an_image_message_holds_the_bytes_of_the_array(encoding, dtype, channels):
    shape = (4, 5, 3) if channels == 3 else (4, 5)
    image = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    msg = contents.image(image, encoding, HEADER)
    assert (msg.height, msg.width, msg.encoding) == (4, 5, encoding)
    assert msg.step == 5 * channels * np.dtype(dtype).itemsize
    assert bytes(msg.data) == image.tobytes()
    assert msg.header == HEADER


def test_the_content_of_an_image_shares_its_pixels():
    image = np.zeros((4, 5), np.float32)
    assert np.shares_memory(contents.image(image, '32FC1', HEADER).data, image)


def test_an_image_of_the_wrong_type_is_refused():
    with pytest.raises(ImageError, match='type float64 and shape .4, 5. is no 32FC1'):
        contents.image(np.zeros((4, 5)), '32FC1', HEADER)


def test_depth_in_millimeters_has_zero_for_unknown_and_too_far():
    depth = np.array([[0.3456, np.nan, 65.535, 65.6]], np.float32)
    assert millimeters(depth).tolist() == [[346, 0, 65535, 0]]


def test_the_camera_info_is_the_rectified_left_camera():
    msg = output('depth/camera_info', known_result())
    assert (msg.width, msg.height) == (32, 24)
    np.testing.assert_array_equal(msg.p.reshape(3, 4), [
        [40.0, 0, 15.25, 0], [0, 41.0, 11.5, 0], [0, 0, 1, 0]])
    np.testing.assert_array_equal(msg.k.reshape(3, 3), msg.p.reshape(3, 4)[:, :3])
    np.testing.assert_array_equal(msg.r.reshape(3, 3), np.eye(3))
    assert list(msg.d) == [0.0] * 5 and msg.distortion_model == 'plumb_bob'


def fields_of(msg):
    """Return the points of a cloud as float32 (N, 4)."""
    return np.frombuffer(msg.data, np.float32).reshape(-1, 4)


def test_the_cloud_is_the_back_projection_with_p():
    result = known_result()
    msg = cloud(result, HEADER)
    v, u = np.mgrid[:24, :32]
    z = result.depth.astype(np.float64)
    expected = np.stack(((u - 15.25) * z / 40.0, (v - 11.5) * z / 41.0, z), axis=-1)
    np.testing.assert_allclose(fields_of(msg)[:, :3].reshape(24, 32, 3), expected, rtol=1e-6)


def test_the_organized_cloud_has_16_bytes_a_point_and_nan_for_unknown():
    msg = cloud(known_result(), HEADER)
    assert (msg.height, msg.width, msg.point_step, msg.row_step) == (24, 32, 16, 512)
    assert len(msg.data) == 24 * 512
    assert not msg.is_dense and not msg.is_bigendian
    assert [(f.name, f.offset, f.datatype, f.count) for f in msg.fields] == [
        ('x', 0, 7, 1), ('y', 4, 7, 1), ('z', 8, 7, 1), ('rgb', 12, 7, 1)]
    assert np.isnan(fields_of(msg)[3 * 32 + 4, :3]).all()
    assert np.isnan(fields_of(msg)[:, :3]).any(axis=1).sum() == 2


def test_the_compact_cloud_holds_the_known_points_only():
    result = known_result()
    msg = cloud(result, HEADER, compact=True)
    assert (msg.height, msg.width, msg.row_step) == (1, 24 * 32 - 2, 16 * (24 * 32 - 2))
    assert msg.is_dense
    known = np.isfinite(result.depth)
    np.testing.assert_array_equal(fields_of(msg)[:, :3], result.points()[known])


def test_a_cloud_without_a_known_point_is_empty_when_compact():
    everywhere = [(v, u) for v in range(24) for u in range(32)]
    msg = cloud(known_result(everywhere), HEADER, compact=True)
    assert (msg.width, msg.row_step, len(msg.data)) == (0, 0, 0)


def test_pure_red_is_the_bytes_0_0_255_0():
    result = known_result()
    result.image[:] = (255, 0, 0)
    msg = cloud(result, HEADER)
    assert bytes(msg.data)[12:16] == b'\x00\x00\xff\x00'


def test_the_color_of_a_point_is_the_color_of_its_pixel():
    result = known_result()
    data = np.frombuffer(cloud(result, HEADER).data, np.uint8).reshape(-1, 16)
    np.testing.assert_array_equal(data[:, 12:15], result.image[..., ::-1].reshape(-1, 3))
    assert not data[:, 15].any()


def test_a_rotation_turns_the_points_and_nothing_else():
    result = known_result()
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    plain = fields_of(cloud(result, HEADER))
    turned = fields_of(cloud(result, HEADER, rotation=quarter))
    np.testing.assert_allclose(turned[:, 0], -plain[:, 1], rtol=1e-6)
    np.testing.assert_allclose(turned[:, 1], plain[:, 0], rtol=1e-6)
    np.testing.assert_array_equal(turned[:, 3].view(np.uint32), plain[:, 3].view(np.uint32))


def disparities(msg):
    """Return the pixels of a disparity message."""
    return np.frombuffer(msg.image.data, np.float32).reshape(msg.image.height, msg.image.width)


def test_the_disparity_message_gives_depth_by_its_own_convention():
    result = known_result()
    msg = disparity(result, HEADER)
    pixels = disparities(msg)
    known = pixels >= msg.min_disparity
    np.testing.assert_array_equal(known, np.isfinite(result.depth))
    np.testing.assert_allclose(msg.f * msg.t / pixels[known], result.depth[known], rtol=1e-6)


def test_unknown_disparities_lie_below_the_minimum_on_verged_rigs_too():
    msg = disparity(known_result(), HEADER)
    pixels = disparities(msg)
    assert (pixels < msg.min_disparity).sum() == 2
    assert pixels.max() <= msg.max_disparity
    np.testing.assert_allclose(msg.f * msg.t / msg.min_disparity, 0.6, rtol=1e-6)
    np.testing.assert_allclose(msg.f * msg.t / msg.max_disparity, 0.35, rtol=1e-6)


def test_the_valid_window_holds_the_columns_that_can_have_a_partner():
    result = known_result()
    window = disparity(result, HEADER).valid_window
    # a partner at x - d lies inside 0 .. 31 for d in 12.17 .. 16.93
    assert (window.x_offset, window.width) == (12, 20)
    assert (window.y_offset, window.height) == (0, 24)


@pytest.mark.parametrize('limits, window', [((-20.0, -4.0), (0, 28)), ((-3.0, 5.0), (0, 32)),
                                            ((4.5, 9.0), (4, 28))])
def test_the_valid_window_follows_negative_disparities(limits, window):
    result = dataclasses.replace(known_result(), disparity_limits=limits)
    roi = disparity(result, HEADER).valid_window
    assert (roi.x_offset, roi.width) == window


def test_the_disparity_step_is_the_resolution_of_the_frame():
    assert disparity(known_result(), HEADER).delta_d == pytest.approx(0.125)


def test_the_disparity_image_is_a_32fc1_image_with_the_same_header():
    msg = disparity(known_result(), HEADER)
    assert (msg.image.encoding, msg.image.step, msg.image.header) == ('32FC1', 128, msg.header)
    assert (msg.f, msg.t) == (pytest.approx(40.0), pytest.approx(0.1))


# ---- serialized images

def serialized(**changes):
    """Return the bytes of an image message and its content."""
    msg = contents.Image(Header.at(7_000_000_009, 'left_camera'), height=3, width=5,
                         encoding='rgb8', is_bigendian=0, step=16,
                         data=np.arange(48, dtype=np.uint8))
    msg = dataclasses.replace(msg, **changes)
    return bytes(cdr_of(msg)), msg


@pytest.mark.parametrize('frame', ['', 'a', 'four', 'left_camera_optical_frame', 'Kamera ä'])
@pytest.mark.parametrize('encoding', ['rgb8', 'bayer_rggb8', ''])
def test_a_serialized_image_is_read_as_it_was(frame, encoding):
    data, msg = serialized(header=Header.at(-5, frame), encoding=encoding, is_bigendian=1)
    image = reading.read_image(data)
    for name in ('header', 'height', 'width', 'encoding', 'is_bigendian', 'step'):
        assert getattr(image, name) == getattr(msg, name)
    assert bytes(image.data) == bytes(msg.data)


def test_the_pixels_of_a_serialized_image_are_not_copied():
    data, _ = serialized(step=15, data=np.arange(45, dtype=np.uint8))
    pixels = reading.image_to_rgb(reading.read_image(data))
    assert np.shares_memory(pixels, np.frombuffer(data, np.uint8))


def test_a_serialized_image_of_the_other_byte_order_is_read():
    text = b'rgb8\0'
    data = (b'\0\0\0\0' + struct.pack('>iI', 7, 9) + struct.pack('>I', 2) + b'a\0' + b'\0\0'
            + struct.pack('>II', 1, 1) + struct.pack('>I', 5) + text + b'\0' + b'\0\0'
            + struct.pack('>II', 3, 3) + bytes([1, 2, 3]))
    image = reading.read_image(data)
    assert (image.header.stamp.sec, image.header.frame_id, image.step) == (7, 'a', 3)
    assert bytes(image.data) == bytes([1, 2, 3])


@pytest.mark.parametrize('length', [*range(2, 70, 3), 90])
def test_a_serialized_image_that_ends_too_early_is_refused(length):
    data, _ = serialized()
    assert len(data) > 90
    with pytest.raises(ImageError, match='damaged'):
        reading.read_image(data[:length])


def test_serialized_images_with_random_damage_are_read_or_refused(effort, figures):
    seeds = effort.seeds(200, 50000)
    whole, _ = serialized()
    refused = 0
    for seed in seeds:
        random = Random(seed)
        data = bytearray(whole)
        for _ in range(random.randint(1, 8)):
            data[random.randrange(len(data))] = random.randrange(256)
        try:
            reading.image_to_rgb(reading.read_image(bytes(data[:random.randint(1, 200)])))
        except ImageError:
            refused += 1
    figures('serialized images with random damage refused', refused, 'images', over=seeds)


def test_bytes_that_nobody_can_read_are_refused():
    with pytest.raises(ImageError, match='damaged'):
        reading.read_image(b'\x7f\x7f\0\0' + bytes(20))


def test_bytes_of_another_middleware_are_read_by_its_library():
    _, msg = serialized()
    image = reading.read_image(b'\x7f\x7f', otherwise=lambda data: msg)
    assert image.header == msg.header and np.shares_memory(image.data, msg.data)

    def fail(data):
        raise RuntimeError('not mine')

    with pytest.raises(ImageError, match='damaged: not mine'):
        reading.read_image(b'\x7f\x7f', otherwise=fail)


def test_an_output_is_one_entry():
    def content(result, context):
        return contents.image(result.status, 'mono8', context.header)

    with OUTPUTS.temporarily():
        OUTPUTS.register('toy/image', Output(contents.Image.TYPE, 'a toy', content))
        assert list(OUTPUTS)[-1] == 'toy/image'
        assert bytes(output('toy/image', known_result()).data) == known_result().status.tobytes()
    assert 'toy/image' not in OUTPUTS
