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
"""The paper's correspondence search: against its formulas, against truth, and its laws."""

import os
from pathlib import Path
import subprocess
import sys

from color_stereo_ros.core import ColorStereo, Status
from color_stereo_ros.core.cameras.geometry import RectifiedGeometry
from color_stereo_ros.core.paper import kernels
from color_stereo_ros.core.paper.method import independent_pixels, PaperMatcher, surrounding_median
from color_stereo_ros.core.patterns.colors import constant_sum_colors
import naive
import numpy as np
import pytest
from scenes import hue_pair, load, paper_settings, parallel_rig

WIDTH, HEIGHT, FIRST, COUNT = 20, 7, -3, 9


def random_colors(seed, dark_share=0.1):
    """Return corrected colors (H, W, 4) with some unusable pixels."""
    rng = np.random.default_rng(seed)
    colors = rng.random((HEIGHT, WIDTH, 4)).astype(np.float32) * 170
    colors[..., 3] = rng.random((HEIGHT, WIDTH)) >= dark_share
    colors[colors[..., 3] == 0] = 0
    return colors


def compiled_search(left, right, reach_x, reach_y, low, high, first=FIRST, count=COUNT):
    """Return winner and costs of the kernel, run through the matcher's own buffers."""
    height, width = left.shape[:2]
    settings = paper_settings(matching__window_width=2 * reach_x + 1,
                              matching__window_height=2 * reach_y + 1)
    geometry = RectifiedGeometry(width, height, 80.0, 80.0, 10.0, 10.0, 3.0, 0.1)
    matcher = PaperMatcher(settings, geometry, (first + 1, first + count - 2))
    buffers = matcher._buffers
    kernels.search(left, right, first, count, reach_x, reach_y, low, high, buffers.ring,
                   buffers.sums, buffers.total, buffers.ratios, buffers.right_cost,
                   buffers.right_index, buffers.winner, buffers.costs)
    return buffers.winner, buffers.costs


@pytest.mark.parametrize('reach_x, reach_y', [(0, 0), (4, 0), (1, 1), (2, 3), (12, 4)])
def test_kernel_finds_the_minimum_of_the_papers_q(reach_x, reach_y, effort, figures):
    seeds = effort.seeds(1, 40)
    low = np.zeros((HEIGHT, WIDTH), np.int32)
    high = np.full((HEIGHT, WIDTH), COUNT, np.int32)
    for seed in seeds:
        left, right = random_colors(2 * seed + 1), random_colors(2 * seed + 2)
        winner, costs = compiled_search(left, right, reach_x, reach_y, low, high)
        expected, expected_costs, _ = naive.search(left, right, FIRST, COUNT, reach_x, reach_y,
                                                   low, high)
        np.testing.assert_array_equal(winner[..., 0], expected[..., 0])
        np.testing.assert_array_equal(winner[..., 1], expected[..., 1])
        assert_equal_costs(winner, costs, expected_costs, reach_x, reach_y)
    figures(f"paper's method: searches as the formulas, window {2 * reach_x + 1} x "
            f'{2 * reach_y + 1}', len(seeds), 'searches', over=seeds)


def assert_equal_costs(winner, costs, expected, reach_x, reach_y):
    """Assert equality to the rounding of each pixel's cost and of its ratios."""
    pixels = (2 * reach_x + 1) * (2 * reach_y + 1)
    compared = (winner[..., :1] >= 0) & np.isfinite(expected)
    compared &= costs < kernels.PADDING_COST
    np.testing.assert_allclose(costs[compared], expected[compared], rtol=1e-5, atol=0.6 * pixels)


def test_local_limits_bound_the_candidates_of_each_pixel():
    left, right = random_colors(3), random_colors(4)
    low = np.random.default_rng(5).integers(0, 4, (HEIGHT, WIDTH)).astype(np.int32)
    high = low + 4
    winner, costs = compiled_search(left, right, 1, 1, low, high)
    expected, expected_costs, _ = naive.search(left, right, FIRST, COUNT, 1, 1, low, high)
    np.testing.assert_array_equal(winner, expected)
    assert_equal_costs(winner, costs[..., 1:2], expected_costs[..., 1:2], 1, 1)


