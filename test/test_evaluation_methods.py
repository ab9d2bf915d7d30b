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
"""Own methods and OpenCV's on the same pairs, against figures measured independently."""

from color_stereo_ros.core import ColorStereo, RangeSettings, RectifiedGeometry, RectifiedPair
from color_stereo_ros.core import Settings, SettingsError, Status
from color_stereo_ros.core.constants import replaced
from color_stereo_ros.core.surface.plane_kernels import WIDE_RADIUS
from color_stereo_ros.core.surface.tuning import TUNING
from color_stereo_ros.evaluation import ablation, datasets, methods, opencv_matchers
from color_stereo_ros.evaluation.metrics import accuracy
from color_stereo_ros.evaluation.tuned import CONSTANTS, stereo_for, switched_off

import numpy as np

import pytest

from scenes import SCENES

LIMITS = {'range.min_depth': 0.22, 'range.max_depth': 0.62}
PROTOTYPE = {'color.smoothing': 0.0, 'color.zero_weakest': False,
             'color.equalize_cameras': 'shared'}


def textured_pair(disparity, offset=0.0, width=320, height=60):
    """Return a random texture whose right image is moved by whole pixels."""
    texture = np.random.default_rng(1).integers(0, 256, (height, width + 400, 3), np.uint8)
    start = 200
    left = texture[:, start:start + width]
    right = texture[:, start + disparity:start + disparity + width]
    geometry = RectifiedGeometry(width=width, height=height, focal_x=300.0, focal_y=300.0,
                                 center_x_left=160.0 + offset, center_x_right=160.0,
                                 center_y=30.0, baseline=0.1)
    inside = np.ones((height, width), bool)
    return RectifiedPair(np.ascontiguousarray(left), np.ascontiguousarray(right), inside, inside,
                         geometry)


@pytest.mark.parametrize('method', opencv_matchers.METHODS)
@pytest.mark.parametrize('disparity, offset', [(60, 0.0), (-70, -130.0), (5, -55.0)])
def test_opencv_finds_positive_and_negative_disparities(method, disparity, offset):
    pair = textured_pair(disparity, offset)     # always 30 px m / 60 px = 0.5 m
    result = opencv_matchers.match(method, pair, RangeSettings(0.35, 0.8))
    middle = result.disparity[20:40, 100:220]
    assert np.mean(np.abs(middle - disparity) < 0.1) > 0.97
    known = result.depth[20:40, 100:220]
    assert np.nanmedian(known) == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize('method', opencv_matchers.METHODS)
def test_opencv_loses_no_strip_at_the_left_border(method):
    pair = textured_pair(60)
    result = opencv_matchers.match(method, pair, RangeSettings(0.35, 0.8))
    strip = result.disparity[20:40, 70:84]      # left of the number of disparities searched
    assert np.mean(np.abs(strip - 60) < 0.1) > 0.9


def test_opencv_gives_no_range_outside_the_depth_limits():
    pair = textured_pair(60)
    result = opencv_matchers.match('sgbm', pair, RangeSettings(0.35, 0.8))
    known = np.isfinite(result.depth)
    assert result.depth[known].min() >= 0.35 - 1e-6
    assert result.depth[known].max() <= 0.8 + 1e-6
    np.testing.assert_array_equal(known, result.status == Status.VALID)


# Figures of an independent prototype of the paper's method on the same three pairs:
# equalized channels, scaling, Q, parabola, left-right check; no smoothing, nothing set to zero.
@pytest.mark.parametrize('name, height, density, correct, median, mean', [
    ('flat_350_hue1', 1, 0.870, 0.821, 0.270, 0.367),
    ('flat_350_hue1', 9, 0.927, 0.922, 0.160, 0.219),
    ('prism_hue1', 1, 0.829, 0.760, 0.257, 0.481),
    ('prism_hue1', 9, 0.884, 0.855, 0.152, 0.329),
    ('solids_hue1', 1, 0.792, 0.684, 0.359, 0.614),
    ('solids_hue1', 9, 0.819, 0.775, 0.222, 0.392)])
