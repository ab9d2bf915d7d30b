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
"""`color_stereo convert`: compressed recordings in, frames and the new outputs out."""

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import StereoCalibration
from color_stereo_ros.messages.contents import camera_info, CompressedImage, Header
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.writing import write_recording
import cv2
import numpy as np
import pytest
from scenes import hue_pair

SECOND = 1_000_000_000
SIZE = WIDTH, HEIGHT = 64, 24
FRAME, RECTIFIED = 'left_camera_optical_frame', 'left_camera_rectified_optical_frame'
OPTIONS = ['--matching.method', 'paper', '--pattern.type', 'sweep', '--color.smoothing', '0',
           '--range.min_depth', '0.4', '--range.max_depth', '3']


def verged_rig(angle=0.05):
    """Return a rig whose cameras are turned towards each other, each by an angle in rad."""
    K = [[80.0, 0, (WIDTH - 1) / 2], [0, 80.0, (HEIGHT - 1) / 2], [0, 0, 1]]
    turned = cv2.Rodrigues(np.array([0.0, angle, 0.0]))[0]
    center = turned.T @ [0.1, 0, 0]  # of the right camera, seen from the left one
    R = turned @ turned
    return StereoCalibration.from_arrays(SIZE, K, [], K, [], R, -R @ center)


def recorded(path, calibration, compressed):
    """Write a recording of two pairs, raw or as PNG."""
    pair = hue_pair(9)
    with write_recording(path) as writer:
        for time_ns in (SECOND, 2 * SECOND):
            if not compressed:
                writer.write_pair(time_ns, *pair, calibration, namespace='cell')
                continue
            for side, image in zip(('left', 'right'), pair):
                header = Header.at(time_ns, f'{side}_camera_optical_frame')
                writer.write_content(f'/cell/{side}/camera_info', time_ns, camera_info(
                    getattr(calibration, side), header))
                data = cv2.imencode('.png', image[..., ::-1])[1].ravel()
                writer.write_content(f'/cell/{side}/image_raw/compressed', time_ns,
                                     CompressedImage(header, 'rgb8; png compressed bgr8', data))
    return path


def converted(tmp_path, compressed, *options):
    """Return the messages of the result by topic, in order, and its latched topics."""
    bag = recorded(tmp_path / f'bag{compressed}', verged_rig(), compressed)
    result = tmp_path / f'result{compressed}'
    transport = ['--input.transport', 'compressed'] if compressed else []
    words = ['convert', str(bag), str(result), *OPTIONS, *transport, *options]
    assert not cli.main(words)
    found = {}
    with Recording(result) as recording:
        for message in recording.messages():
            found.setdefault(message.topic, []).append(recording.decoded(message))
        return found, recording.latched


def test_a_compressed_recording_gives_the_same_as_a_raw_one(tmp_path):
    raw, _ = converted(tmp_path, False)
    packed, _ = converted(tmp_path, True)
    assert raw.keys() == packed.keys()
    for first, second in zip(raw['/cell/depth/image'], packed['/cell/depth/image'], strict=True):
        assert bytes(first.data) == bytes(second.data)
    assert np.isfinite(raw['/cell/depth/image'][0].data.view(np.float32)).any()


def test_the_result_of_a_verged_rig_holds_the_transform_once_and_latched(tmp_path):
    found, latched = converted(tmp_path, False)
    message, = found['/tf_static']
    transform, = message.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == (FRAME, RECTIFIED)
    assert '/tf_static' in latched
    assert {each.header.frame_id for each in found['/cell/points']} == {RECTIFIED}


def test_the_new_outputs_can_be_converted(tmp_path):
    found, _ = converted(tmp_path, False, '--topics', 'points', 'depth/image/compressedDepth',
                         'left/image_rect_color', 'range_image/compressed',
                         '--output.point_fields', 'confidence depth_std',
                         '--output.decimation', '2')
    cloud, color = found['/cell/points'][0], found['/cell/left/image_rect_color'][0]
    assert [field.name for field in cloud.fields][4:] == ['confidence', 'depth_std']
    assert (cloud.width, cloud.height) == (color.width, color.height) == (32, 12)
    assert found['/cell/range_image/compressed'][0].format == 'bgr8; jpeg compressed bgr8'
    assert found['/cell/depth/image/compressedDepth'][0].format == '32FC1; compressedDepth png'


@pytest.mark.parametrize('compressed', [False, True])
def test_the_wrong_transport_is_named(tmp_path, capsys, compressed):
    bag = recorded(tmp_path / 'bag', verged_rig(), not compressed)
    transport = ['--input.transport', 'compressed'] if compressed else []
    assert cli.main(['convert', str(bag), str(tmp_path / 'result'), *transport]) == 1
    said = capsys.readouterr().err
    assert ('input.transport compressed' in said) or ('image_raw/compressed' in said)
