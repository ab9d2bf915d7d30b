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
"""Matches by chance in the paper's method, and what its confidence is worth."""

from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.paper import kernels, support_kernels
from color_stereo_ros.core.paper.support import window_step
from color_stereo_ros.evaluation.metrics import reliability, Truth
import naive
import numpy as np
import pytest
from scenes import hue_pair, load, paper_settings, parallel_rig

FIRST, COUNT = -2, 40
WINDOWS = [(9, 9), (9, 1), (5, 5)]


def noise(kind, shape, seed):
    """Return an image without any pattern, uint8 (H, W, 3)."""
    rng = np.random.default_rng(seed)
    mean, deviation = {'noise': (110, 40), 'noisy color': ((120, 60, 30), 2),
                       'one color': ((120, 60, 30), 0)}[kind]
    return np.clip(rng.normal(mean, deviation, (*shape, 3)), 0, 253).astype(np.uint8)


@pytest.mark.parametrize('kind', ['noise', 'noisy color', 'one color'])
@pytest.mark.parametrize('window', WINDOWS)
@pytest.mark.parametrize('nearest', [0.118, 0.5])
def test_images_without_a_pattern_get_no_ranges(kind, window, nearest):
    """295 disparities are searched, or 61."""
    shape = 96, 320
    settings = paper_settings(range__min_depth=nearest, range__max_depth=3.0,
                              matching__window_width=window[0], matching__window_height=window[1])
    stereo = ColorStereo(parallel_rig(320, 96, 600.0, 0.06), settings)
    assert stereo.process(noise(kind, shape, 5), noise(kind, shape, 6)).density < 0.01


@pytest.mark.parametrize('changes', [{'matching__local_limit': 12.0},
                                     {'matching__left_right_tolerance': 0.0}])
def test_no_setting_of_the_search_lets_noise_through(changes):
    settings = paper_settings(range__min_depth=0.5, range__max_depth=3.0, **changes)
    stereo = ColorStereo(parallel_rig(320, 96, 600.0, 0.06), settings)
    result = stereo.process(*(noise('noise', (96, 320), seed) for seed in (5, 6)))
    assert result.density < 0.01


@pytest.mark.parametrize('window', WINDOWS)
def test_one_color_seen_through_lenses_gets_no_ranges(window):
    """The edges of the raw image are no pattern."""
    scene = load('solids_hue1')
    settings = paper_settings(range__min_depth=0.22, range__max_depth=0.62,
                              matching__window_width=window[0], matching__window_height=window[1])
    image = noise('one color', scene.depth.shape, 7)
    assert ColorStereo(scene.calibration, settings).process(image, image).density < 0.01


@pytest.mark.parametrize('name', ['flat_350_hue1', 'prism_hue1'])
def test_of_the_pixels_of_one_confidence_that_share_is_right(name):
    """The model was fitted to other scenes."""
    scene = load(name)
    settings = paper_settings(range__min_depth=0.22, range__max_depth=0.62)
    result = ColorStereo(scene.calibration, settings).process(scene.left, scene.right)
    figures = reliability(result, Truth(scene.depth, scene.visible))
    assert figures['calibration_error'] < 0.05


def test_counts_agree_with_the_formulas():
    rng = np.random.default_rng(8)
    disparity = (10 + rng.normal(0, 1.5, (12, 30))).astype(np.float32)
    disparity[rng.random(disparity.shape) < 0.2] = np.nan
    right = np.ones((12, 30, 4), np.float32)
    low, high = np.zeros((12, 30), np.int32), np.full((12, 30), COUNT, np.int32)
    counts = np.empty((3, 12, 30), np.int32)
    support_kernels.count_agreements(disparity, right, FIRST, low, high, 4, 3, *counts)
    for y in range(12):
        for x in range(30):
            compared = sum(0 <= x - FIRST - k < 30 for k in range(COUNT))
            assert tuple(counts[:, y, x]) == naive.agreements(disparity, compared, y, x, 4, 3)


def test_verdicts_agree_with_the_formulas():
    rng = np.random.default_rng(9)
    shape = 6, 40
    own_known, known = rng.integers(0, 13, shape), rng.integers(0, 4000, shape)
    own_agreeing, agreeing = (np.int32(rng.random(shape) * (n + 1)) for n in (own_known, known))
    expected = np.int32(rng.random(shape) * 128 * known)
    deviation = np.float32(rng.uniform(0.01, 2, shape))
    disparity, confidence = np.full(shape, 5, np.float32), np.empty(shape, np.float32)
    status = np.zeros(shape, np.uint8)
    kept = deviation.copy()
    support_kernels.judge(own_agreeing, own_known.astype(np.int32), agreeing,
                          known.astype(np.int32), expected, 169, disparity, kept, confidence,
                          status)
    right = [naive.support_verdict(*values) for values in zip(
        agreeing.flat, known.flat, expected.flat, [169] * known.size, own_agreeing.flat,
        own_known.flat, deviation.astype(float).flat)]
    np.testing.assert_allclose(confidence.ravel(), right, atol=1e-5)
    np.testing.assert_array_equal(np.isfinite(disparity), status == 0)
    assert 0 < np.mean(status == 0) < 1


def test_windows_that_lie_apart_share_no_pixel():
    smooth = window_step(paper_settings(color__smoothing=4.0))
    rough = window_step(paper_settings(color__smoothing=0.0, matching__window_height=1))
    assert smooth > rough > (9, 1)


def test_two_places_of_cost_zero_have_an_offset():
    zero = np.float32(0)
    assert kernels._offset(zero, zero, np.float32(4), 2) == 0


def test_images_without_noise_are_measured_with_the_weighted_neighbor():
    left, right = hue_pair(7.0, width=96, height=48)
    settings = paper_settings(range__min_depth=0.5, range__max_depth=8.0,
                              matching__subpixel='weighted')
    result = ColorStereo(parallel_rig(96, 48), settings).process(left, right)
    assert result.density > 0.3
