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
"""The examples of docs/extending.md run as they stand there, and what they add is known."""

from contextlib import ExitStack
from pathlib import Path
import re

from color_stereo_ros.cli import main as cli
from color_stereo_ros.cli.settings import markdown_table
from color_stereo_ros.cli.tables import output_table
from color_stereo_ros.core import (
    ColorStereo, make_pattern, PatternSettings, Settings, SettingsError, StereoCalibration)
from color_stereo_ros.core.cameras.lenses import LENSES
from color_stereo_ros.core.cameras.rectification import raw_coordinates
from color_stereo_ros.core.methods import METHODS
from color_stereo_ros.core.patterns.registry import PATTERNS
from color_stereo_ros.evaluation import datasets, methods
from color_stereo_ros.files.image import read_image
from color_stereo_ros.messages.contents import Header
from color_stereo_ros.messages.outputs import Context, OUTPUTS
from color_stereo_ros.parameters.groups import RangeNodeSettings
from color_stereo_ros.sim import load_scene
import cv2
import numpy as np
import pytest
from scenes import SCENES
from surface_pairs import pair_of, rig, surface_settings

PAGE = (Path(__file__).parents[1] / 'docs/extending.md').read_text(encoding='utf-8')
EXAMPLES = dict(re.findall(r'^## An? (.*?)\n.*?```python\n(.*?)```', PAGE, re.M | re.DOTALL))
REGISTRIES = PATTERNS, METHODS, LENSES, OUTPUTS


@pytest.fixture
def example(request):
    """Run one example of the page; what it registers is forgotten after the test."""
    with ExitStack() as stack:
        for registry in REGISTRIES:
            stack.enter_context(registry.temporarily())
        exec(EXAMPLES[request.param], {'__name__': 'example'})
        yield


def of(name):
    """Return the decorator of a test that needs an example."""
    return pytest.mark.parametrize('example', [name], indirect=True)


@pytest.mark.parametrize('name', EXAMPLES)
def test_an_example_has_at_most_30_lines(name):
    assert len(EXAMPLES[name].splitlines()) <= 30
    assert max(map(len, EXAMPLES[name].splitlines())) <= 99


@of('pattern')
def test_the_pattern_is_made(example):
    image = make_pattern(PatternSettings(type='rings', width=200, height=100, feature_size=30.0))
    assert image.shape == (100, 200, 3)
    assert np.abs(image.sum(axis=2, dtype=int) - 255).max() <= 1
    np.testing.assert_array_equal(image[50, 100], [255, 0, 0])
    np.testing.assert_array_equal(image[50, 100:160], image[50, 100:40:-1])


@of('pattern')
def test_the_pattern_is_a_choice_of_the_command_line_and_of_the_table(example, tmp_path, capsys):
    assert cli.main(['pattern', str(tmp_path / 'rings.png'), '--pattern.type', 'rings']) == 0
    np.testing.assert_array_equal(read_image(tmp_path / 'rings.png'),
                                  make_pattern(PatternSettings(type='rings')))
    with pytest.raises(SystemExit):
        cli.main(['pattern', '--help'])
    assert 'rings: rings of all hues' in ' '.join(capsys.readouterr().out.split())
    table = markdown_table(Settings())
    assert 'pseudo_noise, unknown, rings | hue_field: aperiodic' in table
    assert 'can be matched, not made; rings: rings of all hues |' in table


def test_the_pattern_is_unknown_before_and_after():
    with pytest.raises(SettingsError, match="pattern.type = 'rings' is not one of hue_field"):
        PatternSettings(type='rings')
    assert 'rings' not in markdown_table(Settings())


@of('method')
def test_the_method_measures_a_pair(example):
    calibration = rig(240, 120)
    left, right = pair_of(np.full((120, 240), 24.0))
    settings = surface_settings(10.0, 40.0, matching__method='blocks')
    result = ColorStereo(calibration, settings).process(left, right)
    middle = result.depth[10:-10, 60:-10]
    assert np.isfinite(middle).mean() > 0.9
    assert np.nanmedian(middle) == pytest.approx(calibration.geometry.focal_baseline / 24, rel=.01)
    np.testing.assert_array_equal(np.isfinite(result.depth), result.status == 0)
    assert set(result.seconds) == {'match'}


@of('method')
def test_the_method_is_evaluated_beside_the_others(example):
    scene = datasets.load_folder(SCENES / 'flat_350_hue1', {'range.min_depth': 0.22,
                                                            'range.max_depth': 0.62})
    _, figures = methods.evaluate(scene, 'blocks', repeats=1)
    assert figures['density'] > 0.1 and figures['median_percent'] < 1
    with pytest.raises(SettingsError, match="did you mean 'blocks'.; known are surface, paper, b"):
        methods.checked_methods(['block'])


