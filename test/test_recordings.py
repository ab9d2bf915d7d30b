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
"""Recordings: written and read back whole, refused with a reason when they are not."""

import os
from pathlib import Path

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import RecordingError, StereoCalibration
from color_stereo_ros.core.cameras.calibration import CameraModel
from color_stereo_ros.files.image import write_image
from color_stereo_ros.messages.contents import CameraInfo, Image
from color_stereo_ros.messages.reading import image_to_rgb, stamp_ns
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.writing import write_recording

import numpy as np

import projected

import pytest

SAMPLE = Path(__file__).resolve().parents[1] / 'sample'
SECOND = 1_000_000_000


@pytest.fixture
def calibration():
    camera = np.array([[50.0, 0, 15.5], [0, 50.0, 11.5], [0, 0, 1]])
    return StereoCalibration.from_arrays((32, 24), camera, [0.1, -0.02, 0, 0, 0], camera, [],
                                         np.eye(3), [-0.06, 0, 0])


@pytest.fixture
def images():
    generator = np.random.default_rng(7)
    return generator.integers(0, 256, (2, 24, 32, 3), np.uint8)


@pytest.fixture
def recorded(tmp_path, calibration, images):
    """Return the path of a recording of three pairs."""
    with write_recording(tmp_path / 'recorded') as writer:
        for index in range(3):
            writer.write_pair((1 + index) * SECOND, *images, calibration)
    return tmp_path / 'recorded'


def test_images_are_read_back_bit_for_bit(recorded, images):
    with Recording(recorded) as recording:
        found = {message.topic: image_to_rgb(recording.decoded(message))
                 for message in recording.messages() if message.type == Image.TYPE}
    assert np.array_equal(found['/left/image_raw'], images[0])
    assert np.array_equal(found['/right/image_raw'], images[1])


def test_the_calibration_is_read_back_exactly(recorded, calibration):
    with Recording(recorded) as recording:
        infos = {message.topic: recording.decoded(message)
                 for message in recording.messages(['/left/camera_info', '/right/camera_info'])}
    again = StereoCalibration.from_camera_info(infos['/left/camera_info'],
                                               infos['/right/camera_info'])
    for side in ('left', 'right'):
        before, after = getattr(calibration, side), getattr(again, side)
        assert isinstance(after, CameraModel)
        for field in 'DKRP':
            assert np.array_equal(getattr(before, field), getattr(after, field))


def test_messages_come_in_the_order_of_time_with_their_stamps(recorded):
    with Recording(recorded) as recording:
        messages = list(recording.messages())
        assert recording.duration == pytest.approx(2.0, abs=1e-9)
        assert [stamp_ns(recording.decoded(message).header) for message in messages] == [
            message.time_ns for message in messages]
    times = [message.time_ns for message in messages]
    assert times == sorted(times) and len(times) == 12


def test_the_stereo_topics_are_found_in_any_namespace(tmp_path, calibration, images):
    with write_recording(tmp_path / 'cell') as writer:
        writer.write_pair(SECOND, *images, calibration, namespace='/cell_1/head/')
    with Recording(tmp_path / 'cell') as recording:
        topics = recording.stereo_topics()
    assert topics.left_image == '/cell_1/head/left/image_raw'
    assert topics.right_info == '/cell_1/head/right/camera_info'


def test_several_pairs_need_a_namespace(tmp_path, calibration, images):
    with write_recording(tmp_path / 'cells') as writer:
        for name in ('a', 'b'):
            writer.write_pair(SECOND, *images, calibration, namespace=name)
    with Recording(tmp_path / 'cells') as recording:
        with pytest.raises(RecordingError, match='several stereo pairs.*: /a, /b'):
            recording.stereo_topics()
        assert recording.stereo_topics('b').left_image == '/b/left/image_raw'


def test_a_pattern_is_recorded_as_a_latched_topic(tmp_path, images):
    with write_recording(tmp_path / 'lit') as writer:
        writer.write_pattern(SECOND, images[0])
    with Recording(tmp_path / 'lit') as recording:
        assert recording.latched == {'/pattern/image'}


def test_a_single_mcap_file_is_a_recording_too(recorded):
    with Recording(recorded / 'recorded.mcap') as recording:
        assert recording.counts['/left/image_raw'] == 3


