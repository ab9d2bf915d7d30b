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
"""The gamma of a projector, measured through a camera of known colors."""

from color_stereo_ros.calibration.color import calibrate_camera
from color_stereo_ros.calibration.projector import calibrate_projector, ProjectorResponse
from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import CalibrationError
from color_stereo_ros.core.color_calibration import ColorCalibration
from color_stereo_ros.files.image import write_image
import numpy as np
import pytest
from unequal_cameras import Eye, frames

EYE = Eye(gains=(1.0, 0.9, 0.6), gamma=2.2, crosstalk=0.05)
LEVELS = 32, 64, 96, 128, 160, 192, 224


@pytest.fixture(scope='module')
def colors():
    """Return the color calibration of two such cameras."""
    images = {name: image.astype(float) for name, image in frames(EYE).items()}
    camera, _ = calibrate_camera(images)
    return ColorCalibration(camera, camera)


def gray(gamma, levels=LEVELS, seed=4):
    """Return what a camera sees of gray levels of a projector with a gamma."""
    rng = np.random.default_rng(seed)
    images = {}
    for name, level in (('white', 255), ('black', 0), *((f'level_{n}', n) for n in levels)):
        light = 0.01 + 0.99 * np.power(level / 255, gamma)
        images[name] = EYE.see(np.broadcast_to(light, (240, 320, 3)).copy(), rng)
    return images


@pytest.mark.parametrize('gamma', [1.0, 1.8, 2.4])
def test_the_gamma_of_each_channel_is_found(colors, gamma):
    expected = gamma, gamma + 0.1, gamma - 0.1
    found = calibrate_projector(gray(np.array(expected)), colors)
    np.testing.assert_allclose(found.response.gamma, expected, atol=0.06)
    assert found.levels == LEVELS
    assert found.error < 0.01


def test_a_corrected_image_shows_linear_light():
    response = ProjectorResponse((2.2, 1.8, 1.0))
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    shown = np.power(response.corrected(ramp) / 255, response.gamma)
    np.testing.assert_allclose(shown, ramp / 255, atol=0.006)


def test_a_gamma_of_one_changes_nothing():
    image = np.zeros((2, 3, 3), np.uint8)
    assert ProjectorResponse((1, 1, 1)).corrected(image) is image


@pytest.mark.parametrize('images, message', [
    ({'white': 0}, "the frame 'black' is missing"),
    ({'white': 0, 'black': 0}, 'expected at least one in 1 .. 254'),
    ({'white': 0, 'black': 0, 'level_255': 0}, 'expected at least one in 1 .. 254')])
def test_missing_images_are_named(colors, images, message):
    with pytest.raises(CalibrationError, match=message):
        calibrate_projector(images, colors)


def test_light_that_does_not_grow_is_refused(colors):
    images = gray(2.2)
    images['level_64'], images['level_192'] = images['level_192'], images['level_64']
    with pytest.raises(CalibrationError, match='does not grow with the levels'):
        calibrate_projector(images, colors)


def test_the_command_writes_a_file_that_project_reads(colors, tmp_path, capsys):
    colors.write(tmp_path / 'color.yaml')
    for name, image in gray(2.2).items():
        write_image(tmp_path / f'left_{name}.png', image)
    output = tmp_path / 'projector.yaml'
    assert cli.main(['calibrate', 'projector', str(tmp_path), '--color',
                     str(tmp_path / 'color.yaml'), '-o', str(output)]) == 0
    assert 'from 7 gray levels' in capsys.readouterr().out
    np.testing.assert_allclose(ProjectorResponse.read(output).gamma, 2.2, atol=0.06)


def test_another_file_is_refused(tmp_path):
    (tmp_path / 'projector.yaml').write_text('projector_gamma: [1, 2]')
    with pytest.raises(CalibrationError, match='projector.yaml: gamma = .* expected three numb'):
        ProjectorResponse.read(tmp_path / 'projector.yaml')
