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
"""The stress test: known disturbances of small scenes, and their truth by direct computation."""

from dataclasses import replace
import json
from pathlib import Path

from color_stereo_ros.core import ColorStereoError, RangeResult, StereoCalibration
from color_stereo_ros.evaluation import metrics
from color_stereo_ros.evaluation.ablation import switches
from color_stereo_ros.evaluation.stress import patterns, shot
from color_stereo_ros.evaluation.stress.disturbances import chosen, DISTURBANCES
from color_stereo_ros.evaluation.stress.light import LightScene, print_in_space
from color_stereo_ros.evaluation.stress.mounting import Mounting
from color_stereo_ros.evaluation.stress.page import curve_plot, sentences, write_page
from color_stereo_ros.evaluation.stress.rig import StressRig, View
from color_stereo_ros.evaluation.stress.runs import (
    Case, cases_of, StressPlan, StressTest, with_switches, without)
from color_stereo_ros.evaluation.stress.shot import Shots

import cv2

import numpy as np

import pytest

pytestmark = pytest.mark.processes  # cameras and truth come from the simulator

BEFORE = DISTURBANCES.names
WIDTH, HEIGHT = 64, 48
SCALE, MARGIN = 2, 8
DEPTH = 0.5  # m
LENS = np.array([-0.1, 0.02, 0.001, -0.001, 0.0])


def verged(distortion=LENS):
    """Return the calibration of two cameras that are turned towards each other."""
    K = np.array([[80.0, 0, 31.5], [0, 80.0, 23.5], [0, 0, 1]])
    turn = cv2.Rodrigues(np.radians([1.0, -12.0, 2.0]))[0]
    return StereoCalibration.from_arrays((WIDTH, HEIGHT), K, distortion, K, distortion, turn,
                                         np.array([-0.1, 0.002, 0.01]))


def parallel():
    """Return the calibration of two parallel cameras without distortion, f = 80 px, B = 0.05 m."""
    K = np.array([[80.0, 0, 31.5], [0, 80.0, 23.5], [0, 0, 1]])
    return StereoCalibration.from_arrays((WIDTH, HEIGHT), K, np.zeros(5), K, np.zeros(5),
                                         np.eye(3), np.array([-0.05, 0, 0]))


def scene(calibration=None, seed=0, **arrays):
    """Return a LightScene of a card at DEPTH with smooth random light."""
    generator = np.random.default_rng(seed)
    size = SCALE * (HEIGHT + 2 * MARGIN), SCALE * (WIDTH + 2 * MARGIN)
    whole = np.ones((HEIGHT, WIDTH), bool)

    def light():
        noise = generator.random((*size, 3)).astype(np.float32)
        return (cv2.GaussianBlur(noise, (0, 0), 4) + 0.2).astype(np.float16)

    kept = {f'{side}_{key}': light() for side in ('left', 'right')
            for key in ('default', 'white', 'ambient', 'sine_16', 'speckle')}
    kept |= {f'{side}_{key}': np.full(size, 255, np.uint8) for side in ('left', 'right')
             for key in ('ink', 'object')}
    return LightScene(
        name=f'card {seed}', calibration=calibration or parallel(), depth_limits=(0.3, 1.0),
        depth=np.full((HEIGHT, WIDTH), DEPTH), in_left=whole, clear=whole, lit=whole,
        arrays={**kept, **arrays}, scale=SCALE, margin=MARGIN)


def by_rays(calibration, mounting, pixels):
    """Return where the given calibration puts points of rectified left pixels, step by step."""
    geometry, camera = calibration.geometry, calibration.right
    x, y = pixels.T
    point = np.stack([(x - geometry.center_x_left) * DEPTH / geometry.focal_x,
                      (y - geometry.center_y) * DEPTH / geometry.focal_y,
                      np.full(x.shape, DEPTH)])
    point = calibration.left.R.T @ point                  # left camera
    turn, shift = calibration.right_from_left
    point = turn @ point + shift[:, None]                 # right camera as calibrated
    point = cv2.Rodrigues(np.radians([mounting.pitch, mounting.yaw, mounting.roll]))[0] @ point
    K, D = camera.K.copy(), np.array(camera.D, np.float64)
    K[0, 0] *= 1 + mounting.focal
    K[1, 1] *= 1 + mounting.focal
    K[0, 2] += mounting.columns
    K[1, 2] += mounting.rows
    D[0] += mounting.k1
    raw = cv2.projectPoints(point.T.copy(), np.zeros(3), np.zeros(3), K, D)[0]
    point = camera.P[:, :3] @ camera.R @ undistorted(raw, camera)
    return (point[:2] / point[2]).T


