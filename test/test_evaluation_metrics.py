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
"""The figures of the evaluation, on results whose errors are known because they were made."""

import math

from color_stereo_ros.core import ImageError, RangeResult, RectifiedGeometry, Status
from color_stereo_ros.core.triangulation import depth_from_disparity
from color_stereo_ros.evaluation import metrics
from color_stereo_ros.evaluation.metrics import Truth

import numpy as np

import pytest

GEOMETRY = RectifiedGeometry(width=160, height=120, focal_x=300.0, focal_y=300.0,
                             center_x_left=80.0, center_x_right=80.0, center_y=60.0,
                             baseline=0.1)
SHAPE = (GEOMETRY.height, GEOMETRY.width)


def plane_disparity(base=60.0, slope_x=0.03, slope_y=-0.02):
    """Return the disparity of a slanted plane, float64 (H, W), px."""
    rows, columns = np.indices(SHAPE)
    return base + slope_x * columns + slope_y * rows


def truth_of(disparity, visible=None):
    """Return the Truth of a disparity image, by default visible everywhere."""
    depth = depth_from_disparity(disparity, GEOMETRY)
    return Truth(depth.astype(np.float64), np.ones(SHAPE, bool) if visible is None else visible)


def result_of(disparity, confidence=1.0, std=0.1):
    """Return a RangeResult with these disparities; NaN = no range."""
    disparity = disparity.astype(np.float32)
    known = np.isfinite(disparity)
    return RangeResult(
        disparity=disparity, depth=depth_from_disparity(disparity, GEOMETRY),
        confidence=np.where(known, np.broadcast_to(np.float32(confidence), SHAPE), 0),
        status=np.where(known, Status.VALID, Status.NO_MATCH).astype(np.uint8),
        disparity_std=np.where(known, np.float32(std), np.float32(np.nan)),
        image_source=np.zeros((*SHAPE, 3), np.uint8), geometry=GEOMETRY,
        disparity_limits=(0.0, 120.0))


def test_a_perfect_result_has_no_error():
    true = plane_disparity()
    figures = metrics.measure(result_of(true), truth_of(true))
    assert figures['density'] == figures['correct'] == 1.0
    assert figures['bad_05'] == figures['bad_1'] == figures['bad_2'] == 0.0
    assert figures['false_share'] == 0.0
    assert figures['mean_px'] < 1e-5
    assert figures['mean_m'] < 1e-6


def test_density_and_correct_are_shares_of_the_visible_pixels():
    true = plane_disparity()
    visible = np.zeros(SHAPE, bool)
    visible[:, :100] = True
    measured = true.copy()
    measured[:, :25] = np.nan     # a quarter of the visible pixels has no range
    measured[:, 25:50] += 5.0     # another quarter is wrong by far more than 1 %
    figures = metrics.accuracy(result_of(measured), truth_of(true, visible))
    assert figures['density'] == pytest.approx(0.75)
    assert figures['correct'] == pytest.approx(0.5)


def test_bad_pixel_shares_are_taken_of_the_answered_visible_pixels():
    true = plane_disparity()
    measured = true.copy()
    measured[:60, :] = np.nan
    measured[60:75, :] += 0.7
    measured[75:90, :] -= 1.5
    measured[90:105, :] += 3.0
    figures = metrics.accuracy(result_of(measured), truth_of(true))
    assert figures['bad_05'] == pytest.approx(0.75)
    assert figures['bad_1'] == pytest.approx(0.5)
    assert figures['bad_2'] == pytest.approx(0.25)


def test_errors_in_meters_and_percent_follow_from_triangulation():
    true = np.full(SHAPE, 60.0)          # Z = 30 / 60 = 0.5 m
    figures = metrics.accuracy(result_of(true + 0.6), truth_of(true))
    expected = 0.5 - 30.0 / 60.6
    assert figures['mean_m'] == pytest.approx(expected, rel=1e-4)
    assert figures['median_percent'] == pytest.approx(100 * expected / 0.5, rel=1e-4)
    assert figures['p95_px'] == pytest.approx(0.6, rel=1e-4)


def test_correct_ends_at_one_percent_of_the_distance():
    true = np.full(SHAPE, 60.0)
    measured = true.copy()
    measured[:, :80] = 60.0 / 1.009       # 0.9 % too far
    measured[:, 80:] = 60.0 / 1.011       # 1.1 % too far
    assert metrics.accuracy(result_of(measured), truth_of(true))['correct'] == pytest.approx(0.5)


def test_false_ranges_are_those_where_the_truth_is_known_but_not_visible():
    true = plane_disparity()
    visible = np.ones(SHAPE, bool)
    visible[:, :40] = False
    measured = true.copy()
    measured[:60, :40] = np.nan
    share = metrics.false_share(result_of(measured), truth_of(true, visible))
    assert share == pytest.approx(60 * 40 / (120 * 160 - 60 * 40))


def test_ranges_where_nothing_is_known_are_neither_right_nor_false():
    true = plane_disparity()
    depth = depth_from_disparity(true, GEOMETRY)
    depth[:, :40] = np.nan
    truth = Truth(depth, np.isfinite(depth))
    assert metrics.false_share(result_of(true), truth) == 0.0
    assert metrics.accuracy(result_of(true), truth)['visible_pixels'] == 120 * 120


