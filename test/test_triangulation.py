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
"""Laws of the geometry between disparity, depth and points."""

from dataclasses import replace

from color_stereo_ros.core import RangeSettings, SettingsError
from color_stereo_ros.core.cameras.geometry import RectifiedGeometry
from color_stereo_ros.core.triangulation import (
    depth_from_disparity, disparity_from_depth, disparity_limits, points_from_depth,
    search_interval)
import numpy as np
import pytest

GEOMETRY = RectifiedGeometry(width=8, height=6, focal_x=500.0, focal_y=480.0, center_x_left=3.0,
                             center_x_right=40.0, center_y=2.5, baseline=0.2)
DEPTH = np.random.default_rng(1).uniform(0.2, 2.0, (6, 8)).astype(np.float32)


def test_disparity_to_depth_and_back_returns_the_disparity():
    disparity = disparity_from_depth(DEPTH, GEOMETRY)
    np.testing.assert_allclose(depth_from_disparity(disparity, GEOMETRY), DEPTH, rtol=1e-5)


def test_projected_points_return_pixel_and_disparity():
    points = points_from_depth(DEPTH, GEOMETRY).astype(float)
    x, y, z = np.moveaxis(points, -1, 0)
    rows, columns = np.indices(DEPTH.shape)
    u_left = GEOMETRY.focal_x * x / z + GEOMETRY.center_x_left
    u_right = GEOMETRY.focal_x * (x - GEOMETRY.baseline) / z + GEOMETRY.center_x_right
    np.testing.assert_allclose(u_left, columns, atol=1e-4)
    np.testing.assert_allclose(GEOMETRY.focal_y * y / z + GEOMETRY.center_y, rows, atol=1e-4)
    np.testing.assert_allclose(u_left - u_right, disparity_from_depth(DEPTH, GEOMETRY),
                               atol=1e-3)


def test_scaling_the_baseline_scales_the_depth():
    disparity = disparity_from_depth(DEPTH, GEOMETRY)
    longer = replace(GEOMETRY, baseline=3 * GEOMETRY.baseline)
    np.testing.assert_allclose(depth_from_disparity(disparity, longer),
                               3 * depth_from_disparity(disparity, GEOMETRY), rtol=1e-6)


def test_unknown_stays_unknown():
    disparity = np.array([[np.nan, -10.0]], np.float32)
    depth = depth_from_disparity(disparity, GEOMETRY)
    assert np.isnan(depth[0, 0]) and np.isfinite(depth[0, 1])
    assert np.isnan(points_from_depth(np.full((6, 8), np.nan, np.float32), GEOMETRY)).all()


def test_disparities_at_or_beyond_infinity_have_no_depth():
    disparity = np.array([[-37.0, -38.0, -1000.0]], np.float32)
    assert np.isnan(depth_from_disparity(disparity, GEOMETRY)).all()


def test_results_are_float32():
    depth = depth_from_disparity(np.zeros((6, 8), np.float32), GEOMETRY)
    assert depth.dtype == np.float32
    assert points_from_depth(depth, GEOMETRY).dtype == np.float32


def test_limits_are_the_disparities_of_the_depth_limits():
    smallest, largest = disparity_limits(replace(GEOMETRY, width=640),
                                         RangeSettings(min_depth=0.25, max_depth=0.5))
    assert smallest == pytest.approx(200.0 - 37.0)
    assert largest == pytest.approx(400.0 - 37.0)


def test_limits_outside_the_image_are_refused():
    with pytest.raises(SettingsError, match=r'range.min_depth = 0.1 m .. range.max_depth = 0.2 m '
                                            'gives disparities 463 .. 963 px, outside an image '
                                            'of 8 columns'):
        disparity_limits(GEOMETRY, RangeSettings(min_depth=0.1, max_depth=0.2))


def test_the_search_interval_holds_the_limits():
    assert search_interval((-3.5, 7.2)) == (-4, 8)
    assert search_interval((2.0, 5.0)) == (2, 5)
