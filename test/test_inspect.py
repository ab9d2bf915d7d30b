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
"""`color_stereo inspect`: what is told of a recording is true, quickly told, and of use."""

from dataclasses import asdict, dataclass, replace
import json
import shlex
import sqlite3

from color_stereo_ros.cli import main as cli
from color_stereo_ros.cli.inspect import given_options
from color_stereo_ros.core import PatternSettings, StereoCalibration
from color_stereo_ros.messages.contents import (camera_info, CompressedImage, Header, image)
from color_stereo_ros.recordings import sampling
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.writing import write_recording
import cv2
import numpy as np
import other_bags
import pytest
from rosbags.rosbag2 import CompressionMode
from scenes import hue_pair, parallel_rig

SECOND = 1_000_000_000
PERIOD = SECOND // 10
START = 1_000 * SECOND
PAPER = ['--matching.method', 'paper', '--pattern.type', 'sweep', '--color.smoothing', '0',
         '--range.min_depth', '0.4', '--range.max_depth', '3']
NAMES = '/left/image_raw', '/right/image_raw', '/left/camera_info', '/right/camera_info'


@dataclass
class Text:
    """A content of the type std_msgs/String."""

    TYPE = 'std_msgs/msg/String'

    data: str


def record(path, images, infos=None, names=NAMES, rig=None, content=None, more=()):
    """
    Write a recording.

    Parameters
    ----------
    path : Path
        Of the file.
    images : iterable of (str, int, int)
        Side, time at which it is recorded and stamp, ns.
    infos : iterable of int
        Times of the camera_infos; None: the first time of the images.
    names : sequence of str
        The topics.
    rig : StereoCalibration
        None: a parallel one.
    content : callable
        Of (side, pixels, header), returns the content of an image.
    more : iterable of (str, int, object)
        Topic, time and content of other messages.

    """
    images = sorted(images, key=lambda row: row[1])
    pixels = dict(zip(('left', 'right'), hue_pair(8)))
    rig, content = rig or parallel_rig(), content or raw
    with write_recording(path) as writer:
        for time_ns in ([images[0][1]] if infos is None else infos):
            for name, camera in zip(names[2:], (rig.left, rig.right)):
                writer.write_content(name, time_ns,
                                     camera_info(camera, Header.at(time_ns, 'left_optical')))
        for topic, time_ns, message in more:
            writer.write_content(topic, time_ns, message, latched=True)
        for side, time_ns, stamp in images:
            message = content(side, pixels[side], Header.at(stamp, 'left_optical'))
            writer.write_content(names[side == 'right'], time_ns, message)
    return path


def raw(_, pixels, header):
    """Return the content of a raw image."""
    return image(pixels, 'rgb8', header)


def png(_, pixels, header):
    """Return the content of a compressed image."""
    data = cv2.imencode('.png', pixels[..., ::-1])[1]
    return CompressedImage(header, 'rgb8; png compressed bgr8', data)


def both(count, skew=0, period=PERIOD):
    """Return the images of so many pairs."""
    times = [START + index * period for index in range(count)]
    return [row for time_ns in times
            for row in (('left', time_ns, time_ns), ('right', time_ns + skew, time_ns + skew))]


def inspected(path, capsys, *options, status=0):
    """Return the findings of a recording."""
    assert cli.main(['inspect', str(path), *PAPER, *options, '--json']) == status
    return json.loads(capsys.readouterr().out)