def test_scaling_makes_linearly_dependent_colors_equal():
    color = np.array([30.0, 90.0, 10.0])
    assert naive.color_distance(color, 0.4 * color) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('subpixel', ['parabola', 'weighted', 'none'])
def test_judging_agrees_with_the_formulas(subpixel):
    rng = np.random.default_rng(6)
    winner = rng.integers(0, COUNT, (HEIGHT, WIDTH, 2)).astype(np.int32)
    costs = rng.integers(100, 900, (HEIGHT, WIDTH, 4)).astype(np.int32)
    costs[..., 1] = rng.integers(0, 100, (HEIGHT, WIDTH))
    costs[::2, ::3, :3] = 50
    costs[1::2, ::4, 3] = costs[1::2, ::4, 1]
    costs[1::3, :, :2] = 0
    reason = rng.integers(0, 2, (HEIGHT, WIDTH)).astype(np.uint8)
    right = random_colors(7)
    low = np.zeros((HEIGHT, WIDTH), np.int32)
    high = np.full((HEIGHT, WIDTH), COUNT, np.int32)
    disparity, deviation = np.empty((2, HEIGHT, WIDTH), np.float32)
    status = np.empty((HEIGHT, WIDTH), np.uint8)
    code = {'none': 0, 'parabola': 1, 'weighted': 2}[subpixel]
    kernels.accept_winners(winner, costs, reason, right, FIRST, COUNT, low, high, 4.0, 2.0, code,
                           1.5, -100.0, 100.0, disparity, deviation, status)
    for y in range(HEIGHT):
        for x in range(WIDTH):
            k, mirrored = (int(v) for v in winner[y, x])
            column = x - FIRST - k
            expected = reason[y, x] or naive.verdict(
                k, mirrored, column, right[y], 0, COUNT, COUNT, costs[y, x].astype(float),
                4.0, 2.0)
            assert status[y, x] == expected
            assert np.isfinite(disparity[y, x]) == (expected == 0)
            if expected == 0:
                offset = naive.subpixel_offset(*costs[y, x, :3].astype(float), subpixel)
                assert disparity[y, x] == pytest.approx(FIRST + k + offset, abs=1e-4)


@pytest.mark.parametrize('disparity', [7.0, 7.25, 7.5, -3.25])
def test_a_plane_is_found_to_a_tenth_of_a_pixel(disparity):
    disparities = inner(matched_plane(disparity).disparity)
    assert np.mean(np.isfinite(disparities)) > 0.9
    np.testing.assert_allclose(disparities[np.isfinite(disparities)], disparity, atol=0.1)


def inner(image):
    """Return the part whose windows lie inside both images of matched_plane."""
    return image[5:-5, 22:-18]


def matched_plane(disparity, **changes):
    """Return the Match of a synthetic plane searched between -6 and 12 px."""
    left, right = hue_pair(disparity)
    settings = paper_settings(color__dark_level=0.0, color__equalize=False, **changes)
    stereo = ColorStereo(parallel_rig(), paper_settings())
    pair = stereo.rectify(left, right)
    return PaperMatcher(settings, stereo.calibration.geometry, (-6.0, 12.0)).match(pair)


def test_whole_disparities_come_without_subpixel():
    disparities = inner(matched_plane(7.2, matching__subpixel='none').disparity)
    np.testing.assert_array_equal(disparities[np.isfinite(disparities)], 7.0)


def test_a_match_at_the_limit_of_the_range_is_out_of_range():
    status = inner(matched_plane(14.0).status)
    assert np.mean(status == Status.OUT_OF_RANGE) > 0.9
    assert (status != Status.VALID).all()


