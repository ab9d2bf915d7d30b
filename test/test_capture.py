# SPDX-License-Identifier: Apache-2.0
"""~/capture and ~/save over real DDS: one pair on request, and its points as a file."""

import numpy as np

import pytest

from ros_rig import silent_rig

from sensor_msgs.msg import Image

from std_msgs.msg import Header

from std_srvs.srv import Trigger


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    """Yield a rig without any listener, and its node."""
    with silent_rig(tmp_path_factory.mktemp('capture')) as rig:
        yield rig


@pytest.fixture
def rig(running):
    """Yield the rig with a node that streams."""
    running.received.clear()
    assert running.set_parameters(input__mode='stream', output__save_directory=str(running.folder),
                                  output__save_format='ply').successful
    return running


def trigger(rig, name, feed_pairs=True):
    """Call a trigger service while pairs arrive."""
    def send():
        # a stamp of now, as a camera gives it
        rig.stamp = rig.node.get_clock().now().nanoseconds
        rig.send_pair(stamp=rig.stamp)

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
    assert 'no pair for' in answer.message


def read_ply(path):
    """Return the vertices of a binary PLY file."""
    header, _, body = path.read_bytes().partition(b'end_header\n')
    count = int(header.split(b'element vertex ')[1].split()[0])
    kinds = np.dtype([('xyz', '<f4', 3), ('rgb', 'u1', 3)])
    assert len(body) == count * kinds.itemsize
    return np.frombuffer(body, kinds)


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
    for file in files:
        file.unlink()


def test_save_in_capture_mode_writes_what_was_captured(rig):
    assert rig.set_parameters(input__mode='capture').successful
    captured = trigger(rig, 'capture')
    answer = trigger(rig, 'save', feed_pairs=False)
    assert answer.success, answer.message
    stamp = captured.message.split()[1].rstrip(':').replace('.', '')
    assert f'range_node_{stamp}.ply' in answer.message
    for file in rig.folder.glob('range_node_*'):
        file.unlink()


def test_save_into_a_missing_directory_fails_with_its_name(rig):
    assert rig.set_parameters(output__save_directory='/no/such/folder').successful
    answer = trigger(rig, 'save')
    assert not answer.success
    assert "output.save_directory = '/no/such/folder' is no directory" in answer.message
