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
"""Status codes, errors and results."""

from dataclasses import fields

from color_stereo_ros.core import (
    CalibrationError, ColorStereoError, ImageError, RangeResult, RecordingError, RectifiedGeometry,
    SettingsError, Status)
import numpy as np
import pytest

GEOMETRY = RectifiedGeometry(2, 2, 100.0, 100.0, 0.5, 10.5, 0.5, 0.1)


def result(depth, status, deviation=0.5):
    """Return a 2 x 2 result."""
    depth = np.array(depth, np.float32)
    return RangeResult(
        disparity=10 / depth - 10, depth=depth, confidence=np.ones((2, 2), np.float32),
        status=np.array(status, np.uint8), disparity_std=np.full((2, 2), deviation, np.float32),
        image_source=np.zeros((2, 2, 3), np.uint8), geometry=GEOMETRY,
        disparity_limits=(0.0, 10.0))


def test_status_codes_are_the_published_ones():
    assert [status.value for status in Status] == list(range(10))
    assert (Status.VALID, Status.OUTSIDE_IMAGE, Status.DARK, Status.SATURATED) == (0, 1, 2, 3)


def test_every_status_has_a_meaning():
    assert all(len(status.meaning) > 10 for status in Status)


@pytest.mark.parametrize('kind', [SettingsError, CalibrationError, ImageError, RecordingError])
def test_all_errors_are_of_one_family(kind):
    assert issubclass(kind, ColorStereoError) and issubclass(kind, ValueError)


def test_the_disparity_of_infinity_is_the_principal_offset():
    assert GEOMETRY.principal_offset == -10
    assert GEOMETRY.focal_baseline == pytest.approx(10)


def test_fields_of_a_result_keep_the_order_that_callers_rely_on():
    assert [field.name for field in fields(RangeResult) if not field.kw_only] == [
        'disparity', 'depth', 'confidence', 'status', 'disparity_std', 'image_source', 'geometry',
        'disparity_limits', 'seconds']


def test_density_counts_valid_pixels_of_all():
    assert result([[1, np.nan], [1, 1]], [[0, 4], [0, 0]]).density == 0.75


def test_depth_uncertainty_grows_with_the_square_of_depth():
    uncertainty = result([[1, 2], [4, np.nan]], [[0, 0], [0, 4]]).depth_std
    np.testing.assert_allclose(uncertainty[0], [0.05, 0.2], rtol=1e-6)
    assert uncertainty[1, 0] == pytest.approx(0.8) and np.isnan(uncertainty[1, 1])


def test_points_lie_on_the_rays_of_their_pixels():
    points = result([[2, 2], [2, np.nan]], [[0, 0], [0, 4]]).points()
    np.testing.assert_allclose(points[0, 0], [-0.01, -0.01, 2], atol=1e-6)
    assert np.isnan(points[1, 1]).all() and points.dtype == np.float32