def test_a_result_without_ranges_has_density_zero_and_no_errors():
    figures = metrics.measure(result_of(np.full(SHAPE, np.nan)), truth_of(plane_disparity()))
    assert figures['density'] == 0.0
    assert figures['mean_px'] is None and figures['bad_1'] is None
    assert figures['planes'] is None and figures['locking'] is None


def test_plane_fit_returns_the_noise_and_ignores_a_bias():
    true = plane_disparity()
    noise = np.random.default_rng(1).normal(0, 0.08, SHAPE)
    figures = metrics.plane_fit(result_of(true + 0.5 + noise), truth_of(true))
    assert figures['planes'] == 1
    assert figures['rms_px'] == pytest.approx(0.08, rel=0.05)
    # dZ = Z^2 / (f B) dd, the normal is nearly along Z
    z = 30.0 / true.mean()
    assert figures['rms_mm'] == pytest.approx(1e3 * z * z / 30.0 * 0.08, rel=0.1)


def test_plane_fit_leaves_outliers_out_and_counts_them():
    true = plane_disparity()
    generator = np.random.default_rng(2)
    measured = true + generator.normal(0, 0.05, SHAPE)
    measured[generator.random(SHAPE) < 0.1] += 4.0
    figures = metrics.plane_fit(result_of(measured), truth_of(true))
    assert figures['rms_px'] == pytest.approx(0.05, rel=0.05)
    assert figures['left_out'] == pytest.approx(0.1, abs=0.015)


def test_a_sphere_is_no_plane_and_two_faces_are_two_planes():
    rows, columns = np.indices(SHAPE)
    ball = 60.0 + 10 * np.sqrt(np.maximum(1 - ((rows - 60) ** 2 + (columns - 80) ** 2) / 120**2,
                                          0))
    assert metrics.planar_regions(truth_of(ball), GEOMETRY)[1] == 0
    roof = 60.0 + 0.1 * np.abs(columns - 80.0)
    assert metrics.planar_regions(truth_of(roof), GEOMETRY)[1] == 2


def test_pixel_locking_finds_a_wave_of_known_height():
    true = plane_disparity()
    wave = 0.05 * np.sin(2 * np.pi * true)
    noise = np.random.default_rng(3).normal(0, 0.05, SHAPE)
    figures = metrics.pixel_locking(result_of(true + wave + noise), truth_of(true))
    assert figures['peak_to_peak_px'] == pytest.approx(0.10, abs=0.01)


def test_pixel_locking_of_pure_noise_is_nearly_nothing():
    true = plane_disparity()
    noise = np.random.default_rng(4).normal(0, 0.05, SHAPE)
    figures = metrics.pixel_locking(result_of(true + noise), truth_of(true))
    assert figures['peak_to_peak_px'] < 0.01


def test_pixel_locking_needs_all_fractions():
    true = np.full(SHAPE, 60.2)
    assert metrics.pixel_locking(result_of(true), truth_of(true)) is None


def test_the_density_curve_drops_the_least_trusted_pixels_first():
    true = plane_disparity()
    wrong = np.zeros(SHAPE, bool)
    wrong[:, 120:] = True                # a quarter is wrong, and says so
    result = result_of(true + 3.0 * wrong, confidence=np.where(wrong, 0.2, 0.9))
    curve = metrics.density_curve(result, truth_of(true))
    assert curve['density'][-1] == 1.0 and curve['bad_1'][-1] == pytest.approx(0.25)
    assert curve['bad_1'][14] == 0.0     # at three quarters of the density


def test_an_honest_confidence_has_no_calibration_error():
    true = plane_disparity()
    generator = np.random.default_rng(5)
    confidence = np.where(generator.random(SHAPE) < 0.5, 0.95, 0.35)
    wrong = generator.random(SHAPE) > confidence
    result = result_of(true + 2.0 * wrong, confidence=confidence)
    assert metrics.reliability(result, truth_of(true))['calibration_error'] < 0.02


def test_boasting_confidence_is_found_out():
    true = plane_disparity()
    confidence = np.where(np.indices(SHAPE)[1] % 2, 0.95, 0.85)
    figures = metrics.reliability(result_of(true + 2.0, confidence=confidence), truth_of(true))
    assert figures['calibration_error'] == pytest.approx(0.9, abs=0.01)


def test_z_scores_of_an_honest_standard_deviation_are_near_one():
    true = plane_disparity()
    noise = np.random.default_rng(6).normal(0, 0.1, SHAPE)
    figures = metrics.z_scores(result_of(true + noise, std=0.1), truth_of(true))
    assert figures['robust_std'] == pytest.approx(1.0, abs=0.03)
    assert figures['within_2'] == pytest.approx(math.erf(math.sqrt(2)), abs=0.01)


def test_status_shares_add_up_to_one():
    true = plane_disparity()
    true[:30] = np.nan
    shares = metrics.status_shares(result_of(true), truth_of(plane_disparity()))
    assert sum(share['all'] for share in shares.values()) == pytest.approx(1.0)
    assert shares['NO_MATCH']['visible'] == pytest.approx(0.25)


def test_sizes_must_agree():
    truth = Truth(np.ones((10, 10)), np.ones((10, 10), bool))
    with pytest.raises(ImageError, match='truth.depth has 10 x 10 pixels'):
        metrics.measure(result_of(plane_disparity()), truth)


def test_a_truth_without_visible_pixels_is_refused():
    truth = truth_of(plane_disparity(), np.zeros(SHAPE, bool))
    with pytest.raises(ImageError, match='visible is false everywhere'):
        metrics.measure(result_of(plane_disparity()), truth)