def test_figures_of_the_papers_method_equal_an_independent_measurement(
        name, height, density, correct, median, mean):
    scene = datasets.load_folder(SCENES / name, LIMITS)
    run = methods.run_method(scene, 'paper', {**PROTOTYPE, 'matching.window_height': height}, 1)
    figures = accuracy(run.result, scene.truth)
    assert figures['density'] == pytest.approx(density, rel=0.01)
    assert figures['correct'] == pytest.approx(correct, rel=0.01)
    assert figures['median_percent'] == pytest.approx(median, rel=0.03)
    assert figures['mean_percent'] == pytest.approx(mean, rel=0.03)


def test_every_method_is_known_and_a_mistyped_one_is_refused():
    assert set(methods.known_methods()) >= {'surface', 'paper', 'bm', 'sgbm', '3way'}
    with pytest.raises(SettingsError, match="did you mean 'sgbm'"):
        methods.checked_methods(['paper', 'sgmb'])


def test_evaluating_gives_figures_limit_and_time():
    scene = datasets.load_folder(SCENES / 'flat_350_hue1', LIMITS)
    run, figures = methods.evaluate(scene, 'paper', repeats=1)
    assert figures['density'] > 0.9
    assert figures['noise_limit']['camera'] is None     # the cameras are unknown
    assert figures['noise_limit']['best'] is figures['noise_limit']['pair']
    assert 0.5 < figures['noise_limit']['best']['error_over_limit'] < 5
    assert figures['milliseconds'] == run.milliseconds > 0


def test_the_window_of_the_papers_method_grows_with_its_smoothing():
    settings = Settings().updated({'matching.window_width': 9, 'matching.window_height': 1,
                                   'color.smoothing': 1.0})
    window = methods.window_of('paper', settings)
    assert (window.width, window.height, window.surface) == (11, 3, 'constant')


def test_the_window_of_the_surface_method_counts_nodes_of_two_pixels():
    window = methods.window_of('surface', Settings())
    assert window.width == window.height == 2 * (2 * WIDE_RADIUS + 1) + 1
    assert window.surface == 'plane'


def test_switches_come_from_the_settings_and_switch_something_off():
    for method in ('surface', 'paper'):
        found = {name: value for name, value in ablation.switches(method).items()
                 if name not in CONSTANTS}
        assert found
        default = Settings().flat()
        assert all(value in (0, False, 'off') and default[name] != value
                   for name, value in found.items())
        Settings().updated(found)
    assert 'color.equalize' in ablation.switches('paper')
    common = set(ablation.switches('paper')) & set(ablation.switches('surface'))
    assert common == {'color.equalize'}


def test_constants_of_the_surface_method_are_switches_too():
    found = {name: value for name, value in ablation.switches('surface').items()
             if name in CONSTANTS}
    assert found == switched_off() and {'steps.odds', 'contest.cap'} <= set(found)
    assert not set(CONSTANTS) & set(Settings().flat())
    assert all(CONSTANTS[name].value != off for name, off in found.items())
    replaced(TUNING, found)
    assert not set(ablation.switches('paper')) & set(CONSTANTS)


def test_a_constant_that_is_switched_off_reaches_the_method():
    scene = datasets.load_folder(SCENES / 'flat_350_hue1', LIMITS)
    stereo = stereo_for(scene.calibration, Settings().updated({'pattern.type': 'sine'}),
                        {'steps.odds': 0.0, 'matching.refinements': 1})
    assert stereo._method.tuning.steps.odds == 0 != TUNING.steps.odds
    assert stereo.settings.matching.refinements == 1
    result = stereo.process(scene.left, scene.right)
    assert np.isfinite(result.depth).mean() > 0.9
    plain = stereo_for(scene.calibration, Settings(), {'matching.method': 'paper'})
    assert type(plain) is ColorStereo


@pytest.mark.long
def test_an_ablation_measures_the_whole_and_every_switch():
    scene = datasets.load_folder(SCENES / 'flat_350_hue1', LIMITS)
    rows = ablation.ablation([scene], 'paper', list, repeats=1)
    assert [row['off'] for row in rows] == [
        '', *(f'{name} = {value}' for name, value in ablation.switches('paper').items())]
    assert rows[0]['density'] > 0.9