def test_a_good_recording_is_told_with_the_command_that_measures_it(tmp_path, capsys):
    path = record(tmp_path / 'bag', both(11, skew=2_000_000))
    found = inspected(path, capsys)
    assert found['usable'] and found['problems'] == found['damage'] == []
    assert found['duration'] == pytest.approx(1.002)
    topics = {topic['name']: topic for topic in found['topics']}
    assert set(topics) == set(NAMES) and topics['/left/image_raw']['count'] == 11
    assert topics['/left/image_raw']['type'] == 'sensor_msgs/msg/Image'
    assert topics['/left/image_raw']['rate'] == pytest.approx(10 / 1.002)
    pairing = found['pairing']
    assert (pairing['share'], pairing['gaps'], pairing['stamps_backwards']) == (1, 0, 0)
    assert pairing['skew_median'] == pairing['skew_largest'] == pytest.approx(0.002)
    assert pairing['period'] == pytest.approx(0.1) and pairing['missing'] < 0.02
    assert found['calibration'] == {
        'usable': True, 'error': None, 'width': 64, 'height': 24, 'focal_length': 80.0,
        'baseline': 0.1, 'changes': 0}
    assert len(found['density']['pairs']) == 3 and found['density']['mean'] > 0.5
    assert found['density']['depth_median'] == pytest.approx(1.0, rel=0.01)
    assert found['images']['brightest'] > 100 and not found['images']['gray']
    words = shlex.split(found['command'])
    assert words[:4] == ['color_stereo', 'convert', str(path), 'bag_measured']
    assert given_options(cli.parsed(words[1:])) == given_options(cli.parsed(
        ['convert', 'bag', 'result', *PAPER]))


def test_the_text_has_a_line_for_each_finding(tmp_path, capsys):
    path = record(tmp_path / 'bag', both(5))
    assert cli.main(['inspect', str(path), *PAPER]) == 0
    said = capsys.readouterr().out
    starts = [line.split()[0] for line in said.splitlines() if not line.startswith(' ')]
    assert starts[:7] == ['recording', 'pair', 'pairing', 'calibration', 'images', 'pattern',
                          'density']
    assert starts[-2:] == ['verdict', 'next'] and 'nan' not in said and 'None' not in said
    assert '100% of 10 images have a partner' in said and 'baseline 100.00 mm' in said


OTHER = ('/stereo/left/image_color', '/stereo/right/image_color', '/stereo/left/camera_info',
         '/stereo/right/camera_info')
RECTIFIED = ('/cam/left/image_rect_color', '/cam/right/image_rect_color',
             '/cam/left/camera_info', '/cam/right/camera_info')


def compressed(names):
    """Return the names of topics whose images are compressed."""
    return (*(f'{name}/compressed' for name in names[:2]), *names[2:])


@pytest.mark.parametrize('names, content, expected', [
    (OTHER, raw, ['--left-image', OTHER[0], '--right-image', OTHER[1], '--left-info', OTHER[2],
                  '--right-info', OTHER[3]]),
    (RECTIFIED, raw, ['--left-image', RECTIFIED[0], '--right-image', RECTIFIED[1], '--left-info',
                      RECTIFIED[2], '--right-info', RECTIFIED[3], '--input.rectified', 'true']),
    (compressed(NAMES), png, ['--input.transport', 'compressed']),
    (compressed(OTHER), png, ['--left-image', f'{OTHER[0]}/compressed', '--right-image',
                              f'{OTHER[1]}/compressed', '--left-info', OTHER[2], '--right-info',
                              OTHER[3], '--input.transport', 'compressed'])])
def test_other_names_and_compressed_images_go_into_the_command(tmp_path, capsys, names, content,
                                                               expected):
    path = record(tmp_path / 'bag', both(4), names=names, content=content)
    found = inspected(path, capsys)
    words = shlex.split(found['command'])
    assert words[4:] == [*given_options(cli.parsed(['inspect', 'bag', *PAPER])), *expected]
    assert found['density']['mean'] > 0.5
    assert cli.main([*words[1:3], str(tmp_path / 'result'), *words[4:], '--workers', '1']) == 0


def test_missing_partners_gaps_and_stamps_that_go_back_are_told(tmp_path, capsys):
    images = [row for place, row in enumerate(both(24))
              if place not in (9, 21) and not 24 <= place < 32]  # right 4 and 10, pairs 12 .. 15
    images += [('left', START + 24 * PERIOD, START + 5 * PERIOD)]
    found = inspected(record(tmp_path / 'bag', images), capsys)
    pairing = found['pairing']
    assert pairing['images'] == 38 and pairing['share'] == pytest.approx(36 / 38)
    assert pairing['gaps'] == 1 and pairing['gap_longest'] == pytest.approx(0.5)
    assert pairing['stamps_backwards'] == 1 and pairing['missing'] > 0.1
    doubts = ' '.join(found['doubts'])
    assert 'images have no partner' in doubts and 'images are missing' in doubts
    assert 'stamps lie before' in doubts and found['usable']


