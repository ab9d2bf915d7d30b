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
"""Several pairs of a still scene, fused by their variances."""

from dataclasses import replace

from color_stereo_ros.core import ColorStereo, ImageError, RangeResult, Status
from color_stereo_ros.core.fusion import Fusion
from color_stereo_ros.core.triangulation import depth_from_disparity

import naive_fusion

import numpy as np

import pytest

from surface_pairs import exposed, photographed, plane, rig, surface_settings

WIDTH, HEIGHT = 200, 128
PAIRS = 8
GEOMETRY = rig(24, 16).geometry


def result_of(disparity, std=0.1, confidence=0.9, status=Status.NO_MATCH, geometry=GEOMETRY):
    """Return a RangeResult with these values; NaN in disparity: no range."""
    disparity = np.array(disparity, np.float32)
    known = np.isfinite(disparity)

    def where(value, otherwise):
        return np.where(known, np.float32(value), np.float32(otherwise)).astype(np.float32)

    return RangeResult(
        disparity=disparity, depth=depth_from_disparity(disparity, geometry),
        confidence=where(confidence, 0), disparity_std=where(std, np.nan),
        status=np.where(known, Status.VALID, status).astype(np.uint8),
        views=known.astype(np.uint8), image_source=np.zeros((*disparity.shape, 3), np.uint8),
        geometry=geometry, disparity_limits=(1, 60))


def fused(results):
    """Return a Fusion of results."""
    fusion = Fusion()
    for result in results:
        fusion.add(result)
    return fusion