def test_a_recording_that_failed_leaves_nothing(tmp_path, calibration, images):
    with pytest.raises(ZeroDivisionError):
        with write_recording(tmp_path / 'new') as writer:
            writer.write_pair(SECOND, *images, calibration)
            raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


def test_a_recording_is_not_overwritten_unasked(recorded, calibration, images):
    with pytest.raises(RecordingError, match='exists already'):
        with write_recording(recorded):
            pass
    with write_recording(recorded, overwrite=True) as writer:
        writer.write_pair(SECOND, *images, calibration)
    with Recording(recorded) as recording:
        assert recording.counts['/left/image_raw'] == 1
    assert os.listdir(recorded.parent) == ['recorded']


def test_what_is_no_recording_is_never_overwritten(tmp_path):
    (tmp_path / 'thesis').mkdir()
    with pytest.raises(RecordingError, match='is no recording, so it is not overwritten'):
        with write_recording(tmp_path / 'thesis', overwrite=True):
            pass


def refusal(path):
    """Return why a recording is refused, wherever that is noticed."""
    with pytest.raises(RecordingError) as refused:
        with Recording(path) as recording:
            recording.stereo_topics()
            for message in recording.messages():
                recording.decoded(message)
    assert str(path) in str(refused.value)
    return str(refused.value)


def test_a_recording_that_is_not_there_is_refused(tmp_path):
    assert 'there is no such recording' in refusal(tmp_path / 'nothing')


def test_a_folder_without_metadata_is_refused(recorded):
    (recorded / 'metadata.yaml').unlink()
    assert 'no metadata.yaml inside' in refusal(recorded)


@pytest.mark.parametrize('kept', [0.0, 0.001, 0.5, 0.99])
def test_a_half_written_file_is_refused(recorded, kept):
    path = recorded / 'recorded.mcap'
    content = path.read_bytes()
    path.write_bytes(content[:int(kept * len(content))])
    assert 'damaged or only half written' in refusal(recorded)
    assert kept < 0.5 or '`mcap recover` makes a new file' in refusal(recorded)


def test_a_damaged_file_is_refused(recorded):
    path = recorded / 'recorded.mcap'
    content = bytearray(path.read_bytes())
    content[60:460] = bytes(400)
    path.write_bytes(content)
    assert 'damaged or only half written' in refusal(recorded)


def test_random_damage_is_refused_or_harmless(recorded, effort, figures):
    seeds = effort.seeds(5, 500)
    path = recorded / 'recorded.mcap'
    whole = path.read_bytes()
    refused = 0
    for seed in seeds:
        generator = np.random.default_rng(seed)
        content = bytearray(whole)
        start = int(generator.integers(len(content)))
        content[start:start + 4] = generator.integers(0, 256, 4, np.uint8).tobytes()
        path.write_bytes(content)
        try:
            with Recording(recorded) as recording:
                for message in recording.messages():
                    recording.decoded(message)
        except RecordingError as error:
            refused += 1
            assert str(recorded) in str(error) and '\n' not in str(error)
    figures('recordings with random damage refused', refused, 'recordings', over=seeds)


def test_a_missing_file_is_named(recorded):
    (recorded / 'recorded.mcap').unlink()
    assert 'recorded.mcap' in refusal(recorded)


@pytest.mark.parametrize('text', ['', 'nonsense: [', 'rosbag2_bagfile_information: {}', '- 1'])
def test_broken_metadata_are_refused(recorded, text):
    (recorded / 'metadata.yaml').write_text(text)
    assert 'damaged or only half written' in refusal(recorded)


def test_a_file_that_is_no_recording_is_refused(tmp_path):
    path = tmp_path / 'holiday.jpg'
    path.write_bytes(b'\xff\xd8')
    assert 'damaged or only half written' in refusal(path)


def test_a_recording_without_a_pair_says_what_it_holds(tmp_path, images):
    with write_recording(tmp_path / 'lit') as writer:
        writer.write_pattern(SECOND, images[0])
    assert refusal(tmp_path / 'lit').endswith('it holds /pattern/image')


def test_a_missing_topic_is_named(tmp_path, recorded):
    with Recording(recorded) as recording, write_recording(tmp_path / 'blind') as writer:
        for message in recording.messages():
            if message.topic != '/right/camera_info':
                writer.write(message.topic, message.type, message.time_ns, message.data)
    assert 'no topic /right/camera_info; it holds /left' in refusal(tmp_path / 'blind')


