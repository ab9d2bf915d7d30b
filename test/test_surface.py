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
"""The surface method on pairs of known disparity: its precision, its honesty and its switches."""

from concurrent.futures import ThreadPoolExecutor
import os
from pathlib import Path

from color_stereo_ros.core import CameraModel, ColorStereo, Settings, Status, StereoCalibration
from color_stereo_ros.core.cameras.rectification import raw_coordinates
from color_stereo_ros.core.compiled import Arena
from color_stereo_ros.core.patterns.expectation import Expectation
from color_stereo_ros.core.pipeline import Stopwatch
from color_stereo_ros.core.surface import bends, planes, quality, views
from color_stereo_ros.core.surface.coarse import CoarseSearch, Seeds
from color_stereo_ros.core.surface.gains import gains_of
from color_stereo_ros.core.surface.grid import framed_area, HalfGrid, whole
from color_stereo_ros.core.surface.grid_kernels import F4, PAD, TILE_COLUMNS, TILE_ROWS
from color_stereo_ros.core.surface.method import SurfaceMethod
from color_stereo_ros.core.surface.texture import TextureSearch
from color_stereo_ros.core.surface.tuning import TUNING, tuning_for
import cv2
import numba
import numpy as np
import pytest
from surface_pairs import (exposed, FOCAL, pair_of, photographed, plane, plane_pair, rig,
                           step_pair, surface_settings)

WIDTH, HEIGHT = 256, 160
LIMITS = 2.0, 60.0
NEAR, FAR, FIRST, LAST = 44, 16, 120, 190  # the step: a near strip before a far plane
REASONS = {Status.NO_MATCH, Status.AMBIGUOUS, Status.INCONSISTENT, Status.IMPLAUSIBLE}


def sensor(width=WIDTH, height=HEIGHT, limits=LIMITS, offset=0.0, **changes):
    """Return a sensor for rectified pairs; changes name settings with __ for the dot."""
    return ColorStereo(rig(width, height, offset),
                       surface_settings(*limits, offset, **changes))


@pytest.fixture(scope='module')
def stereo():
    """Return the sensor with default settings."""
    return sensor()


@pytest.fixture(scope='module')
def step():
    """Return the pair of a step, its disparity, and what only left sees."""
    return step_pair(WIDTH, HEIGHT, NEAR, FAR, FIRST, LAST)


def seen_by_both(disparity, margin=8):
    """Return the pixels so far from the borders of both images."""
    height, width = disparity.shape
    row, column = np.mgrid[:height, :width]
    seen = (row >= margin) & (row < height - margin)
    for place in (column, column - disparity):
        seen &= (place >= margin) & (place < width - margin)
    return seen


def errors(result, truth, where=None):
    """Return the errors, px, of the ranges where both cameras see, and their share."""
    where = seen_by_both(truth) if where is None else where
    known = where & np.isfinite(result.disparity)
    return (result.disparity - truth)[known], np.count_nonzero(known) / np.count_nonzero(where)


def locking(result, truth, bins=8):
    """Return the peak to peak of the median error over the fraction of the disparity, px."""
    known = seen_by_both(truth) & np.isfinite(result.disparity)
    phase = np.floor(truth % 1 * bins)[known]
    error = (result.disparity - truth)[known]
    return np.ptp([np.median(error[phase == k]) for k in range(bins)])


# 60 degrees about the vertical axis at 0.8 m: baseline * tan(60 deg) / distance
STEEP = 0.1 * np.tan(np.radians(60)) / 0.8


@pytest.mark.parametrize('slope_x, slope_y', [
    (0, 0), (0.05, 0.03), (STEEP, 0), (-STEEP, 0), (0, STEEP)])
def test_planes_are_found_to_a_twentieth_of_a_pixel(stereo, slope_x, slope_y):
    truth = plane(WIDTH, HEIGHT, 29.7, slope_x, slope_y)
    result = stereo.process(*pair_of(truth))
    error, share = errors(result, truth)
    assert share > 0.98
    assert np.median(np.abs(error)) < 0.05
    assert np.abs(np.median(error)) < 0.015
    assert np.mean(np.abs(error) > 1) < 0.002