def undistorted(raw, camera):
    """Return rays (3, N) of raw pixels (N, 1, 2), by Newton's method on OpenCV's projection."""
    rays = np.column_stack([(raw[:, 0] - camera.K[:2, 2]) / np.diag(camera.K)[:2],
                            np.ones(len(raw))])
    for _ in range(50):
        again = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.K, camera.D)[0]
        rays[:, :2] += (raw - again)[:, 0] / np.diag(camera.K)[:2]
    return rays.T


MOUNTINGS = [Mounting(), Mounting(rows=1.0), Mounting(columns=-2.0), Mounting(roll=0.5),
             Mounting(pitch=0.1), Mounting(yaw=0.1), Mounting(focal=0.01), Mounting(k1=0.03),
             Mounting(rows=20, roll=-0.2, pitch=0.03, focal=0.003, k1=0.01)]


@pytest.mark.parametrize('mounting', MOUNTINGS, ids=str)
@pytest.mark.parametrize('calibration', [parallel(), verged()], ids=['parallel', 'verged'])
def test_the_true_correspondence_is_that_of_the_rays(calibration, mounting):
    truth = scene(calibration).truth(mounting)
    row, column = np.nonzero(np.isfinite(truth.disparity))
    expected = by_rays(calibration, mounting, np.column_stack([column, row]).astype(float))
    np.testing.assert_allclose(column - truth.disparity[row, column], expected[:, 0], atol=0.01)


def test_without_a_disturbance_the_truth_is_that_of_the_depth():
    truth = scene().truth(Mounting())
    np.testing.assert_allclose(truth.disparity, 80 * 0.05 / DEPTH, rtol=1e-9)
    assert truth.visible[:, :8].sum() == 0 and truth.visible[:, 8:].all()


def test_a_row_offset_moves_rows_and_leaves_columns():
    calm, moved = (scene().truth(Mounting(rows=rows)) for rows in (0.0, 5.0))
    np.testing.assert_allclose(moved.disparity, calm.disparity, atol=1e-9)
    # what falls off the lower edge of the right image is not visible any more
    assert not moved.visible[-5:].any() and moved.visible[:-5, 8:].all()


def test_a_longer_focal_length_moves_columns_away_from_the_center():
    truth = scene().truth(Mounting(focal=0.01))
    column = np.arange(WIDTH)
    match = column - 8.0
    expected = column - (31.5 + 1.01 * (match - 31.5))
    np.testing.assert_allclose(truth.disparity, np.broadcast_to(expected, truth.disparity.shape),
                               atol=1e-6)


@pytest.mark.parametrize('mounting', MOUNTINGS, ids=str)
def test_the_view_of_a_mounting_shows_the_light_of_the_true_ray(mounting):
    # light that is linear in the pixel is resampled without error
    camera = verged().right
    row, column = np.indices((SCALE * (HEIGHT + 2 * MARGIN), SCALE * (WIDTH + 2 * MARGIN)))
    light = np.stack([(column + 0.5) / SCALE - 0.5 - MARGIN + 100,
                      (row + 0.5) / SCALE - 0.5 - MARGIN + 100, np.ones(row.shape)], axis=-1)
    view = mounting.view(light.astype(np.float32), camera, SCALE, MARGIN)
    v, u = np.indices((HEIGHT, WIDTH), np.float64)
    source = mounting.calibrated_pixels(np.column_stack([u.ravel(), v.ravel()]), camera)
    source = source.reshape(HEIGHT, WIDTH, 2)
    inside = ((source > 2 - MARGIN) & (source < [WIDTH + MARGIN - 3, HEIGHT + MARGIN - 3])).all(-1)
    np.testing.assert_allclose(view[inside][:, :2] - 100, source[inside], atol=0.01)
    assert inside.mean() > 0.5


