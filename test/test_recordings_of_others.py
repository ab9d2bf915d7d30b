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
"""Recordings as they come: other names, stamps and formats, ROS 1, damaged messages."""

import sqlite3
import struct

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import RecordingError
from color_stereo_ros.messages.contents import CameraInfo, Image
from color_stereo_ros.recordings.reading import Recording, seconds
from color_stereo_ros.recordings.refusals import Refusals
from color_stereo_ros.recordings.times import OutputTimes
from color_stereo_ros.recordings.topics import guessed_pairs
import numpy as np
from other_bags import (DEPTH, OTHER, PERIOD, recorded, recorded_by_ros1, SECOND, USUAL,
                        usual_stamp)
import pytest
from rosbags.rosbag2 import CompressionMode

OPTIONS = ['--matching.method', 'paper', '--range.min_depth', '0.5', '--range.max_depth', '2',
           '--color.smoothing', '0', '--matching.min_segment', '4', '--topics', 'depth/image',
           'depth/camera_info']


def converted(tmp_path, recording, capsys, *options):
    """Return (status, what was said) of a conversion into tmp_path / 'result'."""
    status = cli.main(['convert', str(recording), str(tmp_path / 'result'), *OPTIONS, *options])
    return status, capsys.readouterr()


def depths(path):
    """Return [(topic, time of the message, stamp, median depth), ...] of a result."""
    with Recording(path) as recording:
        found = []
        for message in recording.messages():
            content = recording.decoded(message)
            if message.type == Image.TYPE:
                median = np.nanmedian(np.asarray(content.data).view(np.float32))
                stamp = content.header.stamp
                found.append((message.topic, message.time_ns,
                              stamp.sec * SECOND + stamp.nanosec, median))
    return found


def assert_all_measured(path, topic='/depth/image', times=None, stamps=None, pairs=3):
    """Check topics, times, stamps and depths of a result."""
    found = depths(path)
    usual = [usual_stamp(index) for index in range(pairs)]
    assert [row[0] for row in found] == pairs * [topic]
    assert [row[1] for row in found] == (usual if times is None else times)
    assert [row[2] for row in found] == (usual if stamps is None else stamps)
    assert [row[3] for row in found] == pytest.approx(pairs * [DEPTH], rel=0.01)


STAMPS = {
    'usual': usual_stamp,
    'negative': lambda index: -5 * SECOND + index * PERIOD,
    'zero': lambda index: 0,
    'negative, then a clock that was set': lambda index: (-SECOND, 0, usual_stamp(2))[index],
    'zero once': lambda index: (usual_stamp(0), 0, usual_stamp(2))[index],
    'since the start of the camera': lambda index: SECOND + index * PERIOD,
}


@pytest.mark.parametrize('kind', STAMPS)
def test_pairs_of_any_stamp_are_measured_and_stand_in_the_order_of_recording(
        tmp_path, capsys, kind):
    status, said = converted(tmp_path, recorded(tmp_path / 'bag', stamp=STAMPS[kind]), capsys)
    assert status == 0 and '3 pairs measured, 0 refused' in said.out
    stamps = [STAMPS[kind](index) for index in range(3)]
    times = stamps if kind == 'since the start of the camera' else None
    assert_all_measured(tmp_path / 'result', times=times, stamps=stamps)


@pytest.mark.parametrize('pairs, times', [
    ([(5, 105), (6, 106)], [5, 6]),
    ([(0, 105), (6, 106)], [105, 106]),
    ([(-5, 105), (-4, 106)], [105, 106]),
    ([(5, 105), (0, 106), (7, 107)], [5, 6, 7]),
    ([(0, -5)], [0])])
def test_the_time_of_an_output_is_its_stamp_where_that_is_usable(pairs, times):
    clock = OutputTimes()
    assert [clock.of(*pair) for pair in pairs] == times


