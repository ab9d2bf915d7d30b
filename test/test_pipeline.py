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
"""The sensor as a whole: consistent results, laws of the measurement, and refusals."""

from concurrent.futures import ThreadPoolExecutor

from color_stereo_ros.core import (
    CalibrationError, ColorStereo, Settings, SettingsError, Status, StereoCalibration)
from color_stereo_ros.core.triangulation import disparity_from_depth
import numpy as np
import pytest
from scenes import hue_pair, load, paper_settings, parallel_rig

NEAR = {'range__min_depth': 0.7, 'range__max_depth': 4.0}


@pytest.fixture(scope='module')
def measured():
    """Return a path-traced scene and its result with the paper's method."""
    scene = load('solids_hue1')
    settings = paper_settings(range__min_depth=0.22, range__max_depth=0.62)
    return scene, ColorStereo(scene.calibration, settings).process(scene.left, scene.right)


def test_results_have_the_published_shapes_and_types(measured):
    scene, result = measured
    shape = scene.depth.shape
    for field in ('depth', 'disparity', 'confidence', 'disparity_std'):
        image = getattr(result, field)
        assert image.shape == shape and image.dtype == np.float32, field
    assert result.status.shape == shape and result.status.dtype == np.uint8
    assert result.image.shape == (*shape, 3) and result.image.dtype == np.uint8
    assert result.points().shape == (*shape, 3) and result.points().dtype == np.float32


def test_valid_finite_and_confident_mean_the_same_pixels(measured):
    _, result = measured
    valid = result.status == Status.VALID
    assert valid.any() and not valid.all()
    for image in (result.depth, result.disparity, result.disparity_std, result.points()[..., 2]):
        np.testing.assert_array_equal(np.isfinite(image), valid)
    np.testing.assert_array_equal(result.confidence > 0, valid)
    assert result.confidence.max() <= 1


def test_depth_lies_within_the_limits(measured):
    _, result = measured
    assert np.nanmin(result.depth) >= 0.22 * (1 - 1e-6)
    assert np.nanmax(result.depth) <= 0.62 * (1 + 1e-6)


def test_depth_and_disparity_agree(measured):
    _, result = measured
    valid = result.status == Status.VALID
    np.testing.assert_allclose(disparity_from_depth(result.depth[valid], result.geometry),
                               result.disparity[valid], atol=1e-3)


def test_the_same_pair_gives_the_same_result_bit_for_bit():
    scene = load('prism_hue1')
    stereo = ColorStereo(scene.calibration, paper_settings(range__min_depth=0.22,
                                                           range__max_depth=0.62))
    first = stereo.process(scene.left, scene.right)
    stereo.process(scene.right, scene.left)
    second = stereo.process(scene.left, scene.right)
    np.testing.assert_array_equal(first.depth, second.depth)
    np.testing.assert_array_equal(first.confidence, second.confidence)


def test_results_are_not_overwritten_by_the_next_pair():
    stereo = ColorStereo(parallel_rig(), paper_settings(**NEAR))
    left, right = hue_pair(5.0)
    first = stereo.process(left, right)
    kept = first.depth.copy()
    stereo.process(np.zeros_like(left), np.zeros_like(right))
    np.testing.assert_array_equal(first.depth, kept)


def test_images_are_not_changed():
    left, right = hue_pair(5.0)
    copies = left.copy(), right.copy()
    ColorStereo(parallel_rig(), paper_settings(**NEAR)).process(left, right)
    np.testing.assert_array_equal(left, copies[0])
    np.testing.assert_array_equal(right, copies[1])


def test_threads_may_share_one_sensor(effort, figures):
    rounds = effort.count(20, 2000)
    stereo = ColorStereo(parallel_rig(), paper_settings(**NEAR))
    pairs = [hue_pair(disparity) for disparity in (3.0, 5.0, 7.0, 9.0)]
    alone = [stereo.process(*pair).depth for pair in pairs]
    with ThreadPoolExecutor(4) as pool:
        together = pool.map(lambda index: np.array_equal(
            stereo.process(*pairs[index % 4]).depth, alone[index % 4], equal_nan=True),
            range(rounds))
        different = rounds - sum(together)
    figures("paper's method: four threads, depths that differ", different, 'results', over=rounds,
            at_most=0)