def test_a_mounting_is_undone_by_its_inverse():
    camera, mounting = verged().right, Mounting(rows=1, roll=0.3, pitch=0.1, focal=0.01, k1=0.02)
    points = np.array([[10.0, 12.0], [40.0, 30.0], [55.0, 5.0]])
    raw, _ = mounting.true_pixels(points, camera)
    ideal, _ = Mounting().true_pixels(points, camera)
    np.testing.assert_allclose(mounting.calibrated_pixels(raw, camera), ideal, atol=1e-6)


def test_a_row_offset_shifts_the_picture_down():
    rig = DISTURBANCES['rows'].rig(2)
    shots = Shots(scene())
    _, calm = shots.pair(StressRig())
    _, moved = shots.pair(rig)
    difference = [np.abs(moved[8:-8].astype(float) - calm[8 - shift:HEIGHT - 8 - shift]).mean()
                  for shift in range(-4, 5)]
    assert range(-4, 5)[int(np.argmin(difference))] == 2


def test_the_left_view_and_the_next_pair_differ_in_noise_only():
    shots = Shots(scene())
    first, second = shots.pair(StressRig(), 1), shots.pair(StressRig(), 2)
    for one, other in zip(first, second):
        assert 0 < np.abs(one.astype(float) - other).mean() < 6
    again = Shots(scene()).pair(StressRig(), 1)
    np.testing.assert_array_equal(first[0], again[0])


def light(rig, side='left'):
    """Return the light of the test scene under a rig."""
    return shot.light_of(scene(), rig, side)


def test_light_of_the_surroundings_is_a_share_of_the_pattern():
    calm = light(StressRig())
    lit = light(DISTURBANCES['ambient'].rig(100))
    assert (lit - calm).mean() == pytest.approx(calm.mean(), rel=1e-3)


def test_contrast_mixes_the_pattern_with_white():
    expected = 0.2 * scene().light('left', 'white') + 0.8 * light(StressRig())
    np.testing.assert_allclose(light(DISTURBANCES['contrast'].rig(5)), expected, rtol=1e-5)


def test_colors_of_projector_object_and_print_are_factors():
    calm = light(StressRig())
    for name, factor in (('imbalance', (1, 0.7, 0.5)), ('red_object', (0.73, 0.061, 0.061)),
                         ('dark_object', (0.03, 0.03, 0.03)),
                         ('print', 1 - 0.9 * np.array([1, 0.85, 0.7]))):
        rig = DISTURBANCES[name].rig(DISTURBANCES[name].levels[-1])
        np.testing.assert_allclose(light(rig), calm * np.float32(factor), rtol=1e-4)


