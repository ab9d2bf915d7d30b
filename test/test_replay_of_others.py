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
"""`color_stereo replay` with damaged messages, stamps of all kinds and nobody who listens."""

import subprocess
import sys

from color_stereo_ros.cli import main as cli
from color_stereo_ros.recordings.reading import seconds
from other_bags import (PERIOD, recorded, recorded_by_ros1, SECOND, START, USUAL, usual_stamp)
import pytest
from ros_rig import Rig
from sensor_msgs.msg import Image

COMMAND = [sys.executable, '-m', 'color_stereo_ros.cli.main', 'replay']


def replayed(recording, *options):
    """Return (process that has ended, what it said, the left and right stamps that arrived)."""
    rig = Rig()
    for side in ('left', 'right'):
        rig.listen(Image, f'{side}/image_raw')
    replay = subprocess.Popen([*COMMAND, recording, '--wait', '30', *options], text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        rig.spin_until(lambda: replay.poll() is not None, 'the end of replay')
        rig.spin(0.2)
        return replay, replay.stdout.read(), [rig.stamps(f'{side}/image_raw')
                                              for side in ('left', 'right')]
    finally:
        replay.kill()
        replay.wait()
        replay.stdout.close()
        rig.close()


@pytest.mark.parametrize('options', [[], ['--stamps', 'now']])
def test_replay_refuses_a_damaged_message_and_publishes_the_rest(tmp_path, options):
    def damage(index, name, data):
        return data[:20] if (index, name) == (1, USUAL[0]) else None

    replay, said, stamps = replayed(recorded(tmp_path / 'bag', damage=damage), *options)
    assert replay.returncode == cli.PARTLY
    assert f'the message on {USUAL[0]} at {seconds(usual_stamp(1))} s is damaged' in said
    assert '1 messages refused (1 on /left/image_raw)' in said.splitlines()[-1]
    assert [len(side) for side in stamps] == [2, 3] and 'Traceback' not in said


def test_replay_publishes_a_ros1_bag(tmp_path):
    replay, said, stamps = replayed(recorded_by_ros1(tmp_path / 'old.bag'))
    assert replay.returncode == 0, said
    assert stamps == 2 * [[usual_stamp(index) for index in range(3)]]


@pytest.mark.parametrize('options', [[], ['--stamps', 'now'],
                                     ['--stamps', 'now', '--rate', '0.5']])
@pytest.mark.parametrize('first', [-5 * SECOND, 7 * SECOND, START])
def test_stamps_of_any_clock_keep_their_distances(tmp_path, first, options):
    path = recorded(tmp_path / 'bag', stamp=lambda index: first + index * PERIOD)
    replay, said, (left, right) = replayed(path, *options)
    assert replay.returncode == 0, said
    assert left == right and len(left) == 3
    spacing = 2 * PERIOD if '--rate' in options else PERIOD
    assert [stamp - left[0] for stamp in left] == [0, spacing, 2 * spacing]
    assert (left[0] == first) == (not options)
    if options:  # the time of today
        assert left[0] > START


def test_stamps_of_zero_become_the_time_of_recording(tmp_path):
    replay, said, (left, right) = replayed(recorded(tmp_path / 'bag', stamp=lambda index: 0),
                                           '--stamps', 'now')
    assert replay.returncode == 0, said
    assert left == right and [stamp - left[0] for stamp in left] == [0, PERIOD, 2 * PERIOD]


def test_replay_says_that_nobody_listens(tmp_path, capfd):
    assert cli.main(['replay', str(recorded(tmp_path / 'bag')), '--wait', '0.1', '--namespace',
                     'nobody', '--rate', '100']) == 0
    assert 'warning: nobody listens to any of the topics after 0.1 s' in capfd.readouterr().err


def test_replay_of_an_empty_recording_is_refused(tmp_path, capfd):
    assert cli.main(['replay', str(recorded(tmp_path / 'bag', pairs=0)), '--wait', '0']) == 1
    assert 'holds no messages' in capfd.readouterr().err


def test_types_that_are_not_installed_are_left_out_unless_they_are_chosen(tmp_path, capfd):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('int32 x', 'strange_msgs/msg/Thing'))
    thing = store.types['strange_msgs/msg/Thing'](1)
    text = store.types['std_msgs/msg/String']('hello')
    with Writer(tmp_path / 'bag', version=9) as writer:
        for topic, content in (('/thing', thing), ('/text', text)):
            connection = writer.add_connection(topic, content.__msgtype__, typestore=store)
            writer.write(connection, START, store.serialize_cdr(content, content.__msgtype__))
    words = ['replay', str(tmp_path / 'bag'), '--wait', '0']
    assert cli.main(words) == 0
    said = capfd.readouterr()
    assert 'left out: message type strange_msgs/msg/Thing of /thing is not installed' in said.err
    assert said.out.rstrip().endswith('on /text')
    assert cli.main([*words, '--topics', '/thing']) == 1
    assert 'choose other topics with --topics' in capfd.readouterr().err