@pytest.mark.parametrize('kind', ['MCAP', 'SQLite'])
def test_a_pause_between_the_places_is_found_by_the_index(tmp_path, capsys, kind):
    if kind == 'MCAP':
        images = [(side, time_ns + 7 * SECOND * (place >= 180), stamp)
                  for place, (side, time_ns, stamp) in enumerate(both(600))]
        path = record(tmp_path / 'bag', images)
    else:
        path = other_bags.recorded(tmp_path / 'bag', pairs=100)
        with sqlite3.connect(next(path.glob('*.db3'))) as connection:
            connection.execute('UPDATE messages SET timestamp = timestamp + 7000000000 '
                               'WHERE id > 30 * 4')
        metadata = path / 'metadata.yaml'
        metadata.write_text(metadata.read_text().replace('nanoseconds: 9900000000',
                                                         'nanoseconds: 16900000000'))
    found = inspected(path, capsys)
    assert found['pairing']['places'] == sampling.PLACES and found['pairing']['gaps'] == 0
    assert found['pairing']['pauses'] == 1
    assert found['pairing']['pause_longest'] == pytest.approx(7.1)
    assert '1 pauses of the left images, the longest of 7.10 s' in found['doubts']


def test_images_without_stamps_pair_up_and_are_doubted(tmp_path, capsys):
    images = [(side, time_ns, 0) for side, time_ns, _ in both(4)]
    found = inspected(record(tmp_path / 'bag', images), capsys)
    assert found['pairing']['stamps_zero'] == 8
    assert found['pairing']['period'] == pytest.approx(0.1)
    assert '8 images have no stamp' in found['doubts']


def test_cameras_that_are_not_synchronized_are_a_problem(tmp_path, capsys):
    found = inspected(record(tmp_path / 'bag', both(8, skew=49_000_000)), capsys,
                      status=cli.PARTLY)
    assert found['pairing']['share'] == 0 and found['command'] is None
    assert '--sync.tolerance widens' in found['problems'][0]
    wide = inspected(tmp_path / 'bag', capsys, '--sync.tolerance', '0.05')
    assert wide['pairing']['skew_largest'] == pytest.approx(0.049)
    assert '--sync.tolerance 0.05' in wide['command']


def test_a_pattern_that_was_recorded_is_used_and_named(tmp_path, capsys):
    shown = PatternSettings(type='sweep', width=640, height=400, feature_size=12.0)
    text = json.dumps({'pattern': asdict(shown), 'frame': 'pattern', 'sha256': 'f' * 64})
    path = record(tmp_path / 'bag', both(4), more=[('/pattern/info', START, Text(text))])
    found = inspected(path, capsys)
    assert found['pattern']['recorded'] == asdict(shown)
    assert found['command'].endswith('--pattern.width 640 --pattern.height 400 '
                                     '--pattern.feature_size 12.0')
    assert cli.main(['inspect', str(path), *PAPER]) == 0
    assert 'recorded: sweep, 640 x 400 px, feature size 12 px' in capsys.readouterr().out


@pytest.mark.parametrize('text, said', [
    ('{', 'pattern/info cannot be read'),
    ('{"pattern": {"type": "rainbow"}}', "pattern.type = 'rainbow' is not one of"),
    ('{"pattern": {}, "frame": "white"}', "showed 'white' instead of the pattern")])
def test_a_description_that_cannot_be_used_is_doubted(tmp_path, capsys, text, said):
    path = record(tmp_path / 'bag', both(2), more=[('/pattern/info', START, Text(text))])
    assert said in ' '.join(inspected(path, capsys)['doubts'])