def test_a_topic_of_another_type_is_named(tmp_path, recorded):
    with Recording(recorded) as recording, write_recording(tmp_path / 'mixed') as writer:
        info = next(iter(recording.messages(['/left/camera_info'])))
        for topic in ('/left/image_raw', '/right/image_raw'):
            writer.write(topic, CameraInfo.TYPE, info.time_ns, info.data)
    assert f'is a {CameraInfo.TYPE}, expected {Image.TYPE}' in refusal(tmp_path / 'mixed')


@pytest.mark.parametrize('scene', ['solids_hue1', 'solids_hue2d'])
def test_the_sample_recordings_are_whole(scene):
    with Recording(SAMPLE / scene / 'recording') as recording:
        topics = recording.stereo_topics()
        shapes = {image_to_rgb(recording.decoded(message)).shape
                  for message in recording.messages([topics.left_image, topics.right_image])}
    assert shapes == {(512, 512, 3)}


def test_the_sample_is_at_most_eight_megabytes():
    assert sum(path.stat().st_size for path in SAMPLE.rglob('*') if path.is_file()) <= 8e6


def test_a_conversion_with_a_third_view_tells_who_saw_what_and_where_the_projector_is(tmp_path):
    with write_recording(tmp_path / 'lit') as writer:
        for index in range(2):
            writer.write_pair((1 + index) * SECOND, *projected.pair(noise=1 + index),
                              projected.CALIBRATION)
    near, far = (projected.CALIBRATION.geometry.focal_baseline / disparity
                 for disparity in projected.LIMITS[::-1])
    pattern = projected.PATTERN
    assert cli.main([
        'convert', str(tmp_path / 'lit'), str(tmp_path / 'result'), '--matching.third_view',
        'automatic', '--pattern.width', str(pattern.width), '--pattern.height',
        str(pattern.height), '--pattern.feature_size', str(pattern.feature_size),
        '--range.min_depth', str(near), '--range.max_depth', str(far)]) in (0, None)
    with Recording(tmp_path / 'result') as recording:
        assert recording.counts == {'/points': 2, '/depth/image': 2, '/depth/camera_info': 2,
                                    '/views/image': 2, '/projector/camera_info': 1}
        assert recording.latched == {'/projector/camera_info'}
        last = {message.topic: recording.decoded(message) for message in recording.messages()}
    views = np.frombuffer(last['/views/image'].data, np.uint8)
    assert np.mean(views & 2 > 0) > 0.5
    np.testing.assert_allclose(np.reshape(last['/projector/camera_info'].k, (3, 3)),
                               projected.projector().camera_matrix, atol=8)


def test_a_sample_made_again_holds_the_same(tmp_path, recorded, calibration, images):
    scene = tmp_path / 'scene'
    scene.mkdir()
    calibration.to_yaml(scene / 'left.yaml', scene / 'right.yaml')
    for side, image in zip(('left', 'right'), images):
        write_image(scene / f'{side}.png', image)
    np.savez(scene / 'truth.npz', depth=np.full((24, 32), 0.5, np.float32),
             visible=np.ones((24, 32), bool))
    for name in ('first', 'second'):
        assert cli.main(['sample', str(scene), str(tmp_path / name), '--pairs', '2',
                         '--range.min_depth', '0.3']) == 0
    files = [path.relative_to(tmp_path / 'first') for path in (tmp_path / 'first').rglob('*.*')
             if path.is_file()]
    assert sorted(path.name for path in files) == [
        'metadata.yaml', 'recording.mcap', 'settings.yaml', 'truth.npz']
    for path in files:
        if path.name != 'truth.npz':  # zip files carry the time of their making
            assert (tmp_path / 'first' / path).read_bytes() == (
                tmp_path / 'second' / path).read_bytes()


def test_a_recording_is_never_converted_onto_itself(tmp_path, capsys):
    recording = Path(__file__).resolve().parents[1] / 'sample' / 'solids_hue1' / 'recording'
    assert cli.main(['convert', str(recording), str(recording), '--overwrite']) == 2
    assert 'is the recording itself' in capsys.readouterr().err


def test_a_sample_is_never_written_into_its_scene(tmp_path, capsys):
    assert cli.main(['sample', str(tmp_path), str(tmp_path)]) == 2
    assert 'is the scene itself' in capsys.readouterr().err