def point_light():
    """Return fine light of a single white point."""
    image = np.zeros((SCALE * (HEIGHT + 2 * MARGIN), SCALE * (WIDTH + 2 * MARGIN), 3), np.float32)
    image[image.shape[0] // 2, image.shape[1] // 2] = 1
    return image


@pytest.mark.parametrize('sigma', [0.0, 2.0])
def test_focus_spreads_a_point_by_its_sigma(sigma):
    spread = shot.through_lens(point_light(), View(blur=sigma), scene())[..., 0]
    column = np.arange(spread.shape[1]) - spread.shape[1] // 2
    variance = (spread.sum(axis=0) * column ** 2).sum() / SCALE ** 2
    assert variance == pytest.approx(sigma ** 2 + shot.LENS_BLUR ** 2, rel=0.03)


@pytest.mark.parametrize('name, places', [
    ('blur_ramp', {(0.5, 0.1): 0.3, (0.5, 0.5): 1.5, (0.5, 0.9): 2.7}),
    ('blur_corners', {(0.5, 0.5): 0, (0.0, 0.5): 2.475, (0.0, 0.9): 3.17})])
def test_uneven_focus_spreads_each_place_by_its_own_sigma(name, places):
    view = DISTURBANCES[name].rig(DISTURBANCES[name].levels[-1]).right
    for (down, along), sigma in places.items():
        light = np.zeros((400, 600, 3), np.float32)
        row, column = round(down * 399), round(along * 599)
        light[:, column:] = 1  # an edge tells its sigma by its steepness
        steepest = np.abs(np.diff(shot.through_lens(light, view, scene())[row, :, 0])).max()
        expected = SCALE * np.hypot(sigma, shot.LENS_BLUR)
        assert 1 / (steepest * np.sqrt(2 * np.pi)) == pytest.approx(expected, rel=0.06)


def test_motion_spreads_along_its_direction_only():
    kernel = shot.streak(18, 0)
    along = (kernel.sum(axis=0) * (np.arange(kernel.shape[1]) - kernel.shape[1] // 2) ** 2).sum()
    assert kernel.sum() == pytest.approx(1)
    assert along == pytest.approx(18 ** 2 / 12, rel=0.05)
    assert np.count_nonzero(kernel.sum(axis=1)) == 1


def test_chromatic_aberration_parts_red_and_blue_in_the_corner():
    row, column = np.indices(point_light().shape[:2]).astype(np.float32)
    ramp = np.repeat(column[..., None], 3, axis=2)
    away = shot.through_lens(ramp, View(chromatic=1.0), scene())
    last = MARGIN * SCALE
    parted = (away[..., 2] - away[..., 0])[last:-last, last:-last] / SCALE
    # along a diagonal of 64 x 48 px the columns take 64 / 80 of the distance
    assert abs(parted[0, -1]) == pytest.approx(0.8, abs=0.03)
    assert abs(parted[HEIGHT, WIDTH]) < 0.02


def test_hot_pixels_are_so_many():
    mosaic = np.zeros((40, 50), np.uint8)
    hot = shot.with_hot_pixels(mosaic, 0.01, np.random.default_rng(1))
    assert np.count_nonzero(hot) == 20 and not mosaic.any()


def test_an_unsharp_mask_overshoots_at_an_edge():
    edge = np.zeros((16, 16, 3), np.uint8)
    edge[:, 8:] = 100
    edge += 50
    sharp = shot.finished(edge, View(unsharp=1.0), np.random.default_rng(1))
    assert sharp.max() > 150 and sharp.min() < 50 and sharp[0, 0, 0] == 50


def test_jpeg_is_that_of_opencv_at_half_the_color():
    image = np.random.default_rng(0).integers(0, 256, (32, 32, 3)).astype(np.uint8)
    coarse = shot.compressed(image, 60)
    luminance = cv2.cvtColor(coarse, cv2.COLOR_RGB2YCrCb)
    spread = [np.abs(np.diff(luminance[..., c].astype(float), axis=1)).mean() for c in (0, 1)]
    assert spread[1] < 0.5 * spread[0]  # chroma at half the resolution
    np.testing.assert_array_equal(coarse, shot.compressed(image, 60))


def test_a_mono_camera_has_three_equal_channels():
    left, right = Shots(scene()).pair(DISTURBANCES['gray'].rig(1))
    for image in (left, right):
        assert (image == image[..., :1]).all()


@pytest.mark.parametrize('name,level,channel,factor', [
    ('red_gain', 0.5, 0, 0.5), ('blue_gain', 1.5, 2, 1.5), ('exposure_one', 0.5, 1, 0.5)])
def test_gains_of_the_right_camera_scale_its_signal(name, level, channel, factor):
    shots = Shots(scene())
    calm, gained = (shots.pair(rig) for rig in (StressRig(), DISTURBANCES[name].rig(level)))
    np.testing.assert_array_equal(calm[0], gained[0])
    dark = 2.0
    assert (gained[1][..., channel] - dark).mean() == pytest.approx(
        factor * (calm[1][..., channel] - dark).mean(), rel=0.03)


def test_color_that_varies_has_the_measured_gains_at_the_borders():
    gains = DISTURBANCES['shading'].rig(1).right.gains[0]
    y, x = np.zeros((1, 1, 1)), np.array([-1.0, 1.0])[None, :, None]
    left, right = gains(y, x)[0]
    assert (np.diff(left) > 0).all() and left.max() < 1.28 and left.min() > 1.14
    assert (np.diff(right) < 0).all() and right.min() >= 0.79 and right.max() < 0.92


def test_color_bands_depend_on_rows_only_and_differ_between_the_cameras():
    rig = DISTURBANCES['bands'].rig(0.2)
    y, x = np.linspace(-1, 1, 50)[:, None, None], np.zeros((1, 4, 1))
    left, right = (view.gains[0](y, x) for view in rig.views)
    assert left.shape == (50, 1, 3)
    assert left.max() == pytest.approx(1.2, abs=0.01) and left.min() == pytest.approx(0.8, abs=.01)
    assert np.abs(left - right).max() > 0.2


def test_print_fills_space_and_not_the_image():
    position = np.random.default_rng(0).random((20, 30, 3)).astype(np.float32)
    ink = print_in_space(position)
    np.testing.assert_array_equal(print_in_space(position[:, ::-1]), ink[:, ::-1])
    assert ink.std() > 40


def test_every_disturbance_makes_a_pair():
    small = scene()
    shown = {'sine_1', 'sine_32', 'sweep', 'patches', 'dots', 'gamma', 'defocus',
             'low_resolution', 'fine'}
    extra = {f'{side}_{key}': small.arrays[f'{side}_default'] for side in ('left', 'right')
             for key in shown}
    shots = Shots(scene(**extra))
    for name, entry in DISTURBANCES.items():
        for level in entry.levels:
            left, right = shots.pair(entry.rig(level))
            assert left.shape == right.shape == (HEIGHT, WIDTH, 3), name
            assert left.dtype == np.uint8


def test_disturbances_do_not_share_what_they_change():
    DISTURBANCES['worn'].rig(1)
    assert StressRig() == StressRig() and not StressRig().right.gains


def test_names_and_groups_choose_and_unknown_ones_are_refused():
    assert [name for name, _ in chosen(('rows', 'sequence'))] == ['rows', 'bump', 'flicker']
    with pytest.raises(ColorStereoError, match="'rows'"):
        chosen(('rowss',))


def test_the_undisturbed_rig_is_the_first_case_and_quick_takes_the_hardest():
    plan = StressPlan(only=('roll',))
    assert cases_of(plan) == [Case('none', 1), Case('roll', 0.1), Case('roll', 0.25),
                              Case('roll', 0.5)]
    assert cases_of(StressPlan.quick(only=('roll',)))[1:] == [Case('roll', 0.5)]
    assert cases_of(StressPlan(only=('roll=0.3', 'jpeg=50')))[1:] == [
        Case('roll', 0.3), Case('jpeg', 50)]
    with pytest.raises(ColorStereoError, match="the level 'much' is no number"):
        cases_of(StressPlan(only=('roll=much',)))


def test_the_patterns_of_the_projector_are_images():
    assert patterns.patches().shape == patterns.speckle().shape == patterns.dots().shape
    wave = patterns.patches(40)
    np.testing.assert_array_equal(wave[:, :-80], wave[:, 80:])
    gray = patterns.dots()
    assert (gray == gray[..., :1]).all() and 0.02 < (gray > 128).mean() < 0.2


def result_of(disparity, confidence, deviation):
    """Return a RangeResult of the small parallel rig."""
    geometry = parallel().geometry
    with np.errstate(divide='ignore'):
        depth = (geometry.focal_baseline / disparity).astype(np.float32)
    return RangeResult(
        disparity=disparity.astype(np.float32), depth=depth,
        confidence=confidence.astype(np.float32),
        status=np.isnan(disparity).astype(np.uint8),
        disparity_std=deviation.astype(np.float32), image_source=None, geometry=geometry,
        disparity_limits=(0.0, 32.0))


def test_the_words_are_those_of_a_count():
    truth = scene().truth(Mounting())
    truth = replace(truth, visible=truth.visible.copy(), lit=truth.lit.copy())
    truth.visible[:, :14] = False
    truth.lit[:, :4] = False
    error = np.zeros((HEIGHT, WIDTH))
    error[:24, 14:] = 0.5
    error[:12, 14:] = 2.0
    error[:24, :14] = 3.0
    disparity = truth.disparity + error
    disparity[40:, 14:] = np.nan
    confidence = np.full(error.shape, 0.95)
    confidence[:6] = 0.5
    found = metrics.words(result_of(disparity, confidence, np.full(error.shape, 0.25)), truth)
    assert found['visible'] == HEIGHT * 50
    assert found['density'] == pytest.approx(40 / 48)
    assert found['right'] == pytest.approx(28 / 48)
    assert found['wrong'] == pytest.approx(12 / 40)
    assert found['false'] == pytest.approx(48 * 14 / (48 * 14 + 40 * 50))
    assert found['false_wrong'] == pytest.approx(24 * 14 / (48 * 14 + 40 * 50))
    assert found['cover'] == pytest.approx((28 * 50 + 24 * 10) / (48 * 60))
    assert found['hi'] == pytest.approx(6 / 34)
    assert found['sure'] == 1.0
    assert found['sure_pixels'] == pytest.approx(((42 * 64) - 8 * 50) / (48 * 64))
    assert found['z68'] == pytest.approx(2.0)
    assert found['median_px'] == pytest.approx(0.25, abs=0.25)
    assert found['bends'] is None


def test_meters_are_compared_with_the_true_depth_and_not_with_the_correspondence():
    truth = scene().truth(Mounting(yaw=0.5))
    given = np.where(truth.visible, truth.disparity, np.nan)
    found = metrics.words(result_of(given, np.ones(given.shape), np.ones(given.shape)), truth)
    assert found['right'] == 1.0 and found['median_px'] == pytest.approx(0, abs=1e-5)
    shift = 80 * np.tan(np.radians(0.5))
    assert found['depth_percent'] == pytest.approx(100 * shift / (8 - shift), rel=0.15)


def test_bends_are_where_the_second_difference_is():
    column = np.arange(WIDTH, dtype=float)
    disparity = 12 + 0.5 * (0.3 / 36) * (column - 32) ** 2  # .3 px over 12 px
    disparity = np.broadcast_to(disparity, (HEIGHT, WIDTH)).copy()
    whole = np.ones(disparity.shape, bool)
    truth = metrics.Truth(80 * 0.05 / disparity, whole)
    mask = metrics.bends(truth, parallel().geometry)
    assert mask[6:-6, 6:-6].all() and not mask[:6].any() and not mask[:, :6].any()
    flat = metrics.Truth(np.full(disparity.shape, DEPTH), whole)
    assert not metrics.bends(flat, parallel().geometry).any()


def test_a_pair_without_truth_has_nothing_right():
    truth = without(scene().truth(Mounting()))
    found = metrics.words(result_of(np.full((HEIGHT, WIDTH), 8.0), np.ones((HEIGHT, WIDTH)),
                                    np.ones((HEIGHT, WIDTH))), truth)
    assert found['right'] is None and found['hi'] is None and found['sure_pixels'] == 1.0


@pytest.fixture(scope='module')
def test_run():
    """Return the records of two tiny scenes."""
    plan = StressPlan(only=('rows', 'two_scenes', 'bump'), methods=('surface', 'sgbm'), pairs=2)
    run = StressTest(plan, [scene(seed=0), scene(seed=1)])
    cases = [Case('none', 1), Case('rows', 1), Case('two_scenes', 1), Case('bump', 1)]
    return cases, {case: run.run(case) for case in cases}


def test_each_pair_goes_through_one_object_and_opencv_sees_the_last(test_run):
    _, by_case = test_run
    numbers = [(r['method'], r['pair']) for r in by_case[Case('rows', 1)]
               if r['scene'] == 'card 0']
    assert numbers == [('surface', 1), ('surface', 2), ('sgbm', 2)]
    assert max(r['pair'] for r in by_case[Case('bump', 1)]) == 7
    assert all(r['figures']['right'] is None for r in by_case[Case('two_scenes', 1)])


def test_the_page_shows_every_case(test_run, tmp_path):
    cases, by_case = test_run
    write_page(tmp_path / 'report.html', cases, by_case, ('surface', 'sgbm'), {'seed': 1})
    text = (tmp_path / 'report.html').read_text()
    for case in cases:
        assert case.title in text
    assert text.count('<svg') == 3
    assert any('cases with truth' in each for each in sentences(cases, by_case,
                                                                ('surface', 'sgbm')))
    assert curve_plot(cases[1:2], cases[0], by_case, ('surface',)).startswith('<svg')


def stress(*arguments):
    """Run `color_stereo evaluate --stress` in this process."""
    from color_stereo_ros.cli.main import main
    return main(['evaluate', '--stress', *arguments])


def test_the_command_lists_what_there_is(capsys):
    assert stress('--only', 'list') in (0, None)
    listed = capsys.readouterr().out
    for name in DISTURBANCES:
        assert f'\n{name} ' in f'\n{listed}'


@pytest.mark.parametrize('arguments,told', [
    (['--only', 'rowss'], "did you mean 'rows'"), (['--scenes', 'moon'], 'casting'),
    (['--pairs', '0'], '--pairs = 0'), (['scenes/'], '--stress has scenes of its own'),
    (['--methods', 'surfac'], "'surface'")])
def test_the_command_refuses_what_it_cannot_do(arguments, told, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        raise SystemExit(stress(*arguments))
    assert ended.value.code
    assert told in capsys.readouterr().err


def test_the_command_writes_table_page_and_numbers(tmp_path, capsys, monkeypatch):
    from color_stereo_ros.evaluation.stress import light as lights
    monkeypatch.setattr(lights.LightScenes, 'scene', lambda self, name: scene(seed=len(name)))
    assert stress('--only', 'rows', '--quick', '--output', str(tmp_path / 'out'),
                  '--methods', 'surface,sgbm') in (0, None)
    shown = capsys.readouterr().out
    assert 'rows 20' in shown and 'z68 outside' in shown
    records = json.loads((tmp_path / 'out/figures.json').read_text())['records']
    assert {(r['disturbance'], r['method']) for r in records} == {
        (name, method) for name in ('none', 'rows') for method in ('surface', 'sgbm')}
    assert '<svg' in (tmp_path / 'out/report.html').read_text()


def test_an_ablation_measures_the_whole_and_every_switch(tmp_path, capsys, monkeypatch):
    from color_stereo_ros.evaluation.stress import light as lights
    monkeypatch.setattr(lights.LightScenes, 'scene', lambda self, name: scene(seed=len(name)))
    assert stress('--ablation', '--only', 'rows', '--quick', '--scenes', 'casting',
                  '--output', str(tmp_path / 'out')) in (0, None)
    records = json.loads((tmp_path / 'out/figures.json').read_text())['records']
    off = {f'{name} = {value}' for name, value in switches('surface').items()}
    assert {record['method'] for record in records} == {'surface', *off}
    plan = with_switches(StressPlan())
    assert plan.variants['matching.slanted = False'] == ('surface', {'matching.slanted': False})
    table = (tmp_path / 'out/tables.txt').read_text()
    assert table in capsys.readouterr().out and 'row_alignment = off' in table.splitlines()[0]


def test_a_variant_of_a_method_is_measured_with_its_settings():
    plan = StressPlan(methods=('surface', 'surface+third', 'surface+two'), only=('rows=1',),
                      values={'matching.refinements': 1})
    matchers = StressTest(plan, [scene()])._matchers(StressRig(), scene(), 1)
    used = [match.__self__ for _, match, _ in matchers]
    assert [each.settings.matching.third_view for each in used[1:]] == ['automatic', 'off']
    assert {each.settings.matching.refinements for each in used} == {1}
    assert 'matching.third_view' not in switches('surface+third')
    assert set(switches('surface+two')) <= set(switches('surface'))


def test_the_example_of_an_own_disturbance_works():
    text = (Path(__file__).parents[1] / 'docs/stress.md').read_text()
    example = text.partition('```python\n')[2].partition('```')[0]
    with DISTURBANCES.temporarily():
        exec(compile(example, 'docs/stress.md', 'exec'), {})
        (name,) = set(DISTURBANCES) - set(BEFORE)
        shots = Shots(scene())
        calm, dirty = shots.pair(StressRig())[1], shots.pair(DISTURBANCES[name].rig(0.3))[1]
    bright = [(image[:, WIDTH // 2 + 4:] - 2.0).mean() for image in (calm, dirty)]
    assert bright[1] == pytest.approx(0.7 * bright[0], rel=0.03)
