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
"""color.calibration of range_node over real DDS: the colors of the core, refused with reasons."""

from dataclasses import replace

from color_stereo_ros.core import ColorStereo, Settings
from color_stereo_ros.core.color_calibration import CameraColor, ColorCalibration
import numpy as np
import pytest
from ros_rig import answering, calibration, floats, PAPER, scene, SIZE
from sensor_msgs.msg import Image


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    """Return a file of cameras that are unlike."""
    left = CameraColor.ideal(SIZE, (60.0, 60.0))
    right = replace(left, white=np.array([0.7, 1.0, 0.9]), gamma=1.3)
    path = tmp_path_factory.mktemp('color') / 'color.yaml'
    ColorCalibration(left, right).write(path)
    return path


@pytest.fixture(scope='module')
def rig(tmp_path_factory, file):
    """Yield a rig whose node corrects colors."""
    log = tmp_path_factory.mktemp('node') / 'log.txt'
    settings = {**PAPER, 'color.calibration': str(file)}
    with answering(log, settings, {'depth/image': Image}, 'depth/image') as rig:
        yield rig


def test_the_node_measures_the_corrected_colors(rig, file):
    settings = Settings().updated({**PAPER, 'color.calibration': str(file)})
    expected = ColorStereo(calibration(), settings).process(*scene())
    plain = ColorStereo(calibration(), Settings().updated(PAPER)).process(*scene())
    assert floats(rig.received['depth/image'][-1]).tobytes() == expected.depth.tobytes()
    assert expected.depth.tobytes() != plain.depth.tobytes()
    assert expected.image.tobytes() == plain.image.tobytes()


@pytest.mark.parametrize('text, reason', [
    (None, 'cannot be read'), ('a: 3', 'is no color calibration'),
    ('other cameras', 'px, but this one has')])
def test_files_that_do_not_fit_are_refused_with_the_reason(rig, file, tmp_path, text, reason):
    path = tmp_path / 'other.yaml'
    if text == 'other cameras':
        other = CameraColor.ideal((30, 20))
        ColorCalibration(other, other).write(path)
    elif text is not None:
        path.write_text(text)
    answer = rig.set_parameters(color__calibration=str(path))
    assert not answer.successful
    assert str(path) in answer.reason and reason in answer.reason
    assert rig.get_parameter('color.calibration') == str(file)
