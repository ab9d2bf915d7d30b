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
"""range_node over real DDS: every output, bit for bit."""

from array import array
import signal
import struct

from color_stereo_ros.core import ColorStereo, Settings, StereoCalibration
from color_stereo_ros.core.false_color import automatic_limits, false_color, status_picture
from color_stereo_ros.core.legends import with_status_legend
from color_stereo_ros.core.status import Status
from color_stereo_ros.messages.reading import image_to_rgb

import cv2

from diagnostic_msgs.msg import DiagnosticStatus

import numpy as np

import pytest

from ros_rig import (answering, calibration, DEPTH, floats, HEIGHT, image_message, NodeProcess,
                     PAPER, Rig, scene, WIDTH)

from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2

from stereo_msgs.msg import DisparityImage

TOPICS = {'depth/image': Image, 'depth/camera_info': CameraInfo, 'points': PointCloud2,
          'disparity': DisparityImage, 'confidence/image': Image, 'depth_std/image': Image,
          'status/image': Image, 'status_picture': Image, 'range_image': Image,
          'left/image_rect_color': Image, 'depth/image/compressedDepth': CompressedImage,
          'range_image/compressed': CompressedImage}
SETTINGS = Settings().updated(PAPER)
DEFAULTS = {'output.depth_encoding': '32FC1', 'output.frame': 'rectified',
            'output.compact_points': False, 'output.range_colors': 'viridis',
            'output.range_limits': 'fixed', 'input.rectified': False, 'output.frame_id': '',
            'output.point_fields': '', 'output.region': '', 'output.decimation': 1,
            'input.transport': 'raw'}
JPEG_444, JPEG_420 = ((cv2.IMWRITE_JPEG_QUALITY, 95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factor)
                      for factor in (cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
                                     cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420))
VERGED = 'left_camera_rectified_optical_frame'


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    """Yield a rig with a node that has answered once."""
    log = tmp_path_factory.mktemp('range_node') / 'log.txt'
    with answering(log, PAPER, TOPICS, 'range_image') as rig:
        yield rig


@pytest.fixture
def rig(running):
    """Yield the rig with the default outputs and the default cameras."""
    yield running
    running.calibration = calibration()
    running.images = dict(zip(('left', 'right'), scene()))
    result = running.set_parameters(**{name.replace('.', '__'): value
                                       for name, value in DEFAULTS.items()})
    assert result.successful, result.reason


def converging():
    """Return the calibration of the tiny rig with both cameras turned, each by half a degree."""
    wide = calibration()
    turned = cv2.Rodrigues(np.radians([0.0, 0.5, 0.0]))[0]
    R = turned @ turned
    return StereoCalibration.from_arrays((WIDTH, HEIGHT), wide.left.K, None, wide.right.K, None,
                                         R, -R @ turned.T @ [0.06, 0, 0])


def expected(rig, **options):
    """Return what the core makes of the rig's images."""
    stereo = ColorStereo(rig.calibration, SETTINGS, **options)
    return stereo.process(rig.images['left'], rig.images['right'])


def settle(rig):
    """Send pairs until one is answered: images may overtake a calibration that has changed."""
    rig.received['depth/image'].clear()
    rig.first_output('depth/image')


def all_outputs(rig):
    """Send a pair and return its outputs by topic, once a change of calibration is settled."""
    settle(rig)
    stamp = rig.send_pair()
    return {topic: rig.await_output(topic, stamp) for topic in TOPICS}


def outputs_in(rig, frame):
    """Send pairs until depth/image is in a frame; return all outputs of that pair by topic."""
    for _ in range(50):
        outputs = all_outputs(rig)
        if outputs['depth/image'].header.frame_id == frame:
            return outputs
    raise AssertionError(f'never in {frame}')


def test_the_tiny_rig_measures_what_it_shows(rig):
    result = expected(rig)
    assert result.density > 0.5
    np.testing.assert_allclose(np.nanmedian(result.depth), DEPTH, rtol=0.01)


def test_depth_equals_the_core_bit_for_bit(rig):
    msg = rig.good_pair()
    assert (msg.encoding, msg.height, msg.width, msg.step) == ('32FC1', HEIGHT, WIDTH, 4 * WIDTH)
    assert bytes(msg.data) == expected(rig).depth.tobytes()


