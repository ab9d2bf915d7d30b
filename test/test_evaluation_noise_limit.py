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
"""The noise limit, against formulas by hand and against estimators that reach it."""

from color_stereo_ros.core import RangeResult, RectifiedGeometry, RectifiedPair, SettingsError
from color_stereo_ros.core import Status
from color_stereo_ros.core.patterns.colors import constant_sum_colors
from color_stereo_ros.core.triangulation import depth_from_disparity
from color_stereo_ros.evaluation.metrics import Truth
from color_stereo_ros.evaluation.noise_limit import (
    CameraNoise, compare, measured_noise, noise_limit, Window)

import cv2

import numpy as np

import pytest

GEOMETRY = RectifiedGeometry(width=220, height=120, focal_x=300.0, focal_y=300.0,
                             center_x_left=110.0, center_x_right=110.0, center_y=60.0,
                             baseline=0.1)
SHAPE = (GEOMETRY.height, GEOMETRY.width)
DISPARITY = 40.0
BRIGHTNESS = 180.0
PERIOD = 120.0  # px of one hue turn


def sweep_pair(sigma=0.0, seed=0):
    """Return a pair of a hue sweep with white noise, and its truth; every pixel has all colors."""
    generator = np.random.default_rng(seed)
    images = []
    for shift in (0.0, DISPARITY):
        hue = 3.0 * (np.arange(GEOMETRY.width) + shift) / PERIOD
        colors = BRIGHTNESS * np.broadcast_to(constant_sum_colors(hue), (*SHAPE, 3))
        noisy = colors + 8.0 + generator.normal(0, max(sigma, 1e-9), colors.shape)
        images.append(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    inside = np.ones(SHAPE, bool)
    disparity = np.full(SHAPE, DISPARITY)
    visible = np.broadcast_to(np.arange(GEOMETRY.width) >= DISPARITY + 1, SHAPE)
    truth = Truth(depth_from_disparity(disparity, GEOMETRY), visible.copy())
    return RectifiedPair(*images, inside, inside, GEOMETRY), truth


def white_noise(sigma):
    """Return the noise of a camera whose every pixel has all three channels."""
    return CameraNoise((sigma ** 2,) * 3, (0.0,) * 3, dark=(8.0,) * 3, shares=(1.0, 1.0, 1.0))


def test_the_limit_of_a_linear_ramp_equals_the_formula_by_hand():
    pair, truth = sweep_pair()
    limit = noise_limit(pair, truth, white_noise(2.0), white_noise(2.0), Window(9, 9, 'constant'))
    # At a quarter of a ramp red and green are 3/4 and 1/4 of S: the chromaticity along the ramp
    # has the variance sigma^2 (p_g^2 + p_r^2) / S^2 and moves by 3 / PERIOD per pixel; blue adds
    # a second coordinate whose noise does not help and correlates only with the sum.
    column = int(0.25 * PERIOD / 3 + PERIOD)
    colors = np.array([0.75, 0.25, 0.0])
    jacobian = (np.eye(3) - np.outer(colors, np.ones(3)))[:2] / BRIGHTNESS
    covariance = 2 * 2.0 ** 2 * jacobian @ jacobian.T
    gradient = np.array([-1.0, 1.0]) * 3 / PERIOD
    by_hand = 1 / np.sqrt(81 * gradient @ np.linalg.solve(covariance, gradient))
    assert limit[60, column] == pytest.approx(by_hand, rel=0.1)


def test_a_plane_costs_nothing_in_the_middle_of_an_even_window():
    pair, truth = sweep_pair()
    noise = white_noise(2.0)
    constant = noise_limit(pair, truth, noise, noise, Window(9, 9, 'constant'))
    plane = noise_limit(pair, truth, noise, noise, Window(9, 9, 'plane'))
    known = np.isfinite(plane)
    assert np.all(plane[known] >= constant[known] - 1e-9)
    assert np.median(plane[known] / constant[known]) < 1.05


def test_the_limit_is_proportional_to_the_noise_and_falls_with_the_window():
    pair, truth = sweep_pair()
    one, two = white_noise(1.0), white_noise(2.0)
    first = noise_limit(pair, truth, one, one, Window(9, 9, 'constant'))
    second = noise_limit(pair, truth, two, two, Window(9, 9, 'constant'))
    wide = noise_limit(pair, truth, one, one, Window(9, 27, 'constant'))
    known = np.isfinite(wide)
    assert np.nanmedian(second / first) == pytest.approx(2.0, rel=1e-6)
    assert np.median(first[known] / wide[known]) == pytest.approx(np.sqrt(3), rel=0.02)


def test_a_bayer_mosaic_raises_the_limit_by_its_shares():
    pair, truth = sweep_pair()
    full = white_noise(1.0)
    quarter = CameraNoise(full.floor, full.slope, dark=full.dark, shares=(0.25, 0.25, 0.25))
    ratio = noise_limit(pair, truth, quarter, quarter) / noise_limit(pair, truth, full, full)
    assert np.nanmedian(ratio) == pytest.approx(2.0, rel=1e-6)


def test_least_squares_on_chromaticity_reaches_the_limit():
    sigma, window = 2.0, Window(9, 9, 'constant')
    errors = []
    for seed in range(6):
        pair, truth = sweep_pair(sigma, seed)
        errors.append(estimate(pair) - DISPARITY)
    limit = noise_limit(pair, truth, white_noise(sigma), white_noise(sigma), window)
    ramp = np.isfinite(limit) & on_ramps()
    ratio = np.array(errors)[:, ramp] / limit[ramp]
    assert np.sqrt(np.mean(ratio ** 2)) == pytest.approx(1.0, abs=0.15)


def estimate(pair):
    """Return disparities by one least squares step from the true one, 9 x 9, float64 (H, W)."""
    left, right = (image.astype(np.float64) - 8.0 for image in (pair.left, pair.right))
    right = np.roll(right, int(DISPARITY), axis=1)
    p, q = (colors / colors.sum(axis=2, keepdims=True) for colors in (left, right))
    hue = 3.0 * (np.arange(GEOMETRY.width) % PERIOD) / PERIOD
    slope = constant_sum_colors(hue + 1e-3) - constant_sum_colors(hue - 1e-3)
    slope = np.broadcast_to(slope * 500 * 3 / PERIOD, p.shape)[..., :2]
    true = np.broadcast_to(constant_sum_colors(hue), p.shape)
    jacobian = (np.eye(3) - true[..., None] * np.ones(3))[..., :2, :] / BRIGHTNESS
    weight = np.linalg.inv(2 * jacobian @ np.swapaxes(jacobian, -1, -2))
    # p - q = slope * (disparity - true disparity): the images were taken apart by that much.
    moment = np.einsum('...i,...ij,...j', slope, weight, (q - p)[..., :2])
    power = np.einsum('...i,...ij,...j', slope, weight, slope)
    return DISPARITY - cv2.blur(moment, (9, 9)) / cv2.blur(power, (9, 9))


def on_ramps():
    """Return pixels whose window holds no kink of the sweep."""
    position = np.arange(GEOMETRY.width) % (PERIOD / 3)
    return np.broadcast_to((position > 7) & (position < PERIOD / 3 - 7), SHAPE)


def test_measured_noise_finds_the_noise_that_was_added():
    pair, truth = sweep_pair(3.0, seed=1)
    known, found = white_noise(3.0), measured_noise(pair, truth)
    ratio = (noise_limit(pair, truth, found, found, Window(9, 9, 'constant'))
             / noise_limit(pair, truth, known, known, Window(9, 9, 'constant')))
    assert np.nanmedian(ratio[:, on_ramps()[0]]) == pytest.approx(1.0, abs=0.3)


def test_no_limit_beside_hidden_and_saturated_pixels():
    pair, truth = sweep_pair()
    pair.left[60, 150] = 255
    limit = noise_limit(pair, truth, white_noise(1.0), white_noise(1.0), Window(9, 9))
    assert np.isnan(limit[60, 150]) and np.isnan(limit[56, 146]) and np.isnan(limit[60, 42])
    assert np.isfinite(limit[55, 150])


def test_error_over_limit_of_errors_at_the_limit_is_one():
    pair, truth = sweep_pair()
    limit = noise_limit(pair, truth, white_noise(2.0), white_noise(2.0))
    errors = np.random.default_rng(3).normal(0, 1, SHAPE) * np.nan_to_num(limit)
    disparity = (DISPARITY + errors).astype(np.float32)
    result = RangeResult(
        disparity=disparity, depth=depth_from_disparity(disparity, GEOMETRY),
        confidence=np.ones(SHAPE, np.float32), status=np.full(SHAPE, Status.VALID, np.uint8),
        disparity_std=np.ones(SHAPE, np.float32), image_source=pair.left, geometry=GEOMETRY,
        disparity_limits=(0.0, 80.0))
    figures = compare(result, truth, limit)
    assert figures['error_over_limit'] == pytest.approx(1.0, abs=0.03)
    assert figures['pixels'] == np.count_nonzero(np.isfinite(limit))


@pytest.mark.parametrize('arguments, message', [
    ((8, 9), 'width = 8 px is no odd number'), ((9, 0), 'height = 0 px is no odd number'),
    ((9, 9, 'sphere'), "surface = 'sphere' is not one of plane, constant")])
def test_impossible_windows_are_refused(arguments, message):
    with pytest.raises(SettingsError, match=message):
        Window(*arguments)