def test_scaling_the_baseline_scales_the_depth():
    left, right = hue_pair(5.0)
    short = ColorStereo(parallel_rig(baseline=0.1), paper_settings(
        range__min_depth=0.8, range__max_depth=4.0)).process(left, right)
    long = ColorStereo(parallel_rig(baseline=0.2), paper_settings(
        range__min_depth=1.6, range__max_depth=8.0)).process(left, right)
    assert short.density > 0.5
    np.testing.assert_allclose(long.depth, 2 * short.depth, rtol=1e-5)


def test_brightening_both_images_changes_nothing():
    stereo = ColorStereo(parallel_rig(), paper_settings(color__dark_level=0.0, **NEAR))
    dim, bright = (stereo.process(*hue_pair(5.0, brightness=level)) for level in (110.0, 220.0))
    same = np.isfinite(dim.depth) & np.isfinite(bright.depth)
    assert same.mean() > 0.9 * max(dim.density, bright.density)
    np.testing.assert_allclose(dim.disparity[same], bright.disparity[same], atol=0.15)


def test_black_images_are_dark_and_nothing_else():
    result = ColorStereo(parallel_rig(), paper_settings(**NEAR)).process(
        *np.zeros((2, 24, 64, 3), np.uint8))
    assert (result.status == Status.DARK).all()
    assert result.density == 0


def test_rectified_input_is_matched_as_it_is():
    scene = load('flat_350_hue1')
    settings = paper_settings(range__min_depth=0.22, range__max_depth=0.62)
    raw = ColorStereo(scene.calibration, settings)
    pair = raw.rectify(scene.left, scene.right)
    rectified = ColorStereo(scene.calibration, settings, rectified_input=True)
    seen = pair.left_inside & pair.right_inside
    expected = raw.process(scene.left, scene.right).depth
    found = rectified.process(pair.left, pair.right).depth
    both = seen & np.isfinite(expected) & np.isfinite(found)
    assert both.mean() > 0.9 * np.isfinite(expected).mean()
    np.testing.assert_allclose(found[both], expected[both], rtol=2e-3)


def test_the_time_of_each_stage_is_told(measured):
    _, result = measured
    assert result.seconds and all(duration >= 0 for duration in result.seconds.values())


def test_limits_that_no_pixel_can_have_are_refused():
    with pytest.raises(SettingsError, match='outside an image of 64 columns'):
        ColorStereo(parallel_rig(), paper_settings(range__min_depth=0.01, range__max_depth=0.02))


def test_something_else_than_a_calibration_is_refused():
    with pytest.raises(CalibrationError, match="calibration = 'left.yaml' is no StereoCalib"):
        ColorStereo('left.yaml', Settings())


def test_something_else_than_settings_is_refused():
    with pytest.raises(SettingsError, match='settings = .* is no Settings'):
        ColorStereo(parallel_rig(), {'range.min_depth': 0.3})


def test_negative_disparities_of_verged_rigs_are_measured():
    scene = load('solids_hue1')
    assert isinstance(scene.calibration, StereoCalibration)
    result = ColorStereo(scene.calibration, paper_settings(
        range__min_depth=0.3, range__max_depth=0.5)).process(scene.left, scene.right)
    assert (result.disparity[np.isfinite(result.disparity)] < 0).mean() > 0.5
    assert scene.share_correct(result) > 0.8


@pytest.mark.parametrize('method', ['surface', 'paper'])
@pytest.mark.parametrize('rectified', [False, True])
def test_a_result_is_independent_of_the_arrays_it_was_made_from(method, rectified):
    left, right = hue_pair(5.0)
    settings = paper_settings(**NEAR, matching__method=method)
    stereo = ColorStereo(parallel_rig(), settings, rectified_input=rectified)
    expected = stereo.process(left, right).image.copy()
    result = stereo.process(left, right)
    left[:], right[:] = 7, 9
    np.testing.assert_array_equal(result.image, expected)
    result.image[:] = 1  # nor do the arrays depend on the result
    assert (left == 7).all() and (right == 9).all()


def test_images_that_cannot_be_written_give_the_same(measured):
    scene, expected = measured
    settings = paper_settings(range__min_depth=0.22, range__max_depth=0.62)
    images = [np.frombuffer(image.tobytes(), np.uint8).reshape(image.shape)
              for image in (scene.left, scene.right)]
    result = ColorStereo(scene.calibration, settings).process(*images)
    np.testing.assert_array_equal(result.depth, expected.depth)
    np.testing.assert_array_equal(result.image, expected.image)
