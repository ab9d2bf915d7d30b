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
"""The colors of depth and status, and the strips that explain them."""

from color_stereo_ros.core import Settings
from color_stereo_ros.core.false_color import (automatic_limits, false_color, RANGE_COLORS,
                                               range_limits, STATUS_COLORS, status_picture,
                                               VIEW_COLORS, views_picture)
from color_stereo_ros.core.legends import (with_scale_bar, with_status_legend,
                                           with_views_legend)
from color_stereo_ros.core.status import Status
from color_stereo_ros.errors import SettingsError

import cv2

from matplotlib import colormaps

import numpy as np

import pytest

NEAR, FAR = 0.2, 0.6
# Linear RGB as people without one kind of cones see it, at full severity (Machado, Oliveira and
# Fernandes 2009, table 1).
PROTANOPIA = [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
              [-0.003882, -0.048116, 1.051998]]
DEUTERANOPIA = [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                [-0.011820, 0.042940, 0.968881]]
TRITANOPIA = [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
              [0.004733, 0.691367, 0.303900]]
EYES = pytest.mark.parametrize(
    'cones', [np.eye(3), PROTANOPIA, DEUTERANOPIA, TRITANOPIA],
    ids=['all cones', 'protanopia', 'deuteranopia', 'tritanopia'])


def picture_of(*depths, colors='viridis'):
    """Return the colors of single depths between 0.2 and 0.6 m."""
    return false_color(np.array([depths], np.float32), NEAR, FAR, colors)[0].tolist()


def seen(colors, cones):
    """Return uint8 RGB (N, 3) as CIE L*a*b* (N, 3) of what somebody with these cones sees."""
    value = np.asarray(colors) / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ np.transpose(cones), 0, 1)
    value = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return cv2.cvtColor(value[None].astype(np.float32), cv2.COLOR_RGB2Lab)[0]


def test_known_depths_have_the_known_colors_of_viridis():
    """Versions of OpenCV round the published table (here matplotlib's) up or down."""
    published = np.array(colormaps['viridis'].colors)[[255, 146, 36]] * 255
    np.testing.assert_allclose(picture_of(0.2, 0.4, 0.6), published, atol=1)
    np.testing.assert_allclose(published[0], (253, 231, 37), atol=1)  # yellow


def test_in_the_papers_colors_near_is_purple_and_far_is_orange():
    (near_red, near_green, near_blue), (far_red, far_green, far_blue) = picture_of(
        NEAR, FAR, colors='paper')
    assert near_blue > near_red > near_green
    assert far_red > far_green > far_blue


@EYES
def test_lightness_falls_with_the_depth_for_all_eyes(cones):
    lightness = seen(picture_of(*np.linspace(NEAR, FAR, 64)), cones)[:, 0]
    assert (np.diff(lightness) < 0).all()
    assert np.ptp(lightness) > 50


def test_equal_steps_of_depth_look_equally_large():
    """Distances in L*a*b* between neighbors of 32 depths; those of the paper's hues vary more."""
    def spread(colors):
        steps = np.linalg.norm(np.diff(seen(picture_of(
            *np.linspace(NEAR, FAR, 32), colors=colors), np.eye(3)), axis=0), axis=1)
        return steps.max() / steps.min()

    assert spread('viridis') < 2.5 < 5 < spread('paper')


@pytest.mark.parametrize('colors', RANGE_COLORS)
def test_unknown_is_black_and_nothing_else_is_dark(colors):
    unknown, *known = picture_of(np.nan, *np.linspace(NEAR, FAR, 64), colors=colors)
    assert unknown == [0, 0, 0]
    assert seen(known, np.eye(3))[:, 0].min() > 20


@pytest.mark.parametrize('colors', RANGE_COLORS)
def test_depths_outside_the_limits_get_the_color_of_the_limit(colors):
    assert picture_of(0.1, 0.7, colors=colors) == picture_of(NEAR, FAR, colors=colors)


def test_the_colors_of_nearly_all_levels_differ():
    for colors, least in (('paper', 230), ('viridis', 210)):
        known = picture_of(*np.linspace(NEAR, FAR, 255), colors=colors)
        assert len({tuple(color) for color in known}) > least


def test_the_picture_has_the_size_of_the_depth_image():
    assert false_color(np.full((7, 9), 0.3, np.float32), NEAR, FAR).shape == (7, 9, 3)


@pytest.mark.parametrize('near, far, colors, message', [
    (0.6, 0.6, 'viridis', 'near = 0.6 m must be smaller than far = 0.6 m'),
    (0.2, 0.6, 'jet', "colors = 'jet' is not one of viridis, paper")])
def test_limits_and_colors_that_are_none_are_refused(near, far, colors, message):
    with pytest.raises(SettingsError, match=message):
        false_color(np.zeros((2, 2), np.float32), near, far, colors)


