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
"""Under a pattern without a name each pair tells whether its colors come again."""

from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.surface.choosing import surface_method, UnknownPattern
from color_stereo_ros.core.surface.method import SurfaceMethod
import numpy as np
import pytest
from surface_pairs import plane_pair, rig, surface_settings

WIDTH, HEIGHT = 320, 160
TWO_VIEWS = {'matching__third_view': 'off'}


def stereo(kind, **changes):
    """Return a ColorStereo of two views for a type of pattern."""
    return ColorStereo(rig(WIDTH, HEIGHT),
                       surface_settings(4, 60, pattern__type=kind, **TWO_VIEWS, **changes))


@pytest.fixture(scope='module')
def unnamed():
    """Return a ColorStereo that is told nothing of the pattern."""
    return stereo('unknown')


@pytest.fixture(scope='module')
def aperiodic_pair():
    """Return a plane under the default pattern."""
    return plane_pair(WIDTH, HEIGHT, 22.3, 0.03)


def test_colors_that_never_come_again_are_measured_as_those_of_the_default_pattern(
        unnamed, aperiodic_pair):
    found, expected = (each.process(*aperiodic_pair) for each in (unnamed, stereo('hue_field')))
    for name in ('disparity', 'confidence', 'disparity_std', 'status'):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), name)
    assert np.nanmedian(np.abs(found.disparity[:, 60:] - plane_at()[:, 60:])) < 0.02


def plane_at():
    """Return the disparity of the plane, px."""
    return 22.3 + 0.03 * (np.arange(WIDTH) - (WIDTH - 1) / 2) + np.zeros((HEIGHT, 1))


def test_other_pairs_are_not_measured_so(unnamed, aperiodic_pair):
    method = unnamed._method
    assert method.suiting(*aperiodic_pair, None) is method.aperiodic
    sines = plane_pair(WIDTH, HEIGHT, 22.3, 0.03, kind='sine')
    gray = [np.repeat(image[..., 1:2], 3, axis=2) for image in aperiodic_pair]
    repeated = [np.tile(image[:, :40], (1, 8, 1)) for image in aperiodic_pair]
    black = [np.zeros_like(image) for image in aperiodic_pair]
    for pair in (sines, gray, repeated, black):
        assert method.suiting(*pair, None) is method.other


def test_no_pair_changes_the_next_one(unnamed, aperiodic_pair):
    sines = plane_pair(WIDTH, HEIGHT, 22.3, 0.03, kind='sine')
    first = unnamed.process(*aperiodic_pair)
    unnamed.process(*sines)
    unnamed.reset()
    again = unnamed.process(*aperiodic_pair)
    np.testing.assert_array_equal(first.disparity, again.disparity)


def test_the_cost_curve_is_that_of_the_method_that_measured(unnamed, aperiodic_pair):
    curve = unnamed._method.curve(*aperiodic_pair, None, (200, 80))
    expected = stereo('hue_field')._method.curve(*aperiodic_pair, None, (200, 80))
    np.testing.assert_array_equal(curve.path, expected.path)


@pytest.mark.parametrize('kind, expected', [
    ('hue_field', SurfaceMethod), ('sine', SurfaceMethod), ('unknown', UnknownPattern)])
def test_only_patterns_of_which_nothing_is_known_ask_the_pair(kind, expected):
    settings = surface_settings(4, 60, pattern__type=kind, **TWO_VIEWS)
    assert type(surface_method(settings, rig(64, 48), (4, 60))) is expected