def test_one_color_everywhere_gives_no_range():
    settings = paper_settings(range__min_depth=0.7, range__max_depth=8.0)
    image = np.full((24, 64, 3), (120, 60, 3), np.uint8)
    result = ColorStereo(parallel_rig(), settings).process(image, image)
    assert not np.isfinite(result.depth).any()


def test_a_repeating_pattern_is_ambiguous_when_uniqueness_is_asked_for():
    left, right = hue_pair(5.0, period=9.0)
    settings = paper_settings(range__min_depth=0.3, range__max_depth=8.0,
                              matching__uniqueness_ratio=0.5)
    result = ColorStereo(parallel_rig(), settings).process(left, right)
    inner = result.status[6:18, 35:55]
    assert (inner == Status.AMBIGUOUS).all()


def test_dark_and_saturated_pixels_say_so():
    left, right = hue_pair(7.0)
    left[4:8, 30:40] = 1
    left[12:16, 30:40] = (255, 40, 2)
    settings = paper_settings(range__min_depth=0.5, range__max_depth=8.0)
    result = ColorStereo(parallel_rig(), settings).process(left, right)
    assert (result.status[4:8, 30:40] == Status.DARK).all()
    assert (result.status[12:16, 30:40] == Status.SATURATED).all()


def test_half_occluded_pixels_get_no_range():
    left, right, hidden, seen = step_pair(near=44, far=4)
    settings = paper_settings(range__min_depth=0.16, range__max_depth=8.0,
                              matching__window_height=1, matching__window_width=5)
    result = ColorStereo(parallel_rig(160, 24), settings).process(left, right)
    assert np.mean(np.isfinite(result.depth[:, hidden])) < 0.3
    assert np.mean(np.isfinite(result.depth[:, seen])) > 0.8


def step_pair(near, far, width=160, height=24):
    """
    Return a pair of a near strip before a far plane, and which left columns right misses, sees.

    A point with disparity d that the projector lights from its column p appears at p + d / 2 in
    the left and at p - d / 2 in the right image.

    """
    columns = np.arange(width)
    strip = 80 - near // 2, 120 - near // 2  # projector columns of the strip, left 80 .. 119
    lit = {}
    images = []
    for side in (1, -1):
        on_near, on_far = columns - side * near / 2, columns - side * far / 2
        is_near = (strip[0] <= on_near) & (on_near < strip[1])
        shadow = ~is_near & (strip[0] <= on_far) & (on_far < strip[1])
        hue = 3.0 * np.where(is_near, on_near, on_far) / 150.0
        row = np.rint(220 * constant_sum_colors(hue)).astype(np.uint8)
        row[shadow] = 0
        images.append(np.ascontiguousarray(np.broadcast_to(row, (height, width, 3))))
        lit[side] = ~is_near & ~shadow
    covered = (strip[0] - near / 2 <= columns - far) & (columns - far < strip[1] - near / 2)
    hidden = lit[1] & covered
    seen = lit[1] & ~covered & (columns > 10) & (columns < width - 10)
    return *images, hidden, seen


def test_local_limits_remove_outliers_of_the_global_search():
    scene = load('prism_hue1')
    base = {'range__min_depth': 0.22, 'range__max_depth': 0.62, 'matching__window_height': 1}
    plain = ColorStereo(scene.calibration, paper_settings(**base))
    local = ColorStereo(scene.calibration, paper_settings(**base, matching__local_limit=12.0))
    wrong = [np.mean(gross_errors(scene, stereo.process(scene.left, scene.right)))
             for stereo in (plain, local)]
    assert wrong[1] < 0.6 * wrong[0]


def gross_errors(scene, result):
    """Return which visible ranges are wrong by more than 5 %."""
    known = scene.visible & np.isfinite(result.depth)
    return np.abs(result.depth - scene.depth)[known] > 0.05 * scene.depth[known]


def test_surrounding_median_ignores_unknown_and_outlying_pixels():
    disparity = np.full((40, 70), 5.0, np.float32)
    disparity[::2] = np.nan
    disparity[3, 3] = 90.0
    np.testing.assert_array_equal(surrounding_median(disparity), 5.0)


