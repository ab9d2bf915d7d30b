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
"""~/capture and ~/save over real DDS: one pair on request, and its points as a file."""

from dataclasses import replace
from pathlib import Path

from color_stereo_ros.core import SettingsError
from color_stereo_ros.nodes.sensor.save import SaveFolder
from color_stereo_ros.parameters.groups import OutputSettings

import numpy as np

import pytest

from rclpy.qos import QoSDurabilityPolicy, QoSProfile

from ros_rig import NodeProcess, PAPER, Rig, scene, silent_rig

from sensor_msgs.msg import Image

from std_msgs.msg import Header

from std_srvs.srv import Trigger


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    """Yield a rig without any listener, and its node."""
    folder = tmp_path_factory.mktemp('capture')
    saved = folder / 'saved'
    saved.mkdir()
    limits = {'output.save_directory': saved, 'output.save_limit': 3, 'capture.timeout': 2.0}
    with silent_rig(folder, **limits) as rig:
        rig.folder = saved
        # else the first pair may come before its calibration on a busy machine
        rig.feed(lambda parts: parts['calibration'].message == 'calibrated', 'a calibration')
        yield rig


@pytest.fixture
def rig(running):
    """Yield the rig with a node that streams."""
    running.received.clear()
    assert running.set_parameters(input__mode='stream', output__save_format='ply').successful
    yield running
    for file in running.folder.iterdir():
        file.unlink()


def trigger(rig, name, feed_pairs=True, age=0, skew=0):
    """Call a trigger service while pairs arrive; age and skew of their stamps in ns."""
    def send():
        # a stamp of now, as a camera gives it
        rig.stamp = rig.node.get_clock().now().nanoseconds - age
        rig.send_infos()
        rig.send_image('left', rig.stamp)
        rig.send_image('right', rig.stamp + skew)

    timer = rig.node.create_timer(0.1, send) if feed_pairs else None
    try:
        return rig.call(Trigger, f'{rig.target}/{name}', Trigger.Request())
    finally:
        if timer:
            rig.node.destroy_timer(timer)


def test_capture_measures_one_pair_on_request_and_no_other(rig):
    assert rig.set_parameters(input__mode='capture').successful
    rig.listen(Image, 'depth/image')
    rig.listen(Header, 'range_node/acquired')
    rig.wait_for_publishers()
    rig.feed(lambda p: '~/capture' in p['range images'].message, 'the mode')
    assert rig.received['depth/image'] == []
    before = rig.node.get_clock().now().nanoseconds
    answer = trigger(rig, 'capture')
    assert answer.success, answer.message
    depth = rig.spin_until(lambda: rig.received['depth/image'], 'the captured depth')
    rig.spin(0.3)
    assert len(depth) == 1
    stamp = depth[0].header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec >= before
    acquired = rig.received['range_node/acquired']
    assert [header.stamp for header in acquired] == [stamp]
    assert answer.message.startswith(f'stamp {stamp.sec}.{stamp.nanosec:09d}: ')
    assert answer.message.endswith('% of the pixels have a range')


def test_capture_works_while_streaming(rig):
    assert trigger(rig, 'capture').success


def test_capture_without_cameras_fails_with_the_reason(rig):
    answer = trigger(rig, 'capture', feed_pairs=False)
    assert not answer.success
    assert 'no pair for' in answer.message and 'any more' in answer.message


def test_capture_gives_the_reason_of_images_that_do_not_pair_up(rig):
    rig.set_parameters(sync__tolerance=0.01)
    trigger(rig, 'capture', skew=450_000_000)  # the pairs before are of good stamps
    answer = trigger(rig, 'capture', skew=450_000_000)
    rig.set_parameters(sync__tolerance=0.0)
    rig.stamp = rig.node.get_clock().now().nanoseconds
    assert not answer.success
    assert 'both images arrive, but their stamps differ by 450.0 ms' in answer.message
    assert 'any more' not in answer.message and 'has arrived yet' not in answer.message