def test_a_recorded_picture_of_the_pattern_is_told(tmp_path, capsys):
    picture = image(np.zeros((8, 8, 3), np.uint8), 'rgb8', Header.at(START, 'projector'))
    path = record(tmp_path / 'bag', both(2), more=[('/pattern/image', START, picture)])
    assert 'as an image' in inspected(path, capsys)['pattern']['recorded']


def test_a_missing_camera_info_is_a_problem_and_the_rest_is_told(tmp_path, capsys):
    path = record(tmp_path / 'bag', both(4), infos=[])
    found = inspected(path, capsys, status=cli.PARTLY)
    assert 'no topic /left/camera_info' in found['problems'][0] and found['command'] is None
    assert len(found['topics']) == 2


def test_a_calibration_that_is_refused_is_told_with_the_reason(tmp_path, capsys):
    K = [[80.0, 0, 31.5], [0, 80, 11.5], [0, 0, 1]]
    rig = StereoCalibration.from_arrays((64, 24), K, [], K, [], np.eye(3), [-0.1, 0, 0])
    single = replace(rig.right, P=rig.left.P)

    class Rig:
        left, right = rig.left, single
    found = inspected(record(tmp_path / 'bag', both(4), rig=Rig), capsys, status=cli.PARTLY)
    assert not found['calibration']['usable'] and 'calibration: ' in found['problems'][0]
    assert found['pairing']['share'] == 1 and found['images']['width'] == 64
    assert found['density'] is None


def test_a_camera_info_recorded_once_long_before_is_found(tmp_path, capsys):
    path = record(tmp_path / 'bag', both(100), infos=[START - 60 * SECOND])
    assert inspected(path, capsys)['calibration']['usable']


@pytest.mark.parametrize('kind', ['SQLite', 'compressed messages', 'ROS 1'])
def test_recordings_of_others_are_inspected(tmp_path, capsys, kind):
    if kind == 'ROS 1':
        path = other_bags.recorded_by_ros1(tmp_path / 'bag.bag') or tmp_path / 'bag.bag'
    else:
        mode = CompressionMode.MESSAGE if kind == 'compressed messages' else None
        path = other_bags.recorded(tmp_path / 'bag', pairs=40, mode=mode)
    found = inspected(path, capsys)
    assert found['pairing']['share'] == 1 and found['pairing']['period'] == pytest.approx(0.1)
    assert found['density']['depth_median'] == pytest.approx(other_bags.DEPTH, rel=0.01)
    assert found['pairing']['pauses'] == 0
    with Recording(path) as recording:
        times = recording.record_times('/left/image_raw')
        assert len(times) == recording.counts['/left/image_raw'] and (np.diff(times) > 0).all()
    assert found['pairing']['places'] == (1 if kind == 'ROS 1' else sampling.PLACES)


def gray(_, pixels, header):
    """Return the content of an image without colors."""
    return image(cv2.cvtColor(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB),
                 'rgb8', header)