def fisheye_rig():
    """Return a verged rig whose lenses follow the model of the example."""
    camera = np.array([[150.0, 0, 78.0], [0, 152.0, 61.0], [0, 0, 1]])
    rotation, _ = cv2.Rodrigues(np.array([0.0, 0.3, 0.02]))
    return StereoCalibration.from_arrays(
        (160, 120), camera, [0.9], camera, [0.8], rotation, -rotation @ [0.1, 0, 0.01], 'fov')


@of('lens model')
def test_the_lens_undoes_what_it_does(example):
    lens, D = LENSES['fov'], np.array([0.9])
    rays = np.random.default_rng(1).uniform(-1, 1, (100, 2))
    rays[0] = 0
    distorted = lens.distort(rays, D)
    radius = np.linalg.norm(rays, axis=1)
    np.testing.assert_allclose(np.linalg.norm(distorted, axis=1),
                               np.arctan(2 * radius * np.tan(0.45)) / 0.9, atol=1e-12)
    camera = np.array([[150.0, 2.0, 78.0], [0, 152.0, 61.0], [0, 0, 1]])
    pixels = distorted @ camera[:2, :2].T + camera[:2, 2]
    np.testing.assert_allclose(lens.undistort(pixels, camera, D), rays, atol=1e-9)
    assert lens.distort(rays, np.zeros(0)) is rays


def seen_pixels(camera):
    """Return the raw pixel (x, y) that each rectified pixel shows, float64 (H, W, 2)."""
    row, column = np.indices((camera.height, camera.width))
    pixels = np.stack([column, row, np.ones_like(row)], axis=-1).reshape(-1, 3)
    rays = np.linalg.solve(camera.P[:, :3] @ camera.R, pixels.T).T
    distorted = LENSES['fov'].distort(rays[:, :2] / rays[:, 2:], camera.D)
    return (distorted @ camera.K[:2, :2].T + camera.K[:2, 2]).reshape(*row.shape, 2)


@of('lens model')
def test_a_rig_with_the_lens_is_rectified(example):
    calibration = fisheye_rig()
    row, column = np.indices((120, 160))
    image = np.stack([column, row, row], axis=-1).astype(np.uint8)  # shows where it was taken
    pair = ColorStereo(calibration).rectify(image, image)
    for camera, rectified, inside in ((calibration.left, pair.left, pair.left_inside),
                                      (calibration.right, pair.right, pair.right_inside)):
        assert inside.mean() > 0.5
        expected = seen_pixels(camera)
        np.testing.assert_allclose(np.stack(raw_coordinates(camera), axis=-1), expected, atol=1e-3)
        within = inside & (expected > 0).all(axis=-1) & (expected < (159, 119)).all(axis=-1)
        np.testing.assert_allclose(rectified[within][:, :2], expected[within], atol=0.6)


@of('lens model')
def test_the_lens_is_written_read_and_simulated(example, tmp_path):
    files = tmp_path / 'left.yaml', tmp_path / 'right.yaml'
    fisheye_rig().to_yaml(*files)
    again = StereoCalibration.from_yaml(*files)
    assert again.left.distortion_model == 'fov' and again.left.D == pytest.approx([0.9])
    cameras = {'distortion_model': 'fov', 'distortion': [0.5]}
    scene = load_scene({'objects': [], 'rig': {'base': 'paper', 'cameras': cameras}})
    assert scene.rig.calibration.left.D == pytest.approx([0.5])


@of('output topic')
def test_the_output_is_among_the_topics(example, capsys):
    assert list(OUTPUTS)[-1] == 'distance/image'
    assert output_table().endswith('| `distance/image` | sensor_msgs/Image | 32FC1, m from the '
                                   'left camera to the surface, NaN = unknown |\n')
    with pytest.raises(SystemExit):
        cli.main(['convert', '--help'])
    assert 'range_image/compressed, distance/image' in ' '.join(capsys.readouterr().out.split())


@of('output topic')
def test_the_content_of_the_output_is_built(example):
    calibration = rig(240, 120)
    pair = pair_of(np.full((120, 240), 24.0))
    result = ColorStereo(calibration, surface_settings(10.0, 40.0)).process(*pair)
    header = Header.at(5_000_000_007, 'left')
    content = OUTPUTS['distance/image'].content(result, Context(header, RangeNodeSettings()))
    assert (content.encoding, content.height, content.width) == ('32FC1', 120, 240)
    assert content.header is header and content.TYPE == OUTPUTS['distance/image'].type
    distance = np.frombuffer(content.data, np.float32).reshape(120, 240)
    np.testing.assert_allclose(distance, np.sqrt((result.points() ** 2).sum(axis=2)), rtol=1e-6)
    assert np.isfinite(distance).mean() > 0.8 and np.nanmin(distance) > 0