def random_results(seed, pairs=PAIRS, shape=(16, 24)):
    """Return results with noise, gaps, wrong values and deviations of all sizes."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform(10, 30, shape)
    results = []
    for _ in range(pairs):
        std = rng.uniform(0.02, 0.6, shape)
        disparity = truth + std * rng.standard_normal(shape)
        disparity += np.where(rng.random(shape) < 0.15, rng.uniform(-8, 8, shape), 0)
        disparity[rng.random(shape) < rng.random(shape)] = np.nan
        results.append(result_of(disparity, std, rng.uniform(0.6, 1.0, shape)))
    return results


@pytest.mark.parametrize('pairs', [1, 2, 3, 8])
def test_the_fusion_is_that_of_its_naive_twin(effort, pairs):
    for seed in effort.seeds(2, 50):
        results = random_results(seed, pairs)
        fusion = fused(results)
        found = fusion.result()
        pixels = {}
        for place in np.ndindex(found.disparity.shape):
            pixels[place] = [
                tuple(float(value[place]) for value in (each.disparity, each.disparity_std,
                                                        each.confidence))
                for each in results if np.isfinite(each.disparity[place])]
        noise = naive_fusion.noise_share(pixels.values())
        assert fusion.noise_share == pytest.approx(noise, rel=1e-4)
        moved = found.status == Status.MOVED
        for place, values in pixels.items():
            expected, _ = naive_fusion.fuse(values, pairs, noise)
            if expected is None or moved[place]:
                assert np.isnan(found.disparity[place]) and found.confidence[place] == 0
                continue
            assert (found.disparity[place], found.disparity_std[place], found.confidence[place]
                    ) == pytest.approx(expected, rel=2e-3)


def test_what_is_fused_is_a_complete_result():
    results = random_results(1)
    found = fused(results).result()
    valid = found.status == Status.VALID
    np.testing.assert_array_equal(valid, np.isfinite(found.depth))
    np.testing.assert_array_equal(valid, np.isfinite(found.disparity_std))
    np.testing.assert_array_equal(valid, found.confidence > 0)
    np.testing.assert_array_equal(valid, found.views > 0)
    np.testing.assert_array_equal(found.depth, depth_from_disparity(found.disparity, GEOMETRY))
    assert found.image is results[-1].image
    assert {value.dtype for value in (found.depth, found.disparity, found.confidence,
                                      found.disparity_std)} == {np.dtype(np.float32)}
    assert found.status.dtype == found.views.dtype == np.uint8


def test_one_pair_stays_as_it_is():
    result = random_results(2, pairs=1)[0]
    found = fused([result]).result()
    np.testing.assert_allclose(found.disparity, result.disparity, rtol=1e-6)
    np.testing.assert_allclose(found.disparity_std, result.disparity_std, rtol=1e-5)
    np.testing.assert_array_equal(found.status, result.status)


def test_a_range_needs_half_of_the_pairs_and_others_keep_their_reason():
    known, unknown = result_of(np.full((16, 24), 20.0)), result_of(
        np.full((16, 24), np.nan), status=Status.DARK)
    assert (fused([known, unknown]).result().status == Status.VALID).all()
    assert (fused([known, unknown, unknown]).result().status == Status.DARK).all()


def test_a_method_without_deviations_gets_plain_means():
    results = [result_of(np.full((16, 24), value)) for value in (20.0, 20.2, 20.1)]
    unknown = [replace(each, disparity_std=np.full_like(each.disparity, np.nan))
               for each in results]
    found = fused(unknown).result()
    np.testing.assert_allclose(found.disparity, 20.1, rtol=1e-5)
    assert np.isnan(found.disparity_std).all()


def test_pairs_of_different_calibrations_are_refused():
    fusion = fused([result_of(np.full((16, 24), 20.0))])
    with pytest.raises(ImageError, match='calibration has changed'):
        fusion.add(result_of(np.full((16, 24), 20.0), geometry=rig(24, 16, offset=3.0).geometry))
    with pytest.raises(ImageError, match='no pair'):
        Fusion().result()


@pytest.mark.parametrize('first_moved', range(2, 8))
@pytest.mark.parametrize('shift', [0.8, 3.0])
def test_a_part_that_moves_is_named_and_left_out(first_moved, shift):
    rng = np.random.default_rng(1)
    results = []
    for number in range(PAIRS):
        disparity = 20 + 0.1 * rng.standard_normal((16, 24))
        if number >= first_moved:
            disparity[:, 12:] += shift
        results.append(result_of(disparity))
    fusion = fused(results)
    status = fusion.result().status
    if shift > 1 and first_moved == 7:  # one value of eight may be a wrong match
        assert (status == Status.VALID).all()
        return
    assert (status[:, 14:] == Status.MOVED).all() and (status[:, :10] == Status.VALID).all()
    assert fusion.moved_share == pytest.approx(0.5, abs=0.1)
    assert fusion.about_motion().startswith('; the scene moved meanwhile: ')


def test_wrong_values_of_single_pixels_are_no_motion():
    rng = np.random.default_rng(1)
    results = []
    for _ in range(PAIRS):
        disparity = 20 + 0.1 * rng.standard_normal((16, 24))
        disparity[rng.random((16, 24)) < 0.03] += 5
        results.append(result_of(disparity))
    fusion = fused(results)
    assert fusion.moved_share == 0 and fusion.about_motion() == ''
    assert np.abs(fusion.result().disparity - 20).max() < 0.3


def hilly():
    """Return a disparity with a plane, a wave and a step."""
    column = np.arange(WIDTH)
    truth = plane(WIDTH, HEIGHT, 20.0, 0.04, -0.03)
    truth = truth + 1.5 * np.sin(2 * np.pi * column / 90) * (np.arange(HEIGHT) < 64)[:, None]
    return truth


@pytest.mark.parametrize('brightness', [180.0, 50.0])
def test_eight_pairs_have_a_third_of_the_noise_and_an_honest_deviation(
        brightness, effort, figures):
    truth, rng = hilly(), np.random.default_rng(1)
    light = [photographed(-truth), photographed(np.zeros(truth.shape))]
    sensor = ColorStereo(rig(WIDTH, HEIGHT), surface_settings(8, 40))
    single, together, rounds = [], [], effort.count(4, 40)
    for _ in range(rounds):
        results = [sensor.process(*(exposed(each, rng, brightness) for each in light))
                   for _ in range(PAIRS)]
        fusion = fused(results)
        assert not fusion.about_motion()
        single += results
        together.append(fusion.result())
    seen = np.zeros(truth.shape, bool)
    seen[:, 45:] = True
    spread, fused_spread = (np.nanstd([each.disparity for each in group], axis=0, ddof=1)[seen]
                            for group in (single, together))
    # few rounds spread by themselves: the pooled variance is what they tell
    known = np.isfinite(spread) & np.isfinite(fused_spread)
    name = f'capture.pairs, {PAIRS} pairs at {brightness:.0f} DN'
    ratio = np.sqrt(np.median(fused_spread[known] ** 2) / np.median(spread[known] ** 2)
                    / chi_squared_median(rounds - 1))
    figures(f'{name}: temporal standard deviation over that of one pair', ratio,
            '(ideal: 0.354)', over=rounds, at_most=0.4)
    one, eight = (z68(group, truth, seen) for group in (single, together))
    figures(f'{name}: z68 of one pair', one, '(1 is honest)', over=rounds, at_least=0.5,
            at_most=1.3)
    figures(f'{name}: z68', eight, '(1 is honest)', over=rounds, at_least=0.5,
            at_most=max(1.1 * one, 1.15))
    assert np.mean([each.density for each in together]) > 0.99 * np.mean(
        [each.density for each in single])


def chi_squared_median(freedom):
    """Return the median of chi-squared over its degrees of freedom (Wilson and Hilferty)."""
    return (1 - 2 / (9 * freedom)) ** 3


def z68(results, truth, seen):
    """Return the 68th percentile of |error| / standard deviation."""
    ratios = np.concatenate([(np.abs(each.disparity - truth) / each.disparity_std)[seen]
                             for each in results])
    return float(np.nanpercentile(ratios, 68))