def test_planes_of_any_direction_are_found_to_a_twentieth_of_a_pixel(stereo, effort, figures):
    seeds = effort.seeds(3, 200)
    medians, wrong, shares = [], [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        truth = plane(WIDTH, HEIGHT, rng.uniform(24, 36), *rng.uniform(-0.1, 0.1, 2))
        error, share = errors(stereo.process(*pair_of(truth, seed=seed)), truth)
        medians.append(np.median(np.abs(error)))
        wrong.append(np.mean(np.abs(error) > 1))
        shares.append(share)
    figures('surface: planes, largest median error', max(medians), 'px', over=seeds, at_most=0.05)
    figures('surface: planes, errors above 1 px', np.mean(wrong), 'of the ranges', over=seeds,
            at_most=0.002)
    figures('surface: planes, smallest density', min(shares), 'of what both see', over=seeds,
            at_least=0.98)


@pytest.mark.parametrize('slope', [0.05, STEEP, -STEEP])
def test_fractions_of_a_pixel_are_not_drawn_to_whole_ones(stereo, slope):
    truth = plane(WIDTH, HEIGHT, 30, slope)
    assert locking(stereo.process(*pair_of(truth)), truth) < 0.02


@pytest.mark.parametrize('disparity', [20.0, 20.25, 20.5, 20.75])
def test_every_fraction_of_a_pixel_is_equally_precise(stereo, disparity):
    truth = np.full((HEIGHT, WIDTH), disparity)
    error, _ = errors(stereo.process(*pair_of(truth)), truth)
    assert np.abs(np.median(error)) < 0.015
    assert np.median(np.abs(error)) < 0.05


def test_depth_follows_from_disparity_and_principal_points():
    offset = -40.0
    truth = plane(WIDTH, HEIGHT, -12.3, 0.03)
    result = sensor(limits=(-38, 20), offset=offset).process(*pair_of(truth))
    error, share = errors(result, truth)
    assert share > 0.98 and np.median(np.abs(error)) < 0.05
    valid = result.status == Status.VALID
    assert (result.disparity[valid] < 0).mean() > 0.9
    np.testing.assert_allclose(
        result.depth[valid], FOCAL * 0.1 / (result.disparity[valid] - offset), rtol=1e-5)


def test_both_sides_of_a_step_are_found(stereo, step):
    left, right, truth, hidden = step
    result = stereo.process(left, right)
    for level in (NEAR, FAR):
        side = (truth == level) & seen_by_both(truth) & ~hidden
        error, share = errors(result, truth, side)
        assert share > 0.97
        assert np.median(np.abs(error)) < 0.05
        assert np.mean(np.abs(error) > 1) < 0.01


def test_what_only_left_sees_gets_no_range_but_a_reason(stereo, step):
    left, right, _, hidden = step
    status = stereo.process(left, right).status
    assert np.mean(status[hidden] == Status.VALID) < 0.2
    rejected = status[hidden & (status != Status.VALID)]
    assert {Status(code) for code in np.unique(rejected)} <= REASONS
    assert np.mean(rejected == Status.INCONSISTENT) > 0.3


def test_dark_parts_say_so(stereo):
    left, right = plane_pair(WIDTH, HEIGHT, 20)
    left[60:100, 120:160] = 1
    right[60:100, 100:140] = 1
    status = stereo.process(left, right).status
    assert np.mean(status[70:90, 130:150] == Status.DARK) > 0.95


def test_overexposed_parts_say_so(stereo):
    left, right = plane_pair(WIDTH, HEIGHT, 20)
    left[40:120, 100:180] = 255
    right[40:120, 80:160] = 255
    status = stereo.process(left, right).status
    assert np.mean(status[60:100, 120:160] == Status.SATURATED) > 0.95


def test_a_uniform_color_gives_no_range(stereo):
    image = np.full((HEIGHT, WIDTH, 3), (120, 60, 3), np.uint8)
    assert stereo.process(image, image).density == 0


def test_surfaces_outside_the_limits_get_no_range():
    near_only = sensor(limits=(30, 60))
    result = near_only.process(*plane_pair(WIDTH, HEIGHT, 28.5))
    assert result.density < 0.05
    assert np.mean(result.status == Status.OUT_OF_RANGE) > 0.5


def test_pixels_outside_the_raw_image_say_so():
    calibration = rig(WIDTH, HEIGHT)
    wide = [CameraModel(c.name, c.width, c.height, c.distortion_model, c.D,
                        c.K * [[2, 1, 1], [1, 2, 1], [1, 1, 1]], c.R, c.P)
            for c in (calibration.left, calibration.right)]
    truth = np.full((HEIGHT, WIDTH), 20.0)
    status = ColorStereo(StereoCalibration(*wide), surface_settings(*LIMITS)).process(
        *pair_of(truth)).status
    inside = np.zeros(status.shape, bool)
    inside[42:-42, 66:-66] = True
    assert (status[:36] == Status.OUTSIDE_IMAGE).all()
    assert not (status[inside] == Status.OUTSIDE_IMAGE).any()


def test_every_documented_reason_occurs(stereo, step):
    left, right, *_ = step
    left, right = left.copy(), right.copy()
    left[:16, 60:100] = 0
    left[20:60, 20:60] = 255
    left[100:140, 200:250] = np.random.default_rng(1).integers(0, 255, (40, 50, 3))
    found = set(np.unique(stereo.process(left, right).status))
    found |= set(np.unique(sensor(limits=(30, 60)).process(left, right).status))
    # both have tests of their own
    assert found >= set(Status) - {Status.OUTSIDE_IMAGE, Status.MOVED}


@pytest.mark.parametrize('level', [0, 128, 255])
def test_images_of_one_gray_give_no_range(stereo, level):
    image = np.full((HEIGHT, WIDTH, 3), level, np.uint8)
    result = stereo.process(image, image)
    assert result.density == 0
    expected = {0: Status.DARK, 128: Status.AMBIGUOUS, 255: Status.SATURATED}[level]
    assert np.mean(result.status == expected) > 0.95


@pytest.mark.parametrize('low, high, most', [
    (0, 256, 0.01), (0, 60, 0.01), (100, 140, 0.05), (0, 4, 0.01)])
def test_noise_gives_hardly_any_range(stereo, low, high, most, effort, figures):
    seeds = effort.seeds(2, 100)
    densities = []
    for seed in seeds:
        left, right = np.random.default_rng(seed).integers(low, high, (2, HEIGHT, WIDTH, 3))
        densities.append(stereo.process(left.astype(np.uint8), right.astype(np.uint8)).density)
    figures(f'surface: noise of {low} .. {high - 1} DN, largest density', max(densities),
            'of the pixels', over=seeds, at_most=most)


def test_different_scenes_in_left_and_right_give_hardly_any_range(stereo):
    left, _ = plane_pair(WIDTH, HEIGHT, 20)
    assert stereo.process(left, left[::-1]).density < 0.05


def test_every_range_has_a_finite_standard_deviation(stereo, step):
    left, right, *_ = step
    left = left.copy()
    left[40:70, 60:100] = 3
    result = stereo.process(left, right)
    valid = result.status == Status.VALID
    assert np.isfinite(result.disparity_std[valid]).all()
    assert (result.disparity_std[valid] > 0).all()


@pytest.mark.parametrize('kind', ['hue_field', 'sweep'])
def test_errors_are_as_large_as_the_standard_deviation_says(kind, effort, figures):
    """Under a sweep the colors are averaged first, so that neighbors share their noise."""
    seeds = effort.seeds(1, 100)
    truth = plane(256, 160, 20.0, 0.05, -0.03)
    sensor = ColorStereo(rig(256, 160), surface_settings(8, 36, pattern__type=kind))
    inner = np.s_[30:-30, 60:-30]
    ratios = []
    for seed in seeds:
        result = sensor.process(*pair_of(truth, kind=kind, seed=seed + 1))
        ratios.append(np.abs(result.disparity - truth)[inner] / result.disparity_std[inner])
        assert np.isfinite(ratios[-1]).mean() > 0.9
    figures(f'surface: {kind}, median of |error| / standard deviation', np.nanmedian(ratios),
            '(normal: 0.67)', over=seeds, at_least=0.2, at_most=1.2)


def waves(bend, length=80.0):
    """Return a disparity whose largest second difference over 12 px is bend, float64 (H, W)."""
    column = np.arange(WIDTH)
    height = bend / (2 - 2 * np.cos(2 * np.pi * 6 / length))
    return np.broadcast_to(20 + height * np.sin(2 * np.pi * column / length), (HEIGHT, WIDTH))


@pytest.mark.parametrize('bend', [0.2, 0.5])
def test_surfaces_that_bend_are_found_with_an_honest_deviation(stereo, bend, effort, figures):
    """The tops of waves, where planes of wide windows are off by .15 to .4 px."""
    truth = waves(bend)
    second = np.abs(np.roll(truth, 6, 1) + np.roll(truth, -6, 1) - 2 * truth)
    tops = seen_by_both(truth, 20) & (second > 0.7 * bend)
    seeds, found, ratios = effort.seeds(2, 50), [], []
    for seed in seeds:
        result = stereo.process(*pair_of(truth, seed=seed + 1))
        error = np.abs(result.disparity - truth)[tops]
        found.append(error)
        ratios.append(error / result.disparity_std[tops])
    assert np.isfinite(found).mean() > 0.98
    figures(f'surface: bends of {bend} px over 12 px, median error', np.nanmedian(found), 'px',
            over=seeds, at_most=0.08)
    figures(f'surface: bends of {bend} px over 12 px, 68 % of |error| / standard deviation',
            np.nanpercentile(ratios, 68), '(1 is honest)', over=seeds, at_least=0.5,
            at_most=1.4)


def test_bends_and_deviations_are_honest_where_brightness_counts(effort, figures):
    """The same under the same pattern, named unknown."""
    truth = waves(0.35)
    sensor = ColorStereo(rig(WIDTH, HEIGHT), surface_settings(5, 60, pattern__type='unknown'))
    seen = seen_by_both(truth, 20)
    seeds, found, ratios = effort.seeds(2, 50), [], []
    for seed in seeds:
        result = sensor.process(*pair_of(truth, seed=seed + 1))
        error = np.abs(result.disparity - truth)[seen]
        found.append(error)
        ratios.append(error / result.disparity_std[seen])
        sure = np.nan_to_num(result.confidence[seen]) > 0.9
        assert sure.mean() > 0.9
        assert np.all(error[sure] < 1)
    figures('surface: bends under an unknown pattern, median error', np.nanmedian(found), 'px',
            over=seeds, at_most=0.05)
    figures('surface: bends under an unknown pattern, 68 % of |error| / standard deviation',
            np.nanpercentile(ratios, 68), '(1 is honest)', over=seeds, at_least=0.6,
            at_most=1.4)


def test_the_variance_grows_with_pulls_and_second_differences():
    tuning = TUNING.quality
    field = planes.PlaneField(HalfGrid(96, 128), 0.09, True, Arena())
    known = quality.Quality(field.grid, tuning, Arena())
    known.samples[0], known.samples[1], known.samples[2] = 2, 0.5, 1
    field.variance.fill(0.01)
    known.correct_variance(field)
    factor = tuning.pull_gain * 2 ** 2 * 0.5 ** tuning.uneven_power
    np.testing.assert_allclose(field.variance[field.grid.inner], 0.01 * factor, rtol=1e-5)
    np.testing.assert_allclose(known.uneven(), np.log(0.5), rtol=1e-5)
    known.samples[2] = 0  # nothing is known
    field.variance.fill(0.01)
    known.correct_variance(field)
    np.testing.assert_allclose(field.variance[field.grid.inner], 0.01, rtol=1e-5)


def doubt_steps(method):
    """Doubt the ranges beside steps, as far as the verdict and the quality say."""
    steps, verdict = method.steps, method.trust.verdict
    rough = steps.roughness(method.quality)
    steps.doubt(method.planes, verdict, rough, steps.weakness(verdict, method.quality, rough))


@pytest.mark.parametrize('usual, change', [(2.5, -1), (7.0, 0)])
def test_steps_are_doubted_in_pairs_that_say_little_beside_them(usual, change):
    method = ColorStereo(rig(256, 192), surface_settings(5, 60))._method
    tuning, inner = TUNING.steps, method.trust.grid.inner
    planes, quality, odds = method.planes, method.quality, method.trust.verdict.log_odds
    row, column = np.indices(planes.d.shape)
    planes.d[...] = 10 + 3 * (column // 8 % 2)  # a step at every eighth node
    quality.samples[1:] = np.array([0.8, 1, 3])[:, None, None]
    odds.fill(usual)
    doubt_steps(method)
    beside = np.isin(column[inner] % 8, (0, 1, 6, 7))
    lost = max(usual - tuning.odds, tuning.kept_odds) if change else usual
    np.testing.assert_allclose(odds[inner][beside], lost, rtol=1e-5)
    np.testing.assert_allclose(odds[inner][~beside], usual, rtol=1e-5)
    quality.samples[1] = 0  # a plane that leans has differences and no bend
    odds.fill(usual)
    doubt_steps(method)
    np.testing.assert_allclose(odds[inner], usual, rtol=1e-5)


def test_rough_surfaces_without_aperiodic_colors_are_doubted():
    tuning, method = TUNING.trust, ColorStereo(rig(128, 96), surface_settings(5, 60))._method
    inner = method.trust.log_odds[method.trust.grid.inner]
    inner[...] = 5
    inner[0, :3] = tuning.unknown_odds, -3, 1
    uneven = np.full(inner.shape, np.log(0.02), F4)
    uneven[1:] = np.log(0.8)
    method.trust.temper(uneven)
    smooth, rough = (tuning.tempered_odds + 5 * tuning.tempered_factor
                     - tuning.rough_odds * np.log(bend) for bend in (0.02, 0.8))
    assert inner[0, 0] == tuning.unknown_odds
    np.testing.assert_allclose(inner[0, 3:], smooth, rtol=1e-5)
    np.testing.assert_allclose(inner[1:], rough, rtol=1e-5)
    assert smooth > 5 > np.log(9) > rough
    inner[...] = 2  # a range, though doubtful, stays one
    method.trust.temper(np.full(inner.shape, 1, F4))
    np.testing.assert_allclose(inner, tuning.kept_odds, rtol=1e-5)


@pytest.mark.parametrize('rows', [0.0, 0.25, 0.5])
def test_the_deviation_counts_rows_that_are_off(stereo, rows, effort, figures):
    """The rows of the right image lie lower than the calibration says, px."""
    truth = plane(WIDTH, HEIGHT, 20.3, 0.1, 0.05)
    light = [photographed(shift) for shift in (-truth, np.zeros(truth.shape))]
    lower = np.array([[1.0, 0, 0], [0, 1, rows]])
    light[1] = np.clip(cv2.warpAffine(light[1], lower, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC,
                                      borderMode=cv2.BORDER_REPLICATE), 0, 1)
    seeds, ratios = effort.seeds(2, 50), []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        result = stereo.process(*(exposed(each, rng) for each in light))
        ratios.append(np.abs(result.disparity - truth)[seen_by_both(truth)]
                      / result.disparity_std[seen_by_both(truth)])
    figures(f'surface: rows off by {rows} px, 68 % of |error| / standard deviation',
            np.nanpercentile(ratios, 68), '(1 is honest)', over=seeds, at_least=0.7,
            at_most=1.4)


def test_confident_ranges_beside_steps_are_right_and_doubtful_ones_more_often_wrong(
        stereo, effort, figures):
    seeds = effort.seeds(3, 100)
    confidence, right = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        far, near, first = rng.integers(8, 20), rng.integers(34, 50), rng.integers(90, 130)
        *pair, truth, hidden = step_pair(WIDTH, HEIGHT, near, far, first, first + 70, seed)
        result = stereo.process(*pair)
        known = seen_by_both(truth) & ~hidden & np.isfinite(result.disparity)
        confidence.append(result.confidence[known])
        right.append(np.abs(result.disparity - truth)[known] < 1)
    confidence, right = np.concatenate(confidence), np.concatenate(right)
    sure = confidence > 0.99
    figures('surface: steps, ranges of confidence > 0.99 within 1 px', np.mean(right[sure]),
            'of them', over=seeds, at_least=0.97)
    figures('surface: steps, ranges of lower confidence within 1 px', np.mean(right[~sure]),
            'of them', over=seeds, at_most=0.9)
    figures('surface: steps, mean confidence minus share within 1 px',
            np.mean(confidence) - np.mean(right), '', over=seeds, at_most=0.05)


def test_brightening_both_images_changes_nothing(stereo):
    dim, bright = (stereo.process(*plane_pair(WIDTH, HEIGHT, 20.3, brightness=level, noise=False))
                   for level in (90.0, 180.0))
    both = np.isfinite(dim.disparity) & np.isfinite(bright.disparity)
    assert np.count_nonzero(both) > 0.99 * np.count_nonzero(np.isfinite(bright.disparity))
    difference = np.abs(dim.disparity - bright.disparity)[both]
    # what remains is the rounding of the images to whole DN
    assert np.median(difference) < 0.01 and np.percentile(difference, 99) < 0.1


@pytest.mark.parametrize('width, height, tolerance', [
    (101, 77, 0.1), (102, 77, 0.1), (101, 78, 0.1), (64, 48, 0.1), (65, 49, 0.1), (33, 40, 0.5),
    (1280, 96, 0.05), (1279, 95, 0.05)])
def test_images_of_any_size_are_measured(width, height, tolerance):
    truth = np.full((height, width), 9.3)
    result = sensor(width, height, (3, 24)).process(*pair_of(truth))
    assert result.disparity.shape == (height, width)
    inner = seen_by_both(truth, margin=2 if width < 64 else 8)
    error, share = errors(result, truth, inner)
    assert share > 0.9
    assert np.median(np.abs(error)) < tolerance


@pytest.mark.parametrize('width, height', [(16, 12), (8, 8)])
def test_images_too_small_to_measure_do_no_harm(width, height):
    result = sensor(width, height, (1, 4)).process(*plane_pair(width, height, 2.0))
    assert result.status.shape == (height, width)


def test_no_size_of_the_images_does_harm(effort, figures):
    seeds = effort.seeds(4, 200)
    for seed in seeds:
        rng = np.random.default_rng(seed)
        width, height = (int(size) for size in rng.integers(8, 200, 2))
        largest = max(2.0, min(60.0, 0.8 * width))
        pair = rng.integers(0, 256, (2, height, width, 3)).astype(np.uint8)
        result = sensor(width, height, (1.0, largest)).process(*pair)
        assert result.disparity.shape == (height, width)
        known = np.isfinite(result.disparity)
        assert np.array_equal(known, result.status == Status.VALID)
        assert (result.depth[known] > 0).all()
    figures('surface: random sizes of 8 .. 199 px', len(seeds), 'sizes', over=seeds)


def test_the_search_never_leaves_the_image():
    search = CoarseSearch((24, 32), 64, (-1e5, 1e5), Settings().matching, TUNING, Arena())
    _, depth, columns = search.upright.cost.shape
    assert depth <= 2 * columns + 1


def test_the_seeds_of_the_last_search_are_judged(monkeypatch):
    """Views that were made alike may show texture where the first search saw colors."""
    method = SurfaceMethod(surface_settings(*LIMITS), rig(WIDTH, HEIGHT), LIMITS)
    monkeypatch.setattr(method, 'even_out', lambda views, planes, pair, clock: method.search_again(
        views, planes, method.seeds_of_faint_colors))
    left, right = plane_pair(WIDTH, HEIGHT, 20)
    measurement = method.measure(left, right, Stopwatch())
    error = np.abs(measurement.disparity - 20)
    assert np.mean(error < 0.1) > 0.8
    assert method.found.likeness is not None


def test_a_higher_confidence_leaves_fewer_and_better_ranges(step):
    left, right, truth, _ = step
    left = exposed(left / 255, np.random.default_rng(2), brightness=30)
    right = exposed(right / 255, np.random.default_rng(3), brightness=30)
    results = [sensor(matching__min_confidence=least).process(left, right)
               for least in (0.1, 0.6, 0.95)]
    valid = [result.status == Status.VALID for result in results]
    wrong = [np.mean(np.abs(result.disparity - truth)[known] > 1)
             for result, known in zip(results, valid)]
    assert valid[0].sum() > valid[1].sum() > valid[2].sum()
    assert not (valid[2] & ~valid[0]).any()
    assert wrong[0] > wrong[1] > wrong[2]
    for least, result, known in zip((0.1, 0.6, 0.95), results, valid):
        assert result.confidence[known].min() >= least - 1e-3


def coarse_disparity(smoothness, left, right):
    """Return the disparities before any refinement, all that are known."""
    return sensor(matching__smoothness=smoothness, matching__refinements=0,
                  matching__min_confidence=0.0, matching__min_segment=0,
                  matching__occlusion_test=False).process(left, right).disparity


@pytest.mark.parametrize('gap, odds', [(-1.0, 2.0), (0.05, 2.0), (0.12, 8.0), (0.5, 14.0)])
def test_a_period_is_no_surer_than_the_colors_of_the_nodes_tell(gap, odds):
    search = CoarseSearch((48, 64), 128, (2, 40), Settings().matching, TUNING, Arena())
    search.upright.left[3] = 16  # all nodes are lit
    cost, total = search.upright.cost, search.upright.total
    cost[:], total[:] = 400, 3000
    total[:, 2], total[:, 6] = 0, 2000  # clear along the paths
    cost[:, 6] = cost[:, 2] + round(gap * TUNING.coarse.large_step)
    np.testing.assert_allclose(search.odds_of_colors(), odds, atol=0.6)


@pytest.mark.parametrize('agreeing, gap, least, most', [
    (False, 0.0, 0.9, 2.0), (False, 0.5, 4.0, 14.0), (True, 0.0, 13.9, 14.0)])
def test_own_colors_cap_a_period_unless_two_searches_agree_widely(agreeing, gap, least, most):
    """All nodes are clear along the paths."""
    search = CoarseSearch((96, 128), 256, (2, 80), Settings().matching, tuning_for(
        Expectation(aperiodic=False, cycles=16), 256), Arena())
    search.upright.left[3] = 16
    cost, total = search.upright.cost, search.upright.total
    cost[:], total[:] = 400, 3000
    total[:, 2], total[:, 8] = 0, 2900
    cost[:, 8] = cost[:, 2] + round(gap * TUNING.coarse.large_step)
    step = 2 * search.factor
    matches = np.full((96, 128), step * (search.first + 2) - 0.5, F4)
    matches[:, ::8] += 8 * step  # depth edges, which anchor a period
    matches += 0 if agreeing else 4 * step
    _, odds = search.period_odds(Seeds(matches, 1, None, 0.0))
    assert least <= np.median(odds[:, -16:]) <= most


def test_smoothness_removes_steps_from_the_coarse_search(monkeypatch):
    monkeypatch.setattr(TextureSearch, 'finds_more', lambda *rest: False)
    left, right = plane_pair(WIDTH, HEIGHT, 20, brightness=12)
    steps = [np.mean(np.abs(coarse_disparity(smoothness, left, right) - 20) < 1)
             for smoothness in (0.0, 1.0)]
    assert steps[1] > steps[0] + 0.01


def test_each_round_of_least_squares_is_more_precise_until_it_settles():
    truth = plane(WIDTH, HEIGHT, 29.7, 0.1, 0.05)
    pair = pair_of(truth)
    medians = [np.median(np.abs(errors(sensor(matching__refinements=rounds).process(*pair),
                                       truth)[0])) for rounds in (0, 1, 2, 3)]
    assert medians[0] > 2 * medians[1] > 2 * medians[2]
    assert medians[3] < 1.05 * medians[2]


def test_foreshortening_makes_leaning_planes_fit():
    misfits = []
    for foreshortening in (False, True):
        stereo = sensor(matching__foreshortening=foreshortening)
        stereo.process(*plane_pair(WIDTH, HEIGHT, 10, 0.5))
        misfits.append(np.nanmean(stereo._method.planes.misfit))
    assert misfits[1] < 0.97 * misfits[0]


def test_leaning_windows_measure_slanted_planes_better():
    truth = plane(WIDTH, HEIGHT, 30, STEEP)
    pair = pair_of(truth)
    upright, leaning = (sensor(matching__slanted=slanted).process(*pair)
                        for slanted in (False, True))
    wrong = [np.median(np.abs(errors(result, truth)[0])) for result in (upright, leaning)]
    assert wrong[1] < 0.7 * wrong[0]


def test_propagation_improves_the_surroundings_of_edges(step):
    left, right, truth, hidden = step
    column = np.broadcast_to(np.arange(WIDTH), truth.shape)
    beside = (np.minimum(np.abs(column - FIRST), np.abs(column - LAST)) < 10) & ~hidden
    right_share = []
    for propagation in (False, True):
        result = sensor(matching__propagation=propagation).process(left, right)
        with np.errstate(invalid='ignore'):
            right_share.append(np.mean(np.abs(result.disparity - truth)[beside] < 0.5))
    assert right_share[1] > right_share[0] + 0.01


def test_color_matching_makes_up_for_different_cameras():
    truth = plane(WIDTH, HEIGHT, 25, 0.05)
    crosstalk = np.array([[0.8, 0.2, 0], [0.1, 0.8, 0.1], [0, 0.25, 0.75]])
    medians = np.zeros(2)
    for seed in (7, 8, 9):  # of the noise, which counts for as much as the colors
        rng = np.random.default_rng(seed)
        pair = (exposed(photographed(-truth), rng),
                exposed(photographed(0 * truth) @ crosstalk.T, rng))
        medians += [np.median(np.abs(errors(sensor(matching__color_matching=on).process(*pair),
                                            truth)[0])) for on in (False, True)]
    assert medians[1] < 0.9 * medians[0]


def test_gains_make_cameras_alike_and_channels_half_as_unequal():
    strong, weak = np.array([40.0, 10.0, 20.0]), np.array([20.0, 10.0, 5.0])
    gains = gains_of([strong - 0.5, weak - 0.5], TUNING.views)
    first, second = gains[0] * strong, gains[1] * weak
    np.testing.assert_allclose(first / first.sum(), second / second.sum(), rtol=1e-6)
    same = gains_of([strong - 0.5, strong - 0.5], TUNING.views)[0] * strong
    np.testing.assert_allclose(same[0] / same[1], np.sqrt(strong[0] / strong[1]), rtol=1e-6)


def test_tiles_that_are_smooth_in_the_end_get_wide_windows(monkeypatch):
    pair = plane_pair(320, 240, 20, 0.2, brightness=20.0)
    variances = []
    # compares the variances of the fits themselves
    monkeypatch.setattr(quality.Quality, 'correct_variance', lambda *_: None)
    monkeypatch.setattr(bends.Bends, 'correct', lambda *_: None)
    for polishes in (True, False):
        if not polishes:
            monkeypatch.setattr(planes.LeastSquares, 'polish', lambda *_: None)
        method = ColorStereo(rig(320, 240), surface_settings(5, 80))._method
        method.measure(*pair, Stopwatch())
        variances.append(method.planes.variance[method.planes.grid.inner])
    late = variances[0] < 0.7 * variances[1]
    assert 0.02 < late.mean() < 0.98
    np.testing.assert_array_equal(variances[0][~late] > variances[1][~late], False)


@pytest.mark.parametrize('rounds', [0, 4, 10])
def test_any_number_of_rounds_is_measured(rounds):
    pair = plane_pair(320, 240, 16, 0.1856, 0.0686, brightness=13.4)
    result = ColorStereo(rig(320, 240), surface_settings(
        5, 80, matching__refinements=rounds)).process(*pair)
    assert result.density > 0.2


def test_averages_of_slow_colors_have_no_bias_at_the_edge_of_the_image():
    """A single pair errs by .07 px there; averages over a box, cut at the edge, by .07 in each."""
    truth = plane(320, 240, 30.0)
    stereo = ColorStereo(rig(320, 240), surface_settings(5, 80, pattern__type='sweep'))
    found = [stereo.process(*pair_of(truth, kind='sweep', seed=seed)).disparity
             for seed in range(1, 9)]
    errors = [(each - truth)[40:-40, -8:] for each in found]
    assert np.isfinite(errors).mean() > 0.5
    assert abs(np.mean([np.nanmedian(each) for each in errors])) < 0.05


def test_brightness_counts_beside_print_under_slow_patterns_only():
    truth = plane(WIDTH, HEIGHT, 20.0)
    ink = np.where(np.arange(WIDTH) // 16 % 2, 0.3, 1.0)[:, None]
    for kind, counts in (('sweep', True), ('hue_field', False)):
        method = sensor(pattern__type=kind)._method
        light = [photographed(shift, kind=kind) for shift in (-truth, 0 * truth)]
        rng = np.random.default_rng(3)
        images = [exposed(each * ink, rng, noise=False) for each in light]
        method.measure(*images, Stopwatch())
        assert method.brightness.active == counts


def test_colors_between_nodes_count_where_patterns_repeat():
    left, right = plane_pair(WIDTH, HEIGHT, 20)
    for kind, between in (('sine', True), ('hue_field', False)):
        method = sensor(pattern__type=kind, pattern__cycles=16)._method
        method.measure(left, right, Stopwatch())
        low, high = method.coarse.upright.inner[:2], method.coarse.upright.inner[2:4]
        assert (low <= high).all()
        assert (low < high).any() == between


def test_the_occlusion_test_rejects_what_only_left_sees(step):
    left, right, _, hidden = step
    shares = []
    for on in (False, True):
        status = sensor(matching__occlusion_test=on).process(left, right).status
        shares.append(np.mean(status[hidden] == Status.VALID))
        assert (status[hidden] == Status.INCONSISTENT).any() == on
    assert shares[1] < shares[0]


@pytest.mark.parametrize('least, kept', [(0, True), (400, True), (20000, False)])
def test_islands_smaller_than_the_least_segment_are_dropped(least, kept):
    left, right = plane_pair(WIDTH, HEIGHT, 20)
    lit = np.zeros((HEIGHT, WIDTH, 1), np.uint8)
    lit[60:110, 100:150] = 1
    result = sensor(matching__min_segment=least).process(left * lit, right * np.roll(lit, -20, 1))
    assert (np.count_nonzero(result.status == Status.VALID) > 1500) == kept
    if not kept:
        assert result.density == 0


def same_bytes(first, second):
    """Return whether two results agree in every byte of every image."""
    return all(getattr(first, name).tobytes() == getattr(second, name).tobytes()
               for name in ('disparity', 'depth', 'confidence', 'status', 'disparity_std'))


def test_the_same_pair_gives_the_same_bytes_whatever_came_before(stereo, step):
    left, right, *_ = step
    first = stereo.process(left, right)
    noise = np.random.default_rng(8).integers(0, 255, left.shape).astype(np.uint8)
    stereo.process(noise, right)
    assert same_bytes(first, stereo.process(left, right))
    assert same_bytes(first, sensor().process(left, right))


def test_nothing_of_the_last_pair_stays_in_tiles_that_reach_beyond_the_image():
    width, height = WIDTH - 22, HEIGHT - 12  # neither is a whole number of tiles
    sensors = [sensor(width, height) for _ in range(2)]
    sensors[0].process(*plane_pair(width, height, 33))
    pair = plane_pair(width, height, 10, 0.1)
    assert same_bytes(*(one.process(*pair) for one in sensors))


def test_the_number_of_threads_does_not_matter(stereo, step):
    left, right, *_ = step
    most = numba.get_num_threads()
    results = []
    try:
        for threads in (1, min(2, most), most):
            numba.set_num_threads(threads)
            results.append(stereo.process(left, right))
    finally:
        numba.set_num_threads(most)
    assert same_bytes(results[0], results[1]) and same_bytes(results[0], results[2])


def test_the_memory_does_not_grow_with_the_number_of_pairs(stereo, step, effort, figures):
    rounds = effort.count(40, 3000)
    left, right, *_ = step
    for _ in range(10):
        stereo.process(left, right)
    before = resident_memory()
    for _ in range(rounds):
        stereo.process(left, right)
    figures('surface: growth of the resident memory', resident_memory() - before, 'MB',
            over=rounds, at_most=16)  # a kept result has 0.7 MB


def resident_memory():
    """Return the resident memory of this process, MB."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


def test_threads_may_share_one_sensor(stereo, effort, figures):
    rounds = effort.count(6, 1000)
    pairs = [plane_pair(WIDTH, HEIGHT, disparity) for disparity in (10, 20)]
    alone = [stereo.process(*pair) for pair in pairs]
    with ThreadPoolExecutor(2) as pool:
        together = pool.map(lambda k: same_bytes(stereo.process(*pairs[k % 2]), alone[k % 2]),
                            range(rounds))
        different = rounds - sum(together)
    figures('surface: two threads, results that differ', different, 'results', over=rounds,
            at_most=0)


def repeating_pair(disparity, ambient=0, shade=np.ones_like):
    """Return a bare plane under colors that come again every 20 px; shade: of its columns."""
    rows, columns = np.mgrid[:240, :320]
    views = []
    for shift in (0, disparity):
        phase = 2 * np.pi * (columns + shift) / 20
        hues = np.stack([np.cos(phase - k * 2 * np.pi / 3) for k in range(3)], axis=-1)
        image = ambient + shade(columns + float(shift))[..., None] * (110 + 80 * hues)
        noisy = np.random.default_rng(shift).normal(image, 1.5)
        views.append(noisy.clip(0, 255).astype(np.uint8))
    return views


@pytest.mark.parametrize('smoothness', [1.0, 0.0])
@pytest.mark.parametrize('kind', ['sine', 'unknown'])
@pytest.mark.parametrize('limits', [(5, 75), (12, 75), (10, 100)])
def test_repetitions_that_nothing_tells_apart_hardly_get_ranges(limits, kind, smoothness):
    settings = surface_settings(*limits, pattern__type=kind, pattern__cycles=16,
                                matching__smoothness=smoothness)
    result = ColorStereo(rig(320, 240), settings).process(*repeating_pair(20))
    known = np.isfinite(result.disparity)
    assert known.mean() < 0.4  # .94 without doubt: where other periods lie outside the image
    assert np.all(np.abs(result.disparity[known] - 20) < 1)
    assert np.mean(result.status[~known] == Status.AMBIGUOUS) > 0.7


def test_a_period_that_only_shading_could_tell_is_doubted():
    """A bare plane, darker to the sides; gloss would look like that, too."""
    pair = repeating_pair(26, 10, lambda columns: np.exp(-((columns - 150) / 90) ** 2))
    settings = surface_settings(5, 75, pattern__type='sine', pattern__cycles=16)
    result = ColorStereo(rig(320, 240), settings).process(*pair)
    assert np.mean(result.confidence > 0.9) < 0.02


@pytest.mark.parametrize('kind', ['hue_field', 'pseudo_noise'])
def test_a_pattern_that_repeats_although_it_should_not_is_noticed(kind):
    settings = surface_settings(5, 75, pattern__type=kind)
    result = ColorStereo(rig(320, 240), settings).process(*repeating_pair(20))
    assert result.rival_share > 0.8
    assert np.isfinite(result.disparity).mean() < 0.4


def test_the_default_pattern_is_not_taken_for_one_that_repeats(step):
    result = sensor().process(*step[:2])
    assert result.rival_share == 0


def test_naming_a_repeating_pattern_gives_what_an_unknown_one_gives(step):
    left, right = repeating_pair(20, shade=lambda columns: 0.7 + 0.3 * np.sin(columns / 5.3) ** 2)
    depths = [ColorStereo(rig(320, 240), surface_settings(
        5, 75, pattern__type=kind, pattern__cycles=16)).process(left, right).depth
        for kind in ('sine', 'unknown')]
    np.testing.assert_array_equal(*depths)


def speckle(seed=4):
    """Return a left and a right gray image of dots on a slanted plane, and its disparity."""
    rng = np.random.default_rng(seed)
    dots = cv2.GaussianBlur(rng.standard_normal((240, 700)).astype(np.float32), (0, 0), 1.5)
    rows, columns = np.mgrid[:240, :320].astype(np.float32)
    truth = 20 + 0.05 * columns
    views = [cv2.remap(dots, columns + shift, rows, cv2.INTER_CUBIC)
             for shift in (200 + 0 * truth, 200 + 20 + 0.05 * (columns + 20) / 0.95)]
    images = [np.clip(90 + 400 * view + rng.normal(0, 1.5, view.shape), 0, 255)
              for view in views]
    return *images, truth


@pytest.mark.parametrize('dtype, factor', [(np.uint8, 1), (np.uint16, 16), (np.uint16, 257)])
def test_gray_images_are_measured_by_their_brightness(dtype, factor):
    left, right, truth = speckle()
    settings = surface_settings(5, 75, pattern__type='unknown')
    stereo = ColorStereo(rig(320, 240), settings)
    result = stereo.process(*((image.astype(np.uint8).astype(dtype) * factor).astype(dtype)
                              for image in (left, right)))
    known = np.isfinite(result.disparity)
    inner = np.s_[4:-4, 60:-8]
    error = np.abs(result.disparity - truth)[inner]
    assert known[inner].mean() > 0.97 and np.nanmedian(error) < 0.05
    assert np.mean(error[known[inner]] > 1) < 0.01
    assert result.image.shape == (240, 320, 3)


@pytest.mark.parametrize('colored', [0, 1])
def test_a_mono_camera_beside_a_color_camera_is_compared_by_brightness(colored):
    *images, truth = speckle()
    images = [np.repeat(image[..., None], 3, axis=2) for image in images]
    images[colored] = images[colored] * [0.6, 0.9, 0.3]
    stereo = ColorStereo(rig(320, 240), surface_settings(5, 75))
    result = stereo.process(*(image.astype(np.uint8) for image in images))
    inner = np.s_[4:-4, 60:-8]
    right = np.abs(result.disparity - truth)[inner] < 0.5
    assert right.mean() > 0.95
    assert result.image[..., 0].mean() < 0.8 * result.image[..., 1].mean() or colored == 1


@pytest.mark.parametrize('share, repeats', [(0.17, False), (0.24, False), (0.4, True)])
def test_colors_that_show_are_believed_unless_many_places_match(step, monkeypatch, share, repeats):
    monkeypatch.setattr(CoarseSearch, 'rival_share', lambda search: share)
    assert (sensor().process(*step[:2]).rival_share > 0) == repeats


@pytest.mark.parametrize('share, more, held', [(0.05, True, False), (0.17, True, True),
                                               (0.17, False, False)])
def test_where_places_rival_a_search_for_texture_may_find_more(step, monkeypatch, share, more,
                                                               held):
    stereo = sensor()
    monkeypatch.setattr(CoarseSearch, 'rival_share', lambda search: share)
    monkeypatch.setattr(TextureSearch, 'finds_more', lambda *rest: more)
    result = stereo.process(*step[:2])
    assert stereo._method.brightness.seeded is held and result.rival_share == 0
    assert not stereo._method.plain  # the colors of the pattern show: a projector may be followed
    inner = seen_by_both(step[2])
    assert np.mean(np.abs(result.disparity - step[2])[inner] < 1) > 0.8


@pytest.mark.parametrize('share, shows', [(0.17, True), (0.24, False)])
def test_silent_colors_are_no_pattern_where_places_rival(monkeypatch, share, shows):
    monkeypatch.setattr(CoarseSearch, 'rival_share', lambda search: share)
    left, right, _ = speckle()
    rng = np.random.default_rng(2)  # the noise of each channel: these are color cameras
    images = [np.clip(image[..., None] + rng.normal(0, 2, (240, 320, 3)), 0, 255).astype(np.uint8)
              for image in (left, right)]
    stereo = ColorStereo(rig(320, 240), surface_settings(5, 75))
    assert (stereo.process(*images).rival_share == 0) == shows


def test_gray_pairs_leave_nothing_behind(step):
    stereo = sensor()
    before = stereo.process(*step[:2]).disparity
    gray = [np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8)
            for image in step[:2]]
    stereo.process(*gray)
    np.testing.assert_array_equal(stereo.process(*step[:2]).disparity, before)


def zoomed_view(step_x, zoom=1.013, size=(320, 240), distortion=(0.0, 0.0, 0.0, 0.0),
                tuning=TUNING.views):
    """Return a view whose nodes lie at all fractions of a raw pixel, and their places there."""
    width, height = size
    camera = np.array([[300.0, 0, width / 2], [0, 300.0, height / 2], [0, 0, 1]])
    model = CameraModel('left', width, height, 'plumb_bob', np.array(distortion), camera,
                        np.eye(3), np.hstack([camera * [[zoom], [zoom], [1]], np.zeros((3, 1))]))
    rows, columns = height // 2, width // step_x - 1
    shape = tuple(2 * PAD + whole(count, tile)
                  for count, tile in zip((rows, columns), (TILE_ROWS, TILE_COLUMNS)))
    view = views.View(model, rows, columns, step_x, shape, False, tuning, Arena())
    area = framed_area(rows, columns, views.first_column(step_x))
    return view, area, raw_coordinates(
        views.half_grid_camera(model, rows, columns, step_x))


def seen(view, image):
    """Return the first chromaticity and which nodes have a color."""
    color = Settings().color
    view.load(image, color)
    view.fill(np.zeros(3, np.float32), np.ones(3, np.float32), color)
    return view.u, view.inside


def stripes(axis, size=(320, 240), period=7.0):
    """Return an image, float, of colors that change along an axis, under even brightness."""
    wave = np.cos(2 * np.pi / period * np.mgrid[:size[1], :size[0]][1 - axis])[..., None]
    return 100 + wave * [80.0, -40.0, -40.0]


@pytest.mark.parametrize('axis', [0, 1])
@pytest.mark.parametrize('step_x', [1, 2])
def test_nodes_between_pixels_see_as_sharp_as_those_upon_them(step_x, axis):
    view, area, places = zoomed_view(step_x)
    image = np.round(stripes(axis)).astype(np.uint8)
    ideal = np.cos(2 * np.pi / 7.0 * places[axis])[8:-8, 8:-8]
    left = []
    for even in (False, True):
        if even:
            view.even_out(np.nanmedian(view.psf_variance), Arena())
            assert view.widening.size > 0
        found = seen(view, image)[0][area][8:-8, 8:-8]
        scale = (found * ideal).sum() / (ideal ** 2).sum()
        left.append(np.sqrt(np.mean((found - scale * ideal) ** 2)))
    assert left[1] < 0.6 * left[0]


def test_evening_out_the_blur_takes_nothing_from_outside_the_image():
    view, _, _ = zoomed_view(2, zoom=0.8, distortion=(0.15, 0.0, 0.0, 0.0))
    view.even_out(1.0, Arena())
    image = np.full((240, 320, 3), (180, 80, 40), np.uint8)
    u, inside = seen(view, image)
    assert not inside.all() and np.ptp(u[inside]) < 1e-5


def test_a_lens_whose_distortion_folds_leaves_the_rest_of_the_image_alone():
    view, area, _ = zoomed_view(2, zoom=1.0, size=(640, 480), distortion=(-0.35, 0.0, 0.0, 0.0))
    known = view.psf_variance[np.isfinite(view.psf_variance)]
    view.even_out(np.median(known), Arena())
    center = view.widening[:, area[0], area[1]][:, 80:160, 110:210]
    assert np.abs(center).max() < TUNING.views.largest_gain