def test_every_output_carries_stamp_and_frame_of_the_left_image(rig):
    outputs = all_outputs(rig)
    assert {msg.header.frame_id for msg in outputs.values()} == {'left_camera_optical_frame'}
    assert len({(msg.header.stamp.sec, msg.header.stamp.nanosec)
                for msg in outputs.values()}) == 1


def test_confidence_status_and_deviation_equal_the_core_bit_for_bit(rig):
    outputs, result = all_outputs(rig), expected(rig)
    assert bytes(outputs['confidence/image'].data) == result.confidence.tobytes()
    assert bytes(outputs['status/image'].data) == result.status.tobytes()
    assert outputs['status/image'].encoding == 'mono8'
    assert bytes(outputs['depth_std/image'].data) == result.depth_std.tobytes()


def test_points_are_the_back_projection_with_p_of_depth_camera_info(rig):
    rig.calibration = calibration(verged=0.05)
    rig.first_output('points')
    outputs = all_outputs(rig)
    p = outputs['depth/camera_info'].p.reshape(3, 4)
    z = floats(outputs['depth/image']).astype(np.float64)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    xyz = np.stack(((u - p[0, 2]) * z / p[0, 0], (v - p[1, 2]) * z / p[1, 1], z), axis=-1)
    cloud = np.frombuffer(outputs['points'].data, np.float32).reshape(HEIGHT, WIDTH, 4)
    np.testing.assert_allclose(cloud[..., :3], xyz, rtol=1e-6)
    assert np.isfinite(z).any()


def test_the_disparity_message_gives_the_same_depth(rig):
    outputs = all_outputs(rig)
    msg = outputs['disparity']
    pixels = floats(msg.image)
    known = pixels >= msg.min_disparity
    z = floats(outputs['depth/image'])
    np.testing.assert_array_equal(known, np.isfinite(z))
    np.testing.assert_allclose(msg.f * msg.t / pixels[known], z[known], rtol=1e-6)


def test_the_camera_info_is_the_rectified_left_camera(rig):
    info = all_outputs(rig)['depth/camera_info']
    np.testing.assert_array_equal(info.p.reshape(3, 4)[:, :3], rig.calibration.left.P[:, :3])
    assert (info.width, info.height, list(info.d)) == (WIDTH, HEIGHT, [0.0] * 5)


def test_the_range_image_is_the_false_color_picture_in_bgr(rig):
    msg = all_outputs(rig)['range_image']
    picture = false_color(expected(rig).depth, 0.25, 0.8)
    assert (msg.encoding, msg.height, msg.width) == ('bgr8', HEIGHT, WIDTH)
    assert bytes(msg.data) == picture[..., ::-1].tobytes()


def test_colors_and_limits_of_the_range_image_can_be_chosen(rig):
    assert rig.set_parameters(output__range_colors='paper',
                              output__range_limits='automatic').successful
    msg = all_outputs(rig)['range_image']
    depth = expected(rig).depth
    limits = automatic_limits(depth)
    assert 0.25 < limits[0] < limits[1] < 0.8
    assert (msg.encoding, msg.height, msg.width) == ('bgr8', HEIGHT, WIDTH)
    assert bytes(msg.data) == false_color(depth, *limits, 'paper')[..., ::-1].tobytes()


def test_colors_that_do_not_exist_are_refused_with_their_names(rig):
    result = rig.set_parameters(output__range_colors='jet')
    assert not result.successful
    assert "output.range_colors = 'jet' is not one of viridis, paper" in result.reason


def test_the_status_picture_shows_the_status_with_a_legend_in_bgr(rig):
    outputs, status = all_outputs(rig), expected(rig).status
    msg = outputs['status_picture']
    picture = with_status_legend(status_picture(status))
    assert (msg.encoding, msg.height) == ('bgr8', HEIGHT) and msg.width > WIDTH
    assert bytes(msg.data) == picture[..., ::-1].tobytes()
    pixels = np.frombuffer(msg.data, np.uint8).reshape(msg.height, msg.width, 3)
    valid = (pixels[:, :WIDTH] == 235).all(axis=2)
    np.testing.assert_array_equal(valid, np.frombuffer(
        outputs['status/image'].data, np.uint8).reshape(HEIGHT, WIDTH) == Status.VALID)
    assert valid.any()