def cut(data):
    """Return the first half of a message."""
    return data[:len(data) // 2]


def with_bad_text(data):
    """Return a message whose frame_id is no text."""
    return data.replace(b'left_optical', b'\xff' * 12)


def with_long_text(data):
    """Return a message that announces a frame_id of 4 GB."""
    return data[:12] + struct.pack('<I', 0xfffffff0) + data[16:]


DAMAGES = {'cut': cut, 'no text': with_bad_text, 'long text': with_long_text,
           'empty': lambda data: b'', 'zeros': lambda data: bytes(len(data)),
           'another encapsulation': lambda data: b'\x00\x09' + data[2:]}


@pytest.mark.parametrize('kind, topic', [*((kind, USUAL[0]) for kind in DAMAGES),
                                         ('cut', USUAL[1]), ('cut', USUAL[2])])
def test_a_message_that_cannot_be_decoded_is_refused_and_the_rest_measured(
        tmp_path, capsys, kind, topic):
    def damage(index, name, data):
        return DAMAGES[kind](data) if (index, name) == (1, topic) else None

    status, said = converted(tmp_path, recorded(tmp_path / 'bag', damage=damage), capsys)
    assert 'Traceback' not in said.out + said.err
    found = depths(tmp_path / 'result')
    assert [row[3] for row in found] == pytest.approx(len(found) * [DEPTH], rel=0.01)
    if kind == 'zeros':  # a legal message without pixels
        return
    assert status == cli.PARTLY
    assert f'the message on {topic} at {seconds(usual_stamp(1))} s is damaged' in said.err
    assert f'1 messages refused (1 on {topic})' in said.err.splitlines()[-1]
    assert len(found) == (3 if topic == USUAL[2] else 2)


def test_a_message_that_cannot_be_unpacked_is_refused_and_the_rest_measured(tmp_path, capsys):
    path = recorded(tmp_path / 'bag', mode=CompressionMode.MESSAGE)
    database = sqlite3.connect(path / 'bag.db3')
    database.execute('UPDATE messages SET data = ? WHERE timestamp = ? AND topic_id = '
                     '(SELECT id FROM topics WHERE name = ?)',
                     (b'\x28\xb5\x2f\xfd' + bytes(4), usual_stamp(1), USUAL[0]))
    database.commit()
    database.close()
    status, said = converted(tmp_path, path, capsys)
    assert status == cli.PARTLY
    assert (f'{USUAL[0]} at {seconds(usual_stamp(1))} s is damaged: it cannot be unpacked'
            in said.err)
    assert [row[1] for row in depths(tmp_path / 'result')] == [usual_stamp(0), usual_stamp(2)]


def test_a_pair_that_is_refused_shows_in_the_exit_status_with_topic_and_time(tmp_path, capsys):
    def damage(index, name, data):
        return data.replace(b'rgb8', b'rgbX') if (index, name) == (1, USUAL[1]) else None

    status, said = converted(tmp_path, recorded(tmp_path / 'bag', damage=damage), capsys)
    assert status == cli.PARTLY
    assert '2 pairs measured, 1 refused' in said.out
    assert f'recorded at {seconds(usual_stamp(1))} s, refused: {USUAL[1]}: ' in said.err
    assert 'warning: 1 pairs refused; the first: pair of stamp' in said.err.splitlines()[-1]


def gray(image):
    return np.repeat(image.mean(2, keepdims=True).astype(np.uint8), 3, 2)


@pytest.mark.parametrize('seen, words', [
    (lambda left, right: (left, right), None),
    (lambda left, right: (right, left), 'left and right image swapped?'),
    (lambda left, right: (left, left), 'left and right image are identical'),
    (lambda left, right: (left, gray(right)), 'the right image is gray'),
    (lambda left, right: (left // 99, right // 99), 'hardly any pixel has a range')])
def test_odd_pairs_are_told_once_as_process_tells_them(tmp_path, capsys, seen, words):
    status, said = converted(tmp_path, recorded(tmp_path / 'odd', seen=seen), capsys)
    assert status == 0
    if words is None:
        assert 'warning: ' not in said.err
    else:
        assert said.err.count(f'warning: {words}') == 1


def test_of_many_odd_pairs_only_the_first_are_told(tmp_path, capsys):
    shapes = [lambda left, right: (left, right), lambda left, right: (left // 99, right // 99)]
    turns = iter(12 * shapes)
    bag = recorded(tmp_path / 'odd', pairs=24, seen=lambda *pair: next(turns)(*pair))
    status, said = converted(tmp_path, bag, capsys)
    assert status == 0 and said.err.count('warning: hardly any pixel has a range') == 5
    assert said.err.count('more pairs are odd') == 1


def test_many_refused_pairs_are_counted_and_only_the_first_are_told(tmp_path, capsys):
    def damage(index, name, data):
        return data.replace(b'rgb8', b'rgbX') if index and name == USUAL[1] else None

    path = recorded(tmp_path / 'bag', pairs=12, damage=damage)
    status, said = converted(tmp_path, path, capsys)
    assert status == cli.PARTLY and '1 pairs measured, 11 refused' in said.out
    assert said.err.count('refused: ') == 6 and '11 pairs refused' in said.err


def test_a_recording_of_damaged_messages_only_has_no_result(tmp_path, capsys):
    status, said = converted(tmp_path, recorded(tmp_path / 'bag', damage=lambda *_: b''), capsys)
    assert status == cli.FAILURE
    assert 'no pair could be measured: 12 messages refused' in said.err
    assert not (tmp_path / 'result').exists()


def test_many_refusals_are_counted_and_only_the_first_are_told():
    told = []
    refusals = Refusals(told.append)
    with_topic = type('Message', (), {'topic': '/left/image_raw'})
    for _ in range(1000):
        refusals.add(with_topic, 'reason')
    assert len(refusals) == 1000 and len(told) == 6
    assert str(refusals) == '1000 messages refused (1000 on /left/image_raw)'


@pytest.mark.parametrize('time_ns, text', [
    (0, '0.000000000'), (1_500_000_000, '1.500000000'), (-5_100_000_000, '-5.100000000'),
    (2**62, '4611686018.427387904')])
def test_times_are_told_without_rounding(time_ns, text):
    assert seconds(time_ns) == text


@pytest.mark.parametrize('mode', [None, CompressionMode.MESSAGE, CompressionMode.FILE])
def test_folders_are_read_however_they_are_compressed(tmp_path, capsys, mode):
    assert converted(tmp_path, recorded(tmp_path / 'bag', mode=mode), capsys)[0] == 0
    assert_all_measured(tmp_path / 'result')


def test_a_ros1_bag_is_read(tmp_path, capsys):
    status, said = converted(tmp_path, recorded_by_ros1(tmp_path / 'old.bag'), capsys)
    assert status == 0, said.err
    assert_all_measured(tmp_path / 'result')


def test_a_ros1_bag_has_the_bytes_of_the_same_ros2_recording(tmp_path):
    with Recording(recorded(tmp_path / 'bag')) as new, \
            Recording(recorded_by_ros1(tmp_path / 'old.bag')) as old:
        assert old.topics == new.topics and old.counts == new.counts
        assert old.duration == pytest.approx(new.duration, abs=1e-9)
        assert ({(row.topic, row.time_ns): row.data for row in old.messages()}
                == {(row.topic, row.time_ns): row.data for row in new.messages()})


def gzip_file(folder):
    """Write a file that begins as gzip does."""
    path = folder / 'bag.db3.gz'
    path.write_bytes(b'\x1f\x8b' + bytes(30))
    return path


def without_metadata(folder):
    """Return a folder whose metadata.yaml is missing."""
    path = recorded(folder / 'bag')
    (path / 'metadata.yaml').unlink()
    return path


def misnamed(folder):
    """Return a file whose name does not say what it is."""
    path = recorded(folder / 'bag') / 'bag.db3'
    return path.rename(path.with_suffix('.backup'))


def unfinished_ros1(folder):
    """Return a ROS 1 bag whose index is missing."""
    path = recorded_by_ros1(folder / 'old.bag')
    content = bytearray(path.read_bytes())
    at = content.index(b'index_pos=') + 10
    content[at:at + 8] = bytes(8)
    path.write_bytes(content)
    return path


ADVICE = {
    'zstd file': (lambda folder: recorded(folder / 'bag', mode=CompressionMode.FILE)
                  / 'bag.db3.zstd', 'compressed with zstd, not a recording: give the folder'),
    'messages': (lambda folder: recorded(folder / 'bag', mode=CompressionMode.MESSAGE)
                 / 'bag.db3', 'its messages are compressed with zstd, .*give the folder .*bag$'),
    'gzip': (gzip_file, 'compressed with gzip, .*gunzip bag.db3.gz'),
    'metadata': (lambda folder: recorded(folder / 'bag') / 'metadata.yaml', 'give its folder'),
    'no metadata': (without_metadata, 'it holds bag.db3: name one of these files'),
    'misnamed': (misnamed, 'its name must end with .db3'),
    'unfinished ROS 1': (unfinished_ros1, 'reindex'),
}


@pytest.mark.parametrize('kind', ADVICE)
def test_what_must_be_given_in_another_way_is_told_in_one_sentence(tmp_path, kind):
    make, expected = ADVICE[kind]
    with pytest.raises(RecordingError, match=expected) as refused:
        Recording(make(tmp_path))
    assert '\n' not in str(refused.value)


def named(names=OTHER):
    """Return the options that name four topics."""
    return [word for option, name in zip(
        ('--left-image', '--right-image', '--left-info', '--right-info'), names)
        for word in (option, name)]


@pytest.mark.parametrize('options', [
    named(), named()[:4], named([name[1:] for name in OTHER]),
    ['--namespace', 'stereo', '--left-image', 'left/image_color', '--right-image',
     '/stereo/right/image_color']])
def test_topics_of_other_names_are_measured(tmp_path, capsys, options):
    path = recorded(tmp_path / 'bag', names=OTHER)
    status, said = converted(tmp_path, path, capsys, *options)
    assert status == 0, said.err
    assert_all_measured(tmp_path / 'result', '/stereo/depth/image')


def test_the_question_of_a_refusal_is_the_answer(tmp_path, capsys):
    path = recorded(tmp_path / 'bag', names=OTHER)
    status, said = converted(tmp_path, path, capsys)
    question = f'did you mean {" ".join(named())}?'
    assert status == cli.FAILURE and question in said.err
    words = question.removeprefix('did you mean ').rstrip('?').split()
    assert converted(tmp_path, path, capsys, *words)[0] == 0


def test_names_without_the_first_slash_are_found(tmp_path, capsys):
    path = recorded(tmp_path / 'bag', names=[name[1:] for name in USUAL])
    assert converted(tmp_path, path, capsys)[0] == 0
    assert_all_measured(tmp_path / 'result')


PAIRS = [
    ('/stereo/{}/image_color', ('left', 'right')),
    ('/camera/{}/image_rect_raw', ('infra1', 'infra2')),
    ('/{}/image_raw', ('cam0', 'cam1')),
    ('/{}_camera/image', ('left', 'right')),
    ('/zed/{}/image_raw_color', ('left', 'right')),
    ('/my_camera_{}/image', ('l', 'r')),
    ('/rig/camera_{}/image_raw', ('1', '2')),
]


@pytest.mark.parametrize('form, sides', PAIRS)
def test_a_stereo_pair_is_guessed_from_its_names(form, sides):
    images = [form.format(side) for side in sides]
    infos = [f'{name.rpartition("/")[0]}/camera_info' for name in images]
    types = {**dict.fromkeys(images, Image.TYPE), **dict.fromkeys(infos, CameraInfo.TYPE),
             '/left/depth/image': Image.TYPE, '/right/depth/image': Image.TYPE,
             '/tf': 'tf2_msgs/msg/TFMessage'}
    found = guessed_pairs(types, dict.fromkeys(types, 3))
    assert [pair.names for pair in found] == [(*images, *infos)]
    assert guessed_pairs(types, dict.fromkeys(types, 0)) == []


def test_raw_images_are_guessed_before_rectified_and_gray_ones():
    types = {f'/{side}/{name}': Image.TYPE for side in ('left', 'right')
             for name in ('image_mono', 'image_rect_color', 'image_color', 'image_rect')}
    found = guessed_pairs(types, dict.fromkeys(types, 3))
    assert [pair.names[:2] for pair in found] == [('/left/image_color', '/right/image_color')]


def test_several_guesses_are_all_named(tmp_path, capsys):
    names = ['/cam0/image', '/cam1/image', '/cam0/camera_info', '/cam1/camera_info']
    with Recording(recorded(tmp_path / 'bag', names=names)) as recording:
        recording.topics |= {'/cam2/image': Image.TYPE, '/cam2/camera_info': CameraInfo.TYPE}
        recording.counts |= {'/cam2/image': 1, '/cam2/camera_info': 1}
        with pytest.raises(RecordingError) as refused:
            recording.stereo_topics()
    assert ('did you mean one of these pairs: /cam0/image and /cam1/image; /cam1/image and '
            '/cam2/image?') in str(refused.value)


def test_compressed_images_are_named_as_such(tmp_path):
    with Recording(recorded(tmp_path / 'bag')) as recording:
        kind = 'sensor_msgs/msg/CompressedImage'
        recording.topics = {f'{name}/compressed': kind for name in USUAL[:2]}
        recording.counts = dict.fromkeys(recording.topics, 3)
        with pytest.raises(RecordingError, match='image_transport republish'):
            recording.stereo_topics()


def test_compressed_images_under_the_usual_name_are_named_as_such(tmp_path):
    with Recording(recorded(tmp_path / 'bag')) as recording:
        recording.topics['/left/image_raw'] = 'sensor_msgs/msg/CompressedImage'
        with pytest.raises(RecordingError, match='expected sensor_msgs.*transport republish'):
            recording.stereo_topics()


@pytest.mark.parametrize('options, what', [
    (['--right-image', USUAL[0], '--right-info', USUAL[3]], 'images'),
    (['--right-info', USUAL[2]], 'camera_infos')])
def test_one_topic_is_not_that_of_both_cameras(tmp_path, capsys, options, what):
    status, said = converted(tmp_path, recorded(tmp_path / 'bag'), capsys, *options)
    assert status == 1 and f'is named for the {what} of both cameras' in said.err


def test_a_line_about_thousands_of_topics_has_an_end(tmp_path, capsys):
    bag = recorded(tmp_path / 'bag', names=[f'/{index}{"x" * 5000}' for index in range(4)])
    status, said = converted(tmp_path, bag, capsys)
    assert status == 1 and 'no topic ends with /left/image_raw' in said.err
    assert len(said.err) < 2000