def ramp():
    """Return depths 0.3 .. 0.5 m in steps of 1/9999, some unknown, one absurd."""
    depth = np.full((400, 400), np.nan, np.float32)
    depth[::4, ::4] = np.linspace(0.3, 0.5, 10000, dtype=np.float32).reshape(100, 100)
    depth[200:, 4] = np.nan
    depth[0, 0] = 77.0
    return depth


def test_automatic_limits_are_percentiles_of_what_is_known():
    assert automatic_limits(ramp()) == pytest.approx((0.301, 0.499), abs=2e-4)


def test_automatic_limits_of_a_plane_have_an_extent_and_of_nothing_there_are_none():
    near, far = automatic_limits(np.full((8, 8), 0.5, np.float32))
    assert near == 0.5 < far < 0.501
    assert automatic_limits(np.full((8, 8), np.nan, np.float32)) is None


def test_fixed_limits_are_the_working_range_and_automatic_ones_fall_back_to_it():
    fixed = Settings().range
    nothing = np.full((8, 8), np.nan, np.float32)
    assert range_limits(ramp(), fixed, 'fixed') == (0.2, 1.0)
    assert range_limits(ramp(), fixed, 'automatic') == automatic_limits(ramp())
    assert range_limits(nothing, fixed, 'automatic') == (0.2, 1.0)


@pytest.mark.parametrize('height', [1, 20, 48, 96, 480])
@pytest.mark.parametrize('colors', RANGE_COLORS)
def test_the_scale_bar_is_added_and_the_picture_stays(height, colors):
    picture = false_color(np.full((height, 30), 0.3, np.float32), NEAR, FAR, colors)
    labeled = with_scale_bar(picture, NEAR, FAR, colors)
    assert labeled.shape[0] == height and labeled.shape[1] > 60 and labeled.dtype == np.uint8
    np.testing.assert_array_equal(labeled[:, :30], picture)


@pytest.mark.parametrize('colors', RANGE_COLORS)
def test_the_scale_bar_has_the_colors_of_the_picture_near_at_the_bottom(colors):
    rows = 480 - 26  # above the mark of unknown
    depth = np.linspace(FAR, NEAR, rows, dtype=np.float32)[:, None]
    strip = with_scale_bar(np.zeros((480, 1, 3), np.uint8), NEAR, FAR, colors)[:, 1:]
    np.testing.assert_array_equal(strip[:rows, 8], false_color(depth, NEAR, FAR, colors)[:, 0])


def test_the_scale_bar_shows_that_unknown_is_black():
    strip = with_scale_bar(np.full((480, 1, 3), 99, np.uint8), NEAR, FAR)[:, 1:]
    assert (strip[480 - 15, 8] == 0).all()
    assert not (strip[:454] == 0).all(axis=2).any()


def test_each_status_has_a_color_of_its_own_and_only_outside_is_black():
    assert list(STATUS_COLORS) == list(Status)
    assert [code for code, color in STATUS_COLORS.items() if color == (0, 0, 0)] == [
        Status.OUTSIDE_IMAGE]


@EYES
def test_the_colors_of_the_status_differ_for_all_eyes(cones):
    """In L*a*b* a distance of 2.3 is just noticeable."""
    colors = seen(list(STATUS_COLORS.values()), cones)
    distances = np.linalg.norm(colors[:, None] - colors, axis=2)
    assert distances[~np.eye(len(colors), dtype=bool)].min() > 10


def test_the_status_picture_has_the_color_of_each_code():
    codes = np.array([[*Status]], np.uint8)
    assert status_picture(codes)[0].tolist() == [list(color) for color in STATUS_COLORS.values()]


@pytest.mark.parametrize('height', [1, 20, 64, 120, 480])
def test_the_legend_is_added_and_the_picture_stays(height):
    picture = status_picture(np.full((height, 30), Status.DARK, np.uint8))
    labeled = with_status_legend(picture)
    assert labeled.shape[0] == height and labeled.dtype == np.uint8
    np.testing.assert_array_equal(labeled[:, :30], picture)


@pytest.mark.parametrize('height', [20, 64, 120, 480])
def test_the_legend_shows_every_color_of_the_status(height):
    legend = with_status_legend(np.zeros((height, 0, 3), np.uint8))
    shown = {tuple(color) for color in legend.reshape(-1, 3).tolist()}
    assert set(STATUS_COLORS.values()) <= shown


def test_a_high_legend_has_the_meanings_and_a_low_one_the_names():
    high, low = (with_status_legend(np.zeros((height, 0, 3), np.uint8)) for height in (480, 120))
    assert (high > 100).any(axis=2).sum() > 2 * (low > 100).any(axis=2).sum()


def test_the_views_have_the_color_of_who_saw_a_pixel():
    picture = views_picture(np.array([[0, 1, 2, 3]], np.uint8))
    assert [tuple(color) for color in picture[0].tolist()] == [
        VIEW_COLORS[bits][1] for bits in range(4)]
    wide = with_views_legend(np.zeros((60, 30, 3), np.uint8))
    assert wide.shape[0] == 60 and wide.shape[1] > 30
    for _, color in VIEW_COLORS.values():
        assert (wide == color).all(axis=-1).any()