@pytest.mark.parametrize('encoding', ['rgb8', 'bgr8', 'rgba8', 'bgra8'])
def test_every_plain_encoding_gives_the_same_depth(rig, encoding):
    stamp = rig.send_pair(**{side: image_message(image, encoding)
                             for side, image in rig.images.items()})
    assert bytes(rig.await_output('depth/image', stamp).data) == expected(rig).depth.tobytes()


def test_padded_rows_give_the_same_depth(rig):
    def padded(image):
        rows = np.pad(image.reshape(HEIGHT, -1), ((0, 0), (0, 7)), constant_values=99)
        return image_message(image, step=rows.shape[1], data=array('B', rows.tobytes()))

    stamp = rig.send_pair(**{side: padded(image) for side, image in rig.images.items()})
    assert bytes(rig.await_output('depth/image', stamp).data) == expected(rig).depth.tobytes()


@pytest.mark.parametrize('bits', [8, 16])
@pytest.mark.parametrize('pattern', ['rggb', 'bggr', 'gbrg', 'grbg'])
def test_every_bayer_encoding_gives_the_depth_of_its_demosaiced_images(rig, pattern, bits):
    def mosaic(image):
        flat = np.empty((HEIGHT, WIDTH), np.uint8)
        for index, name in enumerate(pattern):
            flat[index // 2::2, index % 2::2] = image[index // 2::2, index % 2::2,
                                                      'rgb'.index(name)]
        data = flat if bits == 8 else flat.astype(np.uint16) * 257
        return Image(height=HEIGHT, width=WIDTH, encoding=f'bayer_{pattern}{bits}',
                     step=data[0].nbytes, data=array('B', data.tobytes()))

    messages = {side: mosaic(image) for side, image in rig.images.items()}
    stamp = rig.send_pair(**messages)
    depth = rig.await_output('depth/image', stamp)
    rig.images = {side: image_to_rgb(message) for side, message in messages.items()}
    assert bytes(depth.data) == expected(rig).depth.tobytes()