LATCHED = QoSProfile(depth=10, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


def test_late_joiners_get_the_last_result_of_a_capture(rig):
    assert rig.set_parameters(input__mode='capture').successful
    trigger(rig, 'capture')
    stamp = trigger(rig, 'capture').message.split()[1].rstrip(':').replace('.', '')
    rig.listen(Image, 'status/image')  # the first one: the message is built for it
    rig.spin_until(lambda: rig.received['status/image'], 'the last status')
    rig.received['late'] = []
    rig.node.create_subscription(Image, 'status/image', rig.received['late'].append, LATCHED)
    rig.spin_until(lambda: rig.received['late'], 'the last status again')
    rig.spin(0.6)
    assert rig.stamps('status/image') == rig.stamps('late') == [int(stamp)]


def test_a_stream_has_no_late_messages_and_the_mode_changes_while_running(rig):
    rig.set_parameters(input__mode='capture')
    assert trigger(rig, 'capture').success
    assert durability(rig, 'depth/image') == QoSDurabilityPolicy.TRANSIENT_LOCAL
    assert rig.set_parameters(input__mode='stream').successful
    assert durability(rig, 'depth/image') == QoSDurabilityPolicy.VOLATILE
    rig.listen(Image, 'depth/image')
    rig.spin(1.0)
    assert rig.received['depth/image'] == []
    rig.good_pair()


def durability(rig, topic):
    """Return the durability that the one publisher of a topic offers."""
    name = rig.node.resolve_topic_name(topic)

    def offered():
        found = rig.node.get_publishers_info_by_topic(name)
        return found[0].qos_profile.durability if len(found) == 1 else None

    return rig.spin_until(offered, 'one publisher')


def test_motion_between_the_pairs_is_named(rig):
    rig.set_parameters(capture__pairs=6)
    still, moved = rig.images, dict(zip(('left', 'right'), scene(disparity=14)))
    sent = []

    def send():
        rig.images = still if len(sent) % 16 < 8 else moved
        sent.append(rig.send_pair(rig.node.get_clock().now().nanoseconds))

    timer = rig.node.create_timer(0.1, send)
    rig.spin_until(lambda: len(sent) >= 5, 'some pairs')
    answers = []
    while not any('moved' in answer.message for answer in answers):
        answers.append(rig.call(Trigger, f'{rig.target}/capture', Trigger.Request()))
        assert answers[-1].success and len(answers) < 20
    rig.node.destroy_timer(timer)
    rig.images = still
    rig.set_parameters(capture__pairs=1)
    assert 'fused from 6 pairs; the scene moved meanwhile: ' in answers[-1].message
    assert 'of the ranges are left out (status MOVED)' in answers[-1].message


def read_ply(path):
    """Return the vertices of a binary PLY file."""
    header, _, body = path.read_bytes().partition(b'end_header\n')
    count = int(header.split(b'element vertex ')[1].split()[0])
    kinds = np.dtype([('xyz', '<f4', 3), ('rgb', 'u1', 3)])
    assert len(body) == count * kinds.itemsize
    return np.frombuffer(body, kinds)


def test_the_services_are_those_of_the_node_itself(rig):
    def services():
        found = rig.node.get_service_names_and_types_by_node(
            rig.target.rpartition('/')[2], rig.target.rpartition('/')[0] or '/')
        return {name for name, _ in found}

    names = {f'{rig.target}/{name}' for name in ('capture', 'save', 'set_parameters')}
    assert rig.spin_until(lambda: names <= services(), 'the services that `ros2 node info` shows')


@pytest.mark.parametrize('suffix', ['ply', 'pcd'])
def test_save_writes_a_file_and_names_it(rig, suffix):
    assert rig.set_parameters(output__save_format=suffix).successful
    answer = trigger(rig, 'save')
    assert answer.success, answer.message
    path, _, count = answer.message.rpartition(': ')
    files = list(rig.folder.glob(f'range_node_*.{suffix}'))
    assert [str(file) for file in files] == [path]
    assert int(count.split()[0]) > 1000
    assert not list(rig.folder.glob('.range_node*'))
    if suffix == 'ply':
        points = read_ply(files[0])
        assert np.median(points['xyz'][:, 2]) == pytest.approx(0.36, rel=0.01)


def test_save_keeps_to_the_region_and_the_decimation(rig):
    def saved(**parameters):
        rig.set_parameters(**parameters)
        answer = trigger(rig, 'save')
        assert answer.success, answer.message
        return read_ply(Path(answer.message.rpartition(': ')[0]))

    whole = saved(output__decimation=1)
    try:
        part = saved(output__decimation=2, output__region='-1 0 -1 1 0 1')
    finally:
        rig.set_parameters(output__decimation=1, output__region='')
    assert 0.15 < len(part) / np.count_nonzero(whole['xyz'][:, 0] <= 0) < 0.35
    assert {point.tobytes() for point in part} <= {point.tobytes() for point in whole}


def test_save_in_capture_mode_writes_what_was_captured(rig):
    assert rig.set_parameters(input__mode='capture').successful
    captured = trigger(rig, 'capture')
    answer = trigger(rig, 'save', feed_pairs=False)
    assert answer.success, answer.message
    stamp = captured.message.split()[1].rstrip(':').replace('.', '')
    assert f'range_node_{stamp}.ply' in answer.message


def test_save_replaces_nothing_and_follows_no_link(rig, tmp_path):
    assert rig.set_parameters(input__mode='capture').successful
    stamp = trigger(rig, 'capture').message.split()[1].rstrip(':').replace('.', '')
    (tmp_path / 'theirs').write_text('theirs')
    (rig.folder / f'range_node_{stamp}.ply').symlink_to(tmp_path / 'theirs')
    answer = trigger(rig, 'save', feed_pairs=False)
    assert answer.success, answer.message
    assert f'{rig.folder}/range_node_{stamp}_2.ply: ' in answer.message
    assert (tmp_path / 'theirs').read_text() == 'theirs'
    assert (rig.folder / f'range_node_{stamp}.ply').is_symlink()


def test_save_leaves_no_more_files_than_its_limit(rig):
    answers = [trigger(rig, 'save') for _ in range(4)]
    assert [answer.success for answer in answers] == [True] * 3 + [False]
    assert 'holds 3 files of this node, output.save_limit = 3' in answers[3].message
    assert len(list(rig.folder.iterdir())) == 3


@pytest.mark.parametrize('values', [
    {'output__save_directory': '/tmp'}, {'output__save_directory': ''},
    {'output__save_directory': '..'}, {'output__save_directory': 'x' * 100_000},
    {'output__save_limit': 1_000_000}, {'output__save_directory_fixed': False}])
def test_a_peer_cannot_choose_where_and_how_much_is_saved(rig, values):
    result = rig.set_parameters(**values)
    assert not result.successful
    assert 'set it at the start' in result.reason and len(result.reason) < 500


@pytest.fixture
def folder_of(tmp_path):
    """Return a function that makes the SaveFolder of a node that may change the folder."""
    def build(name=''):
        (tmp_path / 'root' / 'inner').mkdir(parents=True, exist_ok=True)
        settings = OutputSettings(save_directory=str(tmp_path / 'root' / name),
                                  save_directory_fixed=False)
        return SaveFolder(settings), settings
    return build


@pytest.mark.parametrize('name', ['inner', './inner', 'inner/..', 'inner/later'])
def test_a_folder_that_is_not_fixed_can_be_changed_inside_of_the_first_one(
        folder_of, tmp_path, name):
    folder, settings = folder_of()
    changed = replace(settings, save_directory=name)
    folder.check(changed)
    assert folder.path(changed) == (tmp_path / 'root' / name).resolve()


@pytest.mark.parametrize('name', ['..', '/', '/tmp', 'inner/../..', 'link', 'link/deeper', '\0'])
def test_no_path_leads_out_of_the_folder_given_at_the_start(folder_of, tmp_path, name):
    folder, settings = folder_of()
    (tmp_path / 'root' / 'link').symlink_to(tmp_path)
    with pytest.raises(SettingsError, match='outside of|is no path'):
        folder.check(replace(settings, save_directory=name))


def test_a_folder_that_becomes_a_link_is_left_alone(folder_of, tmp_path):
    folder, settings = folder_of('inner')
    (tmp_path / 'root' / 'inner').rmdir()
    (tmp_path / 'root' / 'inner').symlink_to(tmp_path)
    with pytest.raises(SettingsError, match='outside of'):
        folder.path(settings)


def test_save_into_a_missing_directory_fails_with_its_name(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', arguments=['-r', '__ns:=/missing'],
                       parameters={**PAPER, 'output.save_directory': '/no/such/folder'})
    rig = Rig('/missing')
    answer = rig.call(Trigger, '/missing/range_node/save', Trigger.Request())
    assert not answer.success
    assert "output.save_directory = '/no/such/folder' is no directory" in answer.message
    assert node.stop() == 0
    rig.close()
