# SPDX-License-Identifier: Apache-2.0
"""The false-color picture of the paper's fig. 3.5."""

from color_stereo_ros.core.false_color import false_color, scale_bar_width
from color_stereo_ros.errors import SettingsError

import numpy as np

import pytest


def picture_of(*depths):
    """Return the colors of single depths between 0.2 and 0.6 m."""
    return false_color(np.array([depths], np.float32), 0.2, 0.6, scale_bar=False)[0].tolist()


def test_near_is_purple_and_far_is_orange():
    (near_red, near_green, near_blue), (far_red, far_green, far_blue) = picture_of(0.2, 0.6)
    assert near_blue > near_red > near_green
    assert far_red > far_green > far_blue


def test_unknown_is_black_and_nothing_else_is():
    unknown, known = picture_of(np.nan, 0.2)
    assert unknown == [0, 0, 0] and known != [0, 0, 0]


def test_depths_outside_the_limits_get_the_color_of_the_limit():
    assert picture_of(0.1, 0.7) == picture_of(0.2, 0.6)


def test_the_color_changes_monotonically_with_depth():
    colors = {tuple(color) for color in picture_of(*np.linspace(0.2, 0.6, 255))}
    assert len(colors) > 230


@pytest.mark.parametrize('height', [1, 20, 48, 480])
def test_the_scale_bar_stands_on_the_left_with_near_at_the_bottom(height):
    depth = np.full((height, 30), 0.6, np.float32)
    picture = false_color(depth, 0.2, 0.6)
    width = scale_bar_width(height, 0.2, 0.6)
    assert picture.shape == (height, 30 + width, 3)
    np.testing.assert_array_equal(picture[:, width:], false_color(depth, 0.2, 0.6,
                                                                  scale_bar=False))


def test_the_scale_bar_has_the_colors_of_the_picture():
    rows = np.linspace(0.6, 0.2, 480, dtype=np.float32)
    depth = np.repeat(rows[:, None], 30, axis=1)
    picture = false_color(depth, 0.2, 0.6)
    agree = (picture[:, 0] == picture[:, -1]).all(axis=1)
    assert agree.mean() > 0.97  # all rows but the marks of the labels


def test_a_range_without_extent_is_refused():
    with pytest.raises(SettingsError, match='near = 0.6 m must be smaller than far = 0.6 m'):
        false_color(np.zeros((2, 2), np.float32), 0.6, 0.6)
