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
"""Color correction: its kernels against their formulas, and what it makes of known cameras."""

from color_stereo_ros.core import ColorSettings, Status
from color_stereo_ros.core.cameras.geometry import RectifiedGeometry, RectifiedPair
from color_stereo_ros.core.paper import kernels
from color_stereo_ros.core.paper.color import (
    brightness_samples, ColorCorrection, equal_brightness_gains, estimated_dark_level, smoothed,
    split_gains)
from color_stereo_ros.core.patterns.colors import constant_sum_colors
import naive
import numpy as np
import pytest

HEIGHT, WIDTH = 96, 160
INSIDE = np.ones((HEIGHT, WIDTH), bool)


def camera_image(gains=(1.0, 1.0, 1.0), dark=0.0, brightness=180.0, period=120.0):
    """Return a camera's view of a shaded card under a hue sweep, uint8 (H, W, 3)."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    shading = brightness * (0.6 + 0.4 * rows / HEIGHT)
    signal = shading[..., None] * constant_sum_colors(3.0 * columns / period) * gains + dark
    return np.rint(signal).astype(np.uint8)


def pair_of(left, right):
    """Return a RectifiedPair."""
    geometry = RectifiedGeometry(WIDTH, HEIGHT, 100.0, 100.0, 80.0, 80.0, 48.0, 0.1)
    return RectifiedPair(left, right, INSIDE, INSIDE, geometry)


def gains_of(image, settings=ColorSettings()):
    """Return the estimated gains of one image."""
    dark = estimated_dark_level(image, INSIDE)
    return equal_brightness_gains(*brightness_samples(image, INSIDE, dark, settings))


@pytest.mark.parametrize('zero_weakest', [True, False])
@pytest.mark.parametrize('target', [0.0, 255.0])
def test_correction_agrees_with_the_formulas(zero_weakest, target):
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (9, 11, 3)).astype(np.uint8)
    image[2, 3] = 3
    inside = rng.random((9, 11)) > 0.1
    dark, gains = np.array([2.0, 3.0, 1.0], np.float32), np.array([1.0, 1.2, 2.0], np.float32)
    colors, reason = np.empty((9, 11, 4), np.float32), np.empty((9, 11), np.uint8)
    kernels.correct_colors(image, inside, dark, gains, np.float32(4.0), 250, zero_weakest,
                           np.float32(target), colors, reason)
    expected, expected_reason = naive.correct_colors(image, inside, dark, gains, 4.0, 250,
                                                     zero_weakest, target)
    np.testing.assert_array_equal(reason, expected_reason)
    np.testing.assert_allclose(colors, expected, rtol=1e-5, atol=1e-4)


def test_averages_of_spots_agree_with_the_formulas():
    rng = np.random.default_rng(2)
    image = rng.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    image[:8, :8] = rng.integers(20, 200, (8, 8, 3))
    inside = np.ones((20, 30), bool)
    inside[12, 3] = False
    dark = np.array([1.0, 2.0, 3.0], np.float32)
    colors, lit = np.empty((4, 6, 3), np.float32), np.empty((4, 6), bool)
    kernels.average_spots(image, inside, dark, np.float32(4.0), 250, 5, 3, colors, lit)
    expected, expected_lit = naive.average_spots(image, inside, dark, 4.0, 250, 5, 3)
    np.testing.assert_array_equal(lit, expected_lit)
    np.testing.assert_allclose(colors, expected, rtol=1e-5, atol=1e-4)


def test_reasons_are_the_status_codes():
    image = np.full((1, 4, 3), 100, np.uint8)
    image[0, 1], image[0, 2] = 1, 255
    inside = np.array([[True, True, True, False]])
    colors, reason = np.empty((1, 4, 4), np.float32), np.empty((1, 4), np.uint8)
    zero, one = np.zeros(3, np.float32), np.ones(3, np.float32)
    kernels.correct_colors(image, inside, zero, one, np.float32(4.0), 254, True,
                           np.float32(255.0), colors, reason)
    assert reason[0].tolist() == [Status.VALID, Status.DARK, Status.SATURATED,
                                  Status.OUTSIDE_IMAGE]


@pytest.mark.parametrize('dark', [0.0, 2.0, 12.0])
def test_the_dark_level_is_found_where_one_component_is_zero(dark):
    level = estimated_dark_level(camera_image(dark=dark), INSIDE)
    np.testing.assert_allclose(level, dark, atol=1.0)


def test_no_pixel_has_no_dark_level():
    assert estimated_dark_level(camera_image(), ~INSIDE).tolist() == [0, 0, 0]


@pytest.mark.parametrize('sensitivity', [(1, 1, 0.5), (0.7, 1, 0.4), (1, 1, 1)])
def test_gains_undo_the_sensitivities_of_the_channels(sensitivity):
    gains = gains_of(camera_image(gains=np.array(sensitivity), dark=2.0))
    balanced = gains * sensitivity
    np.testing.assert_allclose(balanced / balanced.max(), 1.0, atol=0.08)


def test_gains_are_one_where_nothing_is_lit():
    black = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    assert gains_of(black).tolist() == [1, 1, 1]


def test_gains_of_a_single_color_are_harmless():
    gains = gains_of(np.full((HEIGHT, WIDTH, 3), (200, 90, 4), np.uint8))
    assert np.isfinite(gains).all() and gains.min() >= 1


def test_cameras_of_one_type_share_their_gains():
    shared = np.array([1.0, 1.0, 2.0], np.float32)
    left, right = split_gains(shared, np.array([1.0, 1.0, 1.9]), np.array([1.1, 1.0, 2.1]))
    np.testing.assert_allclose(left, right)


def test_cameras_that_differ_much_keep_their_gains():
    shared = np.array([1.0, 1.0, 1.5], np.float32)
    left, right = split_gains(shared, np.array([1.0, 1.0, 1.0]), np.array([1.0, 1.0, 2.0]))
    np.testing.assert_allclose(right[2] / left[2], 2.0, rtol=1e-5)
    np.testing.assert_allclose(right[:2] / left[:2], 1.0, rtol=1e-5)


@pytest.mark.parametrize('mode', ['automatic', 'separate'])
def test_different_cameras_see_equal_colors_after_correction(mode):
    left = camera_image(gains=np.array([1.0, 1.0, 0.5]))
    right = camera_image(gains=np.array([0.8, 1.0, 1.0]))
    settings = ColorSettings(equalize_cameras=mode)
    (first, _), (second, _) = ColorCorrection(settings).correct(pair_of(left, right))
    assert np.abs(first - second)[..., :3].mean() < 6.0


def test_shared_gains_leave_different_cameras_different():
    left = camera_image(gains=np.array([1.0, 1.0, 0.5]))
    settings = ColorSettings(equalize_cameras='shared')
    (first, _), (second, _) = ColorCorrection(settings).correct(pair_of(left, camera_image()))
    assert np.abs(first - second)[..., :3].mean() > 8.0


def test_brightness_does_not_change_corrected_colors():
    settings = ColorSettings(dark_level=0.0, smoothing=0.0)
    dim, bright = (ColorCorrection(settings).correct(pair_of(image, image))[0][0]
                   for image in (camera_image(brightness=100.0), camera_image(brightness=200.0)))
    np.testing.assert_allclose(dim, bright, atol=3.5)  # rounding to 8 bits


def test_corrected_colors_sum_to_lambda():
    settings = ColorSettings(smoothing=0.0)
    colors, reason = ColorCorrection(settings).correct(pair_of(camera_image(), camera_image()))[0]
    assert (reason == Status.VALID).all()
    np.testing.assert_allclose(colors[..., :3].sum(axis=2), 255.0, rtol=1e-5)
    assert colors[..., :3].min(axis=2).max() == 0


def test_every_step_can_be_switched_off():
    image = camera_image()
    settings = ColorSettings(dark_level=0.0, equalize=False, zero_weakest=False, scale=False,
                             smoothing=0.0)
    colors, _ = ColorCorrection(settings).correct(pair_of(image, image))[0]
    np.testing.assert_allclose(colors[..., :3], image, atol=1e-4)


def test_smoothing_ignores_unusable_neighbors():
    colors = np.zeros((9, 9, 4), np.float32)
    colors[:, 4:] = (100, 50, 0, 1)
    reason = np.where(colors[..., 3] > 0, 0, 2).astype(np.uint8)
    result = smoothed(colors, reason, 1.5, np.empty_like(colors))
    np.testing.assert_allclose(result[:, 4:], np.broadcast_to(
        np.float32((100, 50, 0, 1)), (9, 5, 4)), rtol=1e-5)
    assert (result[:, :4] == 0).all()


def test_smoothing_lowers_noise():
    rng = np.random.default_rng(3)
    colors = np.ones((40, 40, 4), np.float32)
    colors[..., :3] = 100 + 5 * rng.standard_normal((40, 40, 3))
    result = smoothed(colors, np.zeros((40, 40), np.uint8), 1.0, np.empty_like(colors))
    assert result[..., :3].std() < 0.4 * colors[..., :3].std()