def test_a_12_bit_camera_is_noticed_once_and_read_by_its_significant_bits(tmp_path):
    def mosaic(image):
        flat = np.empty((HEIGHT, WIDTH), np.uint16)
        for index, channel in enumerate((0, 1, 1, 2)):
            flat[index // 2::2, index % 2::2] = image[index // 2::2, index % 2::2, channel]
        data = (flat << 4) + 7  # 12 bits, in the low bits of 16
        return Image(height=HEIGHT, width=WIDTH, encoding='bayer_rggb16', step=data[0].nbytes,
                     data=array('B', data.tobytes()))

    words = 'input.significant_bits to their number (12 or more'
    node = NodeProcess(tmp_path / 'log.txt', parameters=PAPER, arguments=['-r', '__ns:=/bits'])
    rig = Rig('/bits')
    rig.listen(Image, 'depth/image')
    rig.first_output('depth/image')
    messages = {side: mosaic(image) for side, image in rig.images.items()}
    for _ in range(12):
        rig.await_output('depth/image', rig.send_pair(**messages))
    parts = rig.diagnose(lambda p: words in p['inputs'].message, 'the unused bits')
    assert parts['inputs'].level == DiagnosticStatus.WARN
    assert rig.set_parameters(input__significant_bits=12).successful
    depth = rig.await_output('depth/image', rig.send_pair(**messages))
    rig.images = {side: image_to_rgb(message, 12) for side, message in messages.items()}
    assert bytes(depth.data) == expected(rig).depth.tobytes()
    assert np.isfinite(floats(depth)).mean() > 0.5
    rig.diagnose(lambda p: words not in p['inputs'].message, 'the end of it')
    assert node.text().count(words) == 1
    assert node.stop() == 0
    rig.close()


def test_a_verged_rig_has_a_frame_of_its_own_for_what_is_rectified(rig):
    rig.calibration = converging()
    outputs = outputs_in(rig, VERGED)
    assert {msg.header.frame_id for msg in outputs.values()} == {VERGED}
    assert rig.set_parameters(output__frame='camera').successful
    outputs = all_outputs(rig)
    assert {topic for topic, msg in outputs.items() if msg.header.frame_id != VERGED} == {'points'}
    assert outputs['points'].header.frame_id == 'left_camera_optical_frame'
    assert rig.set_parameters(output__frame_id='cell_camera').successful
    outputs_in(rig, 'cell_camera')


def test_a_verged_rig_publishes_the_transform_or_says_how(rig):
    try:
        import tf2_msgs.msg  # noqa: F401
        there = True
    except ImportError:
        there = False
    rig.calibration = converging()
    outputs_in(rig, VERGED)
    rig.process.wait_until_said(f"outputs are in the frame '{VERGED}'")
    text = rig.process.text()
    assert ('ros2 run tf2_ros static_transform_publisher --x 0' in text) != there
    assert (' is on /tf_static' in text) == there


def test_the_rectified_color_image_fits_the_depth_and_colors_its_points(rig):
    rig.calibration = converging()
    outputs = all_outputs(rig)
    color, depth = outputs['left/image_rect_color'], outputs['depth/image']
    assert (color.encoding, color.height, color.width) == ('rgb8', depth.height, depth.width)
    pixels = np.frombuffer(color.data, np.uint8).reshape(HEIGHT, WIDTH, 3)
    np.testing.assert_array_equal(pixels, expected(rig).image)
    # depth_image_proc, point_cloud_xyzrgb: depth, color and camera_info give the cloud
    bits = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    cloud = np.frombuffer(outputs['points'].data, np.uint32).reshape(HEIGHT, WIDTH, 4)
    np.testing.assert_array_equal(cloud[..., 3], bits)


def test_compressed_outputs_hold_what_the_raw_ones_do(rig):
    outputs = all_outputs(rig)
    data = bytes(outputs['depth/image/compressedDepth'].data)
    _, a, b = struct.unpack('<iff', data[:12])
    codes = cv2.imdecode(np.frombuffer(data[12:], np.uint8), cv2.IMREAD_UNCHANGED)
    with np.errstate(divide='ignore'):
        depth = np.where(codes > 0, a / (codes.astype(np.float32) - b), np.nan)
    np.testing.assert_allclose(depth, floats(outputs['depth/image']), atol=5e-5)
    assert outputs['depth/image/compressedDepth'].format == '32FC1; compressedDepth png'
    picture = outputs['range_image/compressed']
    found = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.format == 'bgr8; jpeg compressed bgr8' and found.shape == (HEIGHT, WIDTH, 3)


def test_points_have_the_fields_that_are_asked_for(rig):
    assert rig.set_parameters(
        output__point_fields='normal_x normal_y normal_z confidence depth_std').successful
    msg, result = rig.good_pair('points'), expected(rig)
    assert [field.name for field in msg.fields] == [
        'x', 'y', 'z', 'rgb', 'normal_x', 'normal_y', 'normal_z', 'confidence', 'depth_std']
    assert (msg.point_step, msg.row_step) == (36, 36 * WIDTH)
    points = np.frombuffer(msg.data, np.float32).reshape(HEIGHT, WIDTH, 9)
    np.testing.assert_array_equal(points[..., :3], result.points())
    np.testing.assert_array_equal(points[..., 4:7], result.normals())
    np.testing.assert_array_equal(points[..., 7], result.confidence)
    np.testing.assert_array_equal(points[..., 8], result.depth_std)
    assert np.isfinite(points).all(axis=-1).any()


def test_a_decimated_pair_is_a_subset_in_every_output(rig):
    assert rig.set_parameters(output__decimation=2).successful
    outputs, result = all_outputs(rig), expected(rig)
    depth = floats(outputs['depth/image'])
    np.testing.assert_array_equal(depth, result.depth[::2, ::2])
    info = outputs['depth/camera_info']
    assert (info.width, info.height) == (WIDTH // 2, HEIGHT // 2)
    p, (v, u) = info.p.reshape(3, 4), np.mgrid[:HEIGHT // 2, :WIDTH // 2]
    z = depth.astype(np.float64)
    xyz = np.stack(((u - p[0, 2]) * z / p[0, 0], (v - p[1, 2]) * z / p[1, 1], z), axis=-1)
    cloud = np.frombuffer(outputs['points'].data, np.float32).reshape(HEIGHT // 2, WIDTH // 2, 4)
    np.testing.assert_allclose(cloud[..., :3], xyz, rtol=1e-6)
    np.testing.assert_array_equal(cloud[..., :3], result.points()[::2, ::2])
    assert outputs['left/image_rect_color'].width == WIDTH // 2


def test_outside_of_the_region_nothing_is_known_and_the_size_stays(rig):
    assert rig.set_parameters(output__region='0 inf -1 1 0 2').successful
    outputs, result = all_outputs(rig), expected(rig)
    inside = result.points()[..., 0] >= 0
    depth = floats(outputs['depth/image'])
    np.testing.assert_array_equal(depth, np.where(inside, result.depth, np.nan))
    assert 0 < np.isfinite(depth).sum() < np.isfinite(result.depth).sum()
    status = np.frombuffer(outputs['status/image'].data, np.uint8).reshape(HEIGHT, WIDTH)
    assert (status[np.isfinite(result.depth) & ~inside] == Status.OUT_OF_RANGE).all()


def compressed_message(pixels, text, suffix, *options):
    """Return a message with BGR pixels or a mosaic as a file."""
    data = cv2.imencode(suffix, pixels, options)[1].tobytes()
    return CompressedImage(format=text, data=array('B', data))


def send_compressed(rig, publishers, messages):
    """Publish a pair of compressed images and return its stamp, ns."""
    stamp = rig.tick()
    rig.send_infos()
    for side, message in messages.items():
        publishers[side].publish(rig.stamped(message, stamp))
    return stamp


@pytest.fixture
def compressed(rig):
    """Yield publishers of compressed images, by side; the node listens to them."""
    publishers = {side: rig.node.create_publisher(CompressedImage, f'{side}/image_raw/compressed',
                                                  10) for side in ('left', 'right')}
    assert rig.set_parameters(input__transport='compressed').successful
    rig.spin_until(lambda: all(publisher.get_subscription_count()
                               for publisher in publishers.values()), 'subscriptions')
    yield publishers
    for publisher in publishers.values():
        rig.node.destroy_publisher(publisher)


@pytest.mark.parametrize('suffix', ['.png', '.jpg'])
def test_compressed_images_give_the_depth_of_what_they_decode_to(rig, compressed, suffix):
    messages = {side: compressed_message(image[..., ::-1], 'rgb8; x compressed bgr8', suffix,
                                         *JPEG_444 * (suffix == '.jpg'))
                for side, image in rig.images.items()}
    stamp = send_compressed(rig, compressed, messages)
    depth = rig.await_output('depth/image', stamp)
    rig.images = {side: np.ascontiguousarray(cv2.imdecode(np.frombuffer(
        message.data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1])
        for side, message in messages.items()}
    assert bytes(depth.data) == expected(rig).depth.tobytes()
    assert np.isfinite(floats(depth)).mean() > 0.5


def test_compressed_mosaics_give_the_depth_of_their_demosaiced_images(rig, compressed):
    mosaics = {side: np.ascontiguousarray(image[..., 1]) for side, image in rig.images.items()}
    stamp = send_compressed(rig, compressed, {
        side: compressed_message(mosaic, 'bayer_rggb8; png compressed ', '.png')
        for side, mosaic in mosaics.items()})
    depth = rig.await_output('depth/image', stamp)
    rig.images = {side: image_to_rgb(Image(
        height=HEIGHT, width=WIDTH, encoding='bayer_rggb8', step=WIDTH,
        data=array('B', mosaic.tobytes()))) for side, mosaic in mosaics.items()}
    assert bytes(depth.data) == expected(rig).depth.tobytes()


def test_jpegs_whose_colors_are_coarse_are_noticed(rig, compressed):
    messages = {side: compressed_message(image[..., ::-1], 'jpeg', '.jpg', *JPEG_420)
                for side, image in rig.images.items()}
    stamp = send_compressed(rig, compressed, messages)
    rig.await_output('depth/image', stamp)
    words = 'left image is JPEG 4:2:0: 2 x 2 px share one color'
    rig.process.wait_until_said(words)
    rig.diagnose(lambda parts: words in parts['inputs'].message, words)


def test_a_damaged_compressed_image_is_refused_and_the_next_is_measured(rig, compressed):
    good = {side: compressed_message(image[..., ::-1], 'png', '.png')
            for side, image in rig.images.items()}
    bad = {side: CompressedImage(format='png', data=message.data[:-40])
           for side, message in good.items()}
    send_compressed(rig, compressed, bad)
    rig.process.wait_until_said('left image refused: the PNG ends too early')
    depth = rig.await_output('depth/image', send_compressed(rig, compressed, good))
    assert bytes(depth.data) == expected(rig).depth.tobytes()


def test_16uc1_is_millimeters_with_zero_for_unknown(rig):
    assert rig.set_parameters(output__depth_encoding='16UC1').successful
    msg = rig.good_pair()
    depth = expected(rig).depth
    millimeters = np.frombuffer(msg.data, np.uint16).reshape(HEIGHT, WIDTH)
    assert msg.encoding == '16UC1'
    np.testing.assert_array_equal(millimeters == 0, np.isnan(depth))
    known = np.isfinite(depth)
    assert np.abs(millimeters[known] - depth[known] * 1000.0).max() <= 0.501


def test_the_compact_cloud_holds_the_known_points_only(rig):
    assert rig.set_parameters(output__compact_points=True).successful
    cloud = rig.good_pair('points')
    result = expected(rig)
    assert (cloud.height, cloud.width) == (1, np.isfinite(result.depth).sum())
    assert cloud.is_dense
    xyz = np.frombuffer(cloud.data, np.float32).reshape(-1, 4)[:, :3]
    np.testing.assert_array_equal(xyz, result.points()[np.isfinite(result.depth)])


def test_the_camera_frame_gives_points_rotated_by_r_transposed(rig):
    rig.calibration = converging()
    assert np.abs(rig.calibration.left.R - np.eye(3)).max() > 0.008
    outputs_in(rig, VERGED)
    assert rig.set_parameters(output__frame='camera').successful
    rig.send_pair()
    rig.spin(0.5)
    cloud = rig.good_pair('points')
    rectified = expected(rig).points().astype(np.float64)
    turned = rectified @ rig.calibration.left.R  # rows times R = R^T times columns
    xyz = np.frombuffer(cloud.data, np.float32).reshape(HEIGHT, WIDTH, 4)[..., :3]
    np.testing.assert_allclose(xyz, turned, rtol=1e-5, atol=1e-6)
    assert np.isfinite(xyz).any()


def test_rectified_input_is_not_rectified_again(rig):
    rig.calibration = calibration(verged=0.1)
    assert rig.set_parameters(input__rectified=True).successful
    rig.send_pair()
    rig.spin(0.5)
    msg = rig.good_pair()
    assert bytes(msg.data) == expected(rig, rectified_input=True).depth.tobytes()


def test_settings_apply_from_the_next_pair_on_and_all_together(rig):
    settle(rig)
    try:
        result = rig.set_parameters(range__min_depth=0.3, range__max_depth=0.7)
        assert result.successful, result.reason
        settings = SETTINGS.updated({'range.min_depth': 0.3, 'range.max_depth': 0.7})
        depth = ColorStereo(rig.calibration, settings).process(
            rig.images['left'], rig.images['right']).depth
        assert bytes(rig.good_pair().data) == depth.tobytes()
    finally:
        assert rig.set_parameters(range__min_depth=0.25, range__max_depth=0.8).successful


def test_one_output_for_each_pair(rig):
    rig.spin(0.3)
    for messages in rig.received.values():
        messages.clear()
    sent = []
    for _ in range(20):
        sent.append(rig.send_pair())
        rig.await_output('points', sent[-1])
    assert rig.stamps('points') == sent


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_with_status_0_and_no_traceback(tmp_path, number):
    node = NodeProcess(tmp_path / 'log.txt', parameters=PAPER)
    node.wait_until_said('getting ready')
    assert node.stop(number) == 0, node.text()
    assert 'Traceback' not in node.text()


def test_refused_overrides_end_the_node_with_status_1_and_the_reason(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', parameters={'range.min_depth': 5000.0})
    node.process.wait(60.0)
    assert node.process.returncode == 1
    assert 'range.min_depth = 5000.0 m is outside 0.001 .. 1000.0 m' in node.text()
    assert 'Traceback' not in node.text()