def dim(_, pixels, header):
    """Return the content of an image that is too dark."""
    return image(pixels // 3, 'rgb8', header)


def twin(_, pixels, header):
    """Return the content of the left image, whatever the side."""
    return image(hue_pair(8)[0], 'rgb8', header)


def exchanged(side, pixels, header):
    """Return the content of the image of the other side."""
    return image(hue_pair(8)[side == 'left'], 'rgb8', header)


@pytest.mark.parametrize('content, said', [
    (dim, 'raise exposure by'), (twin, 'left and right image are identical'),
    (exchanged, 'left and right image swapped?')])
def test_what_is_odd_about_the_images_is_told(tmp_path, capsys, content, said):
    path = record(tmp_path / 'bag', both(3), content=content)
    cli.main(['inspect', str(path), *PAPER, '--json'])
    found = json.loads(capsys.readouterr().out)
    assert said in ' '.join(found['doubts'])


def test_gray_cameras_are_told(tmp_path, capsys):
    path = record(tmp_path / 'bag', both(3), content=gray)
    cli.main(['inspect', str(path), *PAPER, '--json'])
    assert json.loads(capsys.readouterr().out)['images']['gray']


def test_of_a_long_recording_a_few_places_are_read(tmp_path, capsys, monkeypatch):
    path = record(tmp_path / 'bag', both(600))
    read = []
    decoded = Recording.decoded

    def counted(self, message):
        read.append(message.time_ns)
        return decoded(self, message)
    monkeypatch.setattr(Recording, 'decoded', counted)
    found = inspected(path, capsys)
    most = 2 * sampling.PLACES * (sampling.PAIRS + 1) + 2
    assert 2 * sampling.PLACES * (sampling.PAIRS - 1) <= len(read) <= most
    assert min(read) == START and max(read) == START + 599 * PERIOD
    assert found['pairing']['places'] == sampling.PLACES and found['pairing']['share'] == 1
    assert found['pairing']['gaps'] == 0 and len(found['density']['pairs']) == sampling.PLACES


def test_cameras_that_were_recorded_for_a_part_of_the_time_are_told(tmp_path, capsys):
    path = record(tmp_path / 'bag', both(100), infos=[START, START + 300 * SECOND])
    found = inspected(path, capsys)
    assert 'places hold no image' in ' '.join(found['doubts']) and found['usable']


def test_a_file_that_ends_early_is_told_and_what_is_whole_is_measured(tmp_path, capsys):
    path = record(tmp_path / 'bag', both(300))
    content = (path / 'bag.mcap').read_bytes()
    (path / 'bag.mcap').write_bytes(content[:len(content) * 3 // 4])
    found = inspected(path, capsys, status=cli.PARTLY)
    assert 'can be read up to byte' in ' '.join(found['damage'])
    assert found['usable'] and found['density']['mean'] > 0.5


def test_a_cut_anywhere_is_told(tmp_path, capsys, effort):
    path = record(tmp_path / 'bag', both(60))
    content = (path / 'bag.mcap').read_bytes()
    for seed in range(effort.count(4, 100)):
        cut = int(np.random.default_rng(seed).integers(1, len(content)))
        (path / 'bag.mcap').write_bytes(content[:cut])
        status = cli.main(['inspect', str(path), *PAPER, '--json'])
        found = json.loads(capsys.readouterr().out)
        assert status == cli.PARTLY and found['damage'] or status == cli.FAILURE
        assert found['usable'] or found['problems']


def test_flipped_bytes_never_end_in_a_crash(tmp_path, capsys, effort):
    path = record(tmp_path / 'bag', both(60))
    content = (path / 'bag.mcap').read_bytes()
    for seed in range(effort.count(6, 100)):
        changed = bytearray(content)
        places = np.random.default_rng(seed).integers(8, len(content), 20)
        changed[places[0]] ^= 255
        for place in places[1:1 + seed]:
            changed[place] ^= 1
        (path / 'bag.mcap').write_bytes(bytes(changed))
        status = cli.main(['inspect', str(path), *PAPER, '--json'])
        assert status in (0, cli.FAILURE, cli.PARTLY)
        assert isinstance(json.loads(capsys.readouterr().out)['usable'], bool)


def test_what_is_no_recording_is_told_in_both_forms(tmp_path, capsys):
    assert cli.main(['inspect', str(tmp_path / 'nothing')]) == 1
    assert 'there is no such recording' in capsys.readouterr().err
    assert cli.main(['inspect', str(tmp_path / 'nothing'), '--json']) == 1
    found = json.loads(capsys.readouterr().out)
    assert not found['usable'] and 'there is no such recording' in found['problems'][0]


def test_several_pairs_are_told_apart_by_namespace(tmp_path, capsys):
    with write_recording(tmp_path / 'bag') as writer:
        for index in range(3):
            for name in ('a', 'b'):
                writer.write_pair(START + index * PERIOD, *hue_pair(8), parallel_rig(),
                                  namespace=name)
    found = inspected(tmp_path / 'bag', capsys)
    assert found['doubts'] == ['there is another pair: /b/left/image_raw and /b/right/image_raw']
    assert '--left-image /a/left/image_raw' in found['command']
    found = inspected(tmp_path / 'bag', capsys, '--namespace', 'b')
    assert not found['doubts'] and '--namespace b' in found['command']
