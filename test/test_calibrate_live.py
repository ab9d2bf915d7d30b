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
"""Live calibration over real DDS: a board is held before two cameras until it is good enough."""

import re
import subprocess
import sys
import time
from urllib.request import urlopen

from board_shots import BASELINE, images

from color_stereo_ros.core import StereoCalibration
from color_stereo_ros.files.image import read_image
from color_stereo_ros.pages.serving import padded

import numpy as np

import pytest

from ros_rig import COMPILING, Rig, ROOT  # first: it chooses the ROS domain

VIEWS = 8
PERIOD = 0.15  # s between pairs
COMMAND = [sys.executable, '-m', 'color_stereo_ros.cli.main', 'calibrate', 'geometry', '--live',
           '--kind', 'chessboard', '--columns', '9', '--rows', '6', '--square-mm', '25',
           '--model', 'plumb_bob', '--target-mm', '0.0001', '--views', str(VIEWS),
           '--distance-mm', '450']


class Held:
    """The command in a process of its own, and a board that is held before its cameras."""

    def __init__(self, folder, *options):
        self.log = folder / 'said.txt'
        with open(self.log, 'wb') as file:
            self.process = subprocess.Popen(
                [*COMMAND, *options, '--output', str(folder / 'out')], cwd=ROOT, stdout=file,
                stderr=subprocess.STDOUT)
        self.rig = Rig(node_name='calibrate_geometry')

    def said(self):
        return self.log.read_text()

    def hold(self, index, until):
        """Show a pose until the command has said something, or has ended."""
        self.rig.images = dict(zip(('left', 'right'), images(index)))
        deadline = time.monotonic() + COMPILING
        while until not in self.said() and self.process.poll() is None:
            assert time.monotonic() < deadline, self.said()
            self.rig.send_pair(infos=False)
            self.rig.spin(PERIOD)

    def close(self):
        self.rig.close()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


@pytest.fixture(scope='module')
def ended(tmp_path_factory):
    """Return a folder in which a live calibration has ended, and what it said."""
    folder = tmp_path_factory.mktemp('live')
    held = Held(folder, '--page', '0', '--keep', str(folder / 'kept'))
    try:
        for index in range(VIEWS):
            held.hold(index, f'{index + 1} views')
            if index == 5:
                address = held.said().partition('Open ')[2].partition(' in a browser')[0]
                page = urlopen(address, timeout=30).read().decode()
        assert held.process.wait(COMPILING) == 0, held.said()
    finally:
        held.close()
    return folder, held.said(), page


def test_a_board_before_live_cameras_becomes_a_calibration(ended):
    folder, said, _ = ended
    found = StereoCalibration.from_yaml(*(folder / 'out' / f'{side}.yaml'
                                          for side in ('left', 'right')))
    assert found.geometry.baseline == pytest.approx(BASELINE, rel=2e-3)
    used, dropped = map(int, re.search(r'Views: (\d+) used, (\d+) not', said).groups())
    assert used + dropped == VIEWS


def test_it_says_and_draws_which_pose_is_next(ended):
    folder, said, _ = ended
    assert 'Next: hold the board in the middle of both images' in said
    assert said.count('before the left camera, in the ') >= 3
    assert said.count('with the next view') >= 4
    assert read_image(folder / 'out' / 'next_pose.png').shape == (480, 1280, 3)


def test_the_images_of_the_views_are_kept(ended):
    folder, _, _ = ended
    names = sorted(path.name for path in (folder / 'kept').iterdir())
    assert names == sorted(f'{side}_{number:02d}.png' for side in ('left', 'right')
                           for number in range(1, VIEWS + 1))
    np.testing.assert_array_equal(read_image(folder / 'kept/left_03.png'), images(2)[0])


def test_the_page_is_served_while_it_lasts(ended):
    assert '<!doctype html>' in ended[2].lower()


def test_an_interrupt_ends_with_the_views_so_far(tmp_path):
    held = Held(tmp_path)
    try:
        for index in range(2):
            held.hold(index, f'{index + 1} views')
        held.process.send_signal(2)
        assert held.process.wait(COMPILING) == 1
    finally:
        held.close()
    assert 'both cameras see the board in too few views (left 2, right 2' in held.said()
    assert not list(tmp_path.rglob('*.yaml'))


@pytest.mark.parametrize('aspect, shape', [(2.0, (480, 960)), (1.0, (640, 640)),
                                           (4 / 3, (480, 640))])
def test_a_picture_is_padded_to_the_window(aspect, shape):
    picture = np.full((480, 640, 3), 9, np.uint8)
    shown = padded(picture, aspect)
    assert shown.shape[:2] == shape
    top, left = (shape[0] - 480) // 2, (shape[1] - 640) // 2
    np.testing.assert_array_equal(shown[top:top + 480, left:left + 640], picture)
