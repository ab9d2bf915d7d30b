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
"""Color calibration over real DDS: pattern_node shows the frames, two cameras see them."""

import json
import subprocess
import sys
import time

from color_stereo_ros.calibration.color import calibrate_color
from color_stereo_ros.core.color_calibration import ColorCalibration

import numpy as np

import pytest

from rclpy.qos import DurabilityPolicy, QoSProfile

from ros_rig import COMPILING, NodeProcess, Rig, ROOT  # first: it chooses the ROS domain

from std_msgs.msg import String

from unequal_cameras import Eye, FRAMES, frames

PERIOD = 0.1  # s between pairs
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def rig():
    """Return two cameras in this process."""
    found = Rig(node_name='calibrate_color')
    yield found
    found.close()


def command(folder):
    """Start the command in a process of its own; its words go to a file."""
    with open(folder / 'said.txt', 'wb') as file:
        return subprocess.Popen(
            [sys.executable, '-m', 'color_stereo_ros.cli.main', 'calibrate', 'color', '--live',
             '--settle', '0.3', '--output', str(folder / 'color.yaml')], cwd=ROOT, stdout=file,
            stderr=subprocess.STDOUT)


def test_live_cameras_before_a_card_are_measured(rig, tmp_path):
    films = frames(Eye(gains=(1.0, 0.9, 0.6))), frames(Eye(gamma=2.2), seed=1)
    node = NodeProcess(tmp_path / 'pattern.txt', 'pattern_node', {
        'pattern.width': 64, 'pattern.height': 64})
    rig.listen(String, 'pattern/info', LATCHED)
    process = command(tmp_path)
    deadline = time.monotonic() + COMPILING
    try:
        while process.poll() is None:
            assert time.monotonic() < deadline, (tmp_path / 'said.txt').read_text()
            told = rig.received['pattern/info']
            shown = json.loads(told[-1].data)['frame'] if told else 'pattern'
            shown = shown if shown in FRAMES else 'black'
            rig.images = {'left': films[0][shown], 'right': films[1][shown]}
            rig.send_pair(infos=False)
            rig.spin(PERIOD)
        assert process.returncode == 0, (tmp_path / 'said.txt').read_text()
        rig.spin_until(lambda: json.loads(rig.received['pattern/info'][-1].data)['frame']
                       == 'pattern', 'the pattern')
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        node.process.terminate()
        node.process.wait()
    found = ColorCalibration.read(tmp_path / 'color.yaml')
    true = calibrate_color(*films).calibration
    np.testing.assert_allclose(found.left.white, true.left.white, atol=1e-6)
    assert found.right.gamma == pytest.approx(true.right.gamma, abs=1e-6)
