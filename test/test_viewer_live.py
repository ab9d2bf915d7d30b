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
"""`color_stereo view --live` over real DDS: what a running range_node publishes, in a page."""

import re
import signal
import subprocess
import sys
import time
from urllib.request import urlopen

from color_stereo_ros.cli import demo, view
from color_stereo_ros.core.settings import updated
from color_stereo_ros.parameters.groups import RangeNodeSettings
from color_stereo_ros.viewer.live import live_frames

import numpy as np

import pytest

from ros_rig import COMPILING, DEPTH, NodeProcess, PAPER, Rig, ROOT  # first: the ROS domain

PERIOD = 0.1  # s between pairs


@pytest.fixture(scope='module')
def rig(tmp_path_factory):
    """Return two cameras and a range_node that measures them."""
    log = tmp_path_factory.mktemp('live') / 'range_node.txt'
    with NodeProcess(log, parameters=PAPER) as node:
        node.wait_until_ready()
        rig = Rig()
        rig.wait_for_node()
        yield rig
        rig.close()


def send_until(rig, condition):
    """Send pairs until a condition holds; return its value."""
    deadline = time.monotonic() + COMPILING
    while not (value := condition()):
        assert time.monotonic() < deadline
        rig.send_pair()
        rig.spin(PERIOD)
    return value


def test_a_frame_holds_the_outputs_and_the_raw_pair_of_one_stamp(rig):
    settings = updated(RangeNodeSettings(), PAPER)
    with live_frames('', (None,) * 4, settings) as source:
        assert 'nothing comes on depth/image' in source.missing()

        def taken():
            for _ in range(20):
                source.spin()
            frame = source.take()
            return frame if frame is not None and frame.left is not None else None

        frame = send_until(rig, taken)
    np.testing.assert_array_equal(frame.left, rig.images['left'])
    np.testing.assert_array_equal(frame.right, rig.images['right'])
    assert np.nanmedian(frame.result.depth) == pytest.approx(DEPTH, rel=0.01)
    assert np.isfinite(frame.result.depth_std[frame.result.status == 0]).all()
    column, row = np.argwhere(frame.result.status == 0)[500][::-1]
    x, y = frame.match(int(column), int(row))
    assert (column - x, y) == pytest.approx((10, row), abs=0.2)
    assert frame.result.image.shape == frame.left.shape


def test_the_page_is_served_until_an_interrupt(rig, tmp_path):
    log = tmp_path / 'said.txt'
    options = [f'--{name}={value}' for name, value in PAPER.items()]
    with open(log, 'wb') as file:
        command = subprocess.Popen(
            [sys.executable, '-m', 'color_stereo_ros.cli.main', 'view', '--live', '--port', '0',
             *options], cwd=ROOT, stdout=file, stderr=subprocess.STDOUT)
    try:
        def said():
            assert command.poll() is None, log.read_text()
            return re.search(r'Open (\S+) in a browser', log.read_text())

        address = send_until(rig, said)
        assert '<!doctype html>' in urlopen(address[1], timeout=30).read().decode().lower()
        assert address[1].startswith('http://127.0.0.1:')
        command.send_signal(signal.SIGINT)
        assert command.wait(COMPILING) == 0, log.read_text()
    finally:
        command.kill()
        command.wait()


def test_a_demo_shows_its_sample(monkeypatch):
    shown = []
    monkeypatch.setattr(view, 'serve', lambda *arguments: shown.append(arguments))
    demo.look_at(ROOT / 'sample' / 'solids_hue1', 0)
    (host, port, frames), = shown
    assert (host, port) == ('127.0.0.1', 0) and len(frames) > 0


def test_a_demo_without_the_library_says_how_to_look(monkeypatch, capsys):
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    demo.look_at(ROOT / 'sample' / 'solids_hue1', 0)
    assert 'color_stereo view ' in capsys.readouterr().out