def test_surrounding_median_is_unknown_where_nothing_is_known():
    assert np.isnan(surrounding_median(np.full((20, 20), np.nan, np.float32))).all()


def test_the_search_never_leaves_the_image():
    matcher = PaperMatcher(paper_settings(), parallel_rig().geometry, (-1e5, 1e5))
    assert matcher._first == -64 and matcher._count == 129


def test_more_smoothing_leaves_fewer_independent_pixels():
    rough = independent_pixels(paper_settings(color__smoothing=0.0))
    smooth = independent_pixels(paper_settings(color__smoothing=2.0))
    assert smooth < rough


# The figures of the path-traced scenes: correct = within 1 % of the distance, share of visible.
@pytest.mark.parametrize('name, window_height, correct, error', [
    ('solids_hue1', 9, 0.80, 0.0045), ('solids_hue1', 1, 0.76, 0.0062),
    ('prism_hue1', 9, 0.88, 0.0034), ('flat_350_hue1', 9, 0.95, 0.0023)])
def test_path_traced_scenes_are_measured(name, window_height, correct, error):
    scene = load(name)
    stereo = ColorStereo(scene.calibration, paper_settings(
        range__min_depth=0.22, range__max_depth=0.62, matching__window_height=window_height))
    result = stereo.process(scene.left, scene.right)
    assert scene.share_correct(result) >= correct
    assert scene.mean_error(result) <= error


def test_standard_deviation_and_confidence_tell_the_true_error():
    scene = load('prism_hue1')
    stereo = ColorStereo(scene.calibration, paper_settings(
        range__min_depth=0.22, range__max_depth=0.62))
    result = stereo.process(scene.left, scene.right)
    geometry = result.geometry
    truth = geometry.focal_baseline / scene.depth + geometry.principal_offset
    known = scene.visible & np.isfinite(result.disparity)
    error = np.abs(result.disparity - truth)[known]
    # the median of |error| / sigma of a normal distribution is 0.67
    assert 0.4 < np.median(error / result.disparity_std[known]) < 1.2
    trusted = result.confidence[known] > 0.9
    assert np.mean(error[trusted] < 1.0) > 0.8
    assert np.mean(error[trusted]) < 0.7 * np.mean(error[~trusted])


def test_kernels_give_the_same_without_the_compiler(tmp_path):
    script = (
        'import numpy as np\n'
        'from scenes import hue_pair, paper_settings, parallel_rig\n'
        'from color_stereo_ros.core import ColorStereo\n'
        'left, right = hue_pair(5.3, width=96, height=32)\n'
        'left[2:4, 20:22] = 1\n'
        'settings = paper_settings(range__min_depth=0.7, range__max_depth=4.0,\n'
        '                          matching__window_height=3, matching__window_width=5)\n'
        'result = ColorStereo(parallel_rig(96, 32), settings).process(left, right)\n'
        'np.savez(OUT, depth=result.depth, status=result.status,\n'
        '         confidence=result.confidence)\n')
    results = []
    for disabled in ('0', '1'):
        out = tmp_path / f'{disabled}.npz'
        test_folder = Path(__file__).parent
        paths = os.pathsep.join([str(test_folder.parent), str(test_folder)])
        subprocess.run(
            [sys.executable, '-c', script.replace('OUT', repr(str(out)))], check=True,
            env={**os.environ, 'NUMBA_DISABLE_JIT': disabled, 'PYTHONPATH': paths})
        results.append(np.load(out))
    compiled, interpreted = results
    assert np.isfinite(compiled['depth']).any()
    np.testing.assert_array_equal(compiled['status'], interpreted['status'])
    np.testing.assert_allclose(compiled['depth'], interpreted['depth'], rtol=1e-5)
    np.testing.assert_allclose(compiled['confidence'], interpreted['confidence'], atol=1e-4)
