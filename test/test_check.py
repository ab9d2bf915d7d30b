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
"""`color_stereo check`: known planes, spheres and images give known figures and advice."""

from dataclasses import replace
import json
from pathlib import Path

from color_stereo_ros.calibration.check_light import light_of
from color_stereo_ros.calibration.check_report import check_page
from color_stereo_ros.calibration.check_shapes import measured_plane, measured_spheres, spread
from color_stereo_ros.calibration.check_text import check_json, check_text
from color_stereo_ros.calibration.checking import check, FAIR, GOOD, graded, POOR
from color_stereo_ros.cli.main import main
from color_stereo_ros.core import CalibrationError, Settings
from color_stereo_ros.core.results import RangeResult
from color_stereo_ros.files.image import write_image
import cv2
import numpy as np
import pytest
from surface_pairs import BASELINE, FOCAL, plane, plane_pair, rig, surface_settings

ROOT = Path(__file__).parents[1]
WIDTH, HEIGHT = 320, 240


def result_of(disparity, image=None):
    """Return the RangeResult that has a disparity, float (H, W), NaN = unknown."""
    geometry = rig(WIDTH, HEIGHT).geometry
    disparity = disparity.astype(np.float32)
    known = np.isfinite(disparity)
    return RangeResult(
        disparity, (geometry.focal_baseline / disparity).astype(np.float32),
        known.astype(np.float32), np.where(known, 0, 1).astype(np.uint8),
        np.where(known, 0.05, np.nan).astype(np.float32), image_source=image
        if image is not None else np.full((HEIGHT, WIDTH, 3), 120, np.uint8),
        geometry=geometry, disparity_limits=(10.0, 80.0))


def noisy_plane(seed, sigma=0.05, **changes):
    """Return a plane at 0.8 m in the mean, with noise of the disparity, px."""
    disparity = plane(WIDTH, HEIGHT, 40.0, **{'slope_x': 0.01, 'slope_y': -0.005, **changes})
    return disparity + np.random.default_rng(seed).normal(0, sigma, disparity.shape)


def by_name(found):
    """Return the findings by their names."""
    return {finding.name: finding for finding in found.findings}


def test_the_noise_and_the_place_of_a_plane_come_back():
    found = measured_plane(result_of(noisy_plane(1)))
    assert found.rms_px == pytest.approx(0.05, rel=0.02)
    # the optical axis hits the plane where the disparity is 40 px: Z = f B / d
    assert found.distance_mm == pytest.approx(1e3 * FOCAL * BASELINE / 40, rel=1e-4)
    # a step of 1 px of disparity is Z / d along the axis
    assert found.rms_mm == pytest.approx(0.05 * 800 / 40, rel=0.1)
    assert found.density > 0.995 and found.outliers < 1e-3
    assert found.shape_mm < 0.1 * found.rms_mm


def test_the_flatness_error_is_a_range_without_three_of_a_thousand():
    values = np.concatenate([np.linspace(-1, 1, 997), [50.0, -40.0, 30.0]])
    assert spread(values) == pytest.approx(2.0, abs=0.01)


def test_a_bowl_is_a_shape_that_stays():
    column = (np.arange(WIDTH) - WIDTH / 2) / WIDTH
    found = by_name(check(*pair_and(noisy_plane(2, 0.01) + 4 * column ** 2), Settings()))
    assert found['shape that stays'].level == POOR
    assert 'calibrate the geometry anew' in found['shape that stays'].advice


def pair_and(*disparities):
    """Return pairs of gray images and the results of disparities."""
    image = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    return [(image, image)] * len(disparities), [result_of(each) for each in disparities]


def test_figures_are_judged_by_the_claims_of_the_sensor():
    pairs, results = pair_and(noisy_plane(1), noisy_plane(2), noisy_plane(3))
    found = check(pairs, results, Settings())
    assert found.figures['claim_ratio'] == pytest.approx(1.0, abs=0.03)
    assert {by_name(found)[name].level for name in (
        'claims', 'noise that is claimed', 'temporal noise', 'wrong ranges')} == {GOOD}
    bold, timid = ([replace(each, disparity_std=factor * each.disparity_std)
                    for each in results] for factor in (np.float32(0.4), np.float32(5)))
    found = by_name(check(pairs, bold, Settings()))
    assert found['claims'].level == found['temporal noise'].level == POOR
    found = by_name(check(pairs, timid, Settings()))
    assert found['claims'].level == GOOD and found['noise that is claimed'].level == POOR


def test_holes_and_wrong_ranges_are_counted():
    disparity = noisy_plane(3)
    disparity[100:140, 100:160] = np.nan
    disparity[20:40, 20:60] += 5
    found = measured_plane(result_of(disparity))
    total = WIDTH * HEIGHT
    assert found.density == pytest.approx(1 - 2400 / total, abs=0.005)
    assert found.outliers == pytest.approx(800 / (total - 2400), abs=0.003)


def test_a_board_before_a_background_is_found():
    disparity = np.full((HEIGHT, WIDTH), 20.0)
    disparity[30:210, 40:280] = noisy_plane(4)[30:210, 40:280]
    found = measured_plane(result_of(disparity))
    assert found.inside[30:210, 40:280].mean() > 0.97
    assert found.inside.sum() == pytest.approx(180 * 240, rel=0.05)


def test_the_bias_refers_to_the_optical_axis():
    found = check(*pair_and(noisy_plane(5)), Settings(), distance=0.796)
    assert found.figures['bias_mm'] == pytest.approx(4.0, abs=0.1)
    assert by_name(found)['bias'].level == POOR


def test_several_pairs_tell_the_noise_of_a_pixel():
    found = check(*pair_and(*(noisy_plane(seed) for seed in range(5))), Settings())
    assert found.figures['temporal_noise_mm'] == pytest.approx(1.0, rel=0.1)
    assert found.noise_mm is not None
    assert 'needs 3 pairs' in by_name(check(*pair_and(noisy_plane(0)), Settings()))[
        'temporal noise'].text


@pytest.mark.parametrize('disparity, message', [
    (np.full((HEIGHT, WIDTH), np.nan), '0 pixels have a range'),
    (np.random.default_rng(0).uniform(10, 80, (HEIGHT, WIDTH)), 'of the ranges lie on one plane')])
def test_a_view_without_a_board_is_refused(disparity, message):
    with pytest.raises(CalibrationError, match=message):
        measured_plane(result_of(disparity))


def sphere_bar(radius, true_radius, noise=0.02):
    """Return the disparity of two spheres before a wall, px; radius in m."""
    rng = np.random.default_rng(0)
    x, y = np.meshgrid((np.arange(WIDTH) - (WIDTH - 1) / 2) / FOCAL,
                       (np.arange(HEIGHT) - (HEIGHT - 1) / 2) / FOCAL)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    depth = np.full(x.shape, 1.2)
    for center in (np.array([-0.1, 0.0, 0.7]), np.array([0.1, 0.01, 0.72])):
        along, square = rays @ center, (rays * rays).sum(axis=-1)
        root = along ** 2 - square * (center @ center - true_radius ** 2)
        hit = root > 0
        depth[hit] = ((along - np.sqrt(np.maximum(root, 0))) / square)[hit]
    return FOCAL * BASELINE / depth + rng.normal(0, noise, x.shape)


def test_the_spheres_of_a_bar_are_found_and_measured():
    left, right = measured_spheres(result_of(sphere_bar(0.06, 0.06, 0.005)), 0.06)
    assert np.allclose(left.center, [-0.1, 0, 0.7], atol=1e-3)
    assert np.allclose(right.center, [0.1, 0.01, 0.72], atol=1e-3)
    assert abs(left.size_mm) < 1.0 and left.points > 1000


def test_a_bar_that_is_longer_than_it_says_is_a_finding():
    true = 1e3 * np.linalg.norm([0.2, 0.01, 0.02])
    pairs, results = pair_and(sphere_bar(0.06, 0.06, 0.005))
    found = check(pairs, results, Settings(), bar=(true / 1e3 - 0.004, 0.06))
    assert found.figures['sphere_spacing_error_mm'] == pytest.approx(4.0, abs=0.5)
    assert by_name(found)['sphere-spacing error'].level == POOR


def test_a_view_without_spheres_is_refused():
    with pytest.raises(CalibrationError, match='0 of two spheres of radius 20 mm found'):
        measured_spheres(result_of(noisy_plane(1)), 0.02)


def test_unlike_gains_and_a_blurred_corner_are_seen():
    left, right = plane_pair(WIDTH, HEIGHT, 40.0)
    light = light_of(left, (right * [0.5, 1, 1]).astype(np.uint8), left, Settings())
    assert light.gains[0] == pytest.approx(2.0, rel=0.1)
    assert light.gains[1] == pytest.approx(1.0, rel=0.1)
    blurred = left.copy()
    blurred[160:, 220:] = cv2.GaussianBlur(left, None, 6)[160:, 220:]
    sharpness = light_of(left, right, blurred, Settings()).sharpness
    assert np.unravel_index(np.argmin(sharpness), (3, 3)) == (2, 2) and sharpness[2, 2] < 0.6


def test_a_black_view_says_that_nothing_is_lit():
    black = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    found = check([(black, black)], [result_of(noisy_plane(1))], Settings())
    assert by_name(found)['exposure'].text == 'nothing is lit'
    assert found.level == POOR
    json.loads(check_json(found))


@pytest.mark.parametrize('value, limits, level', [
    (0.1, (0.2, 0.4), GOOD), (0.3, (0.2, 0.4), FAIR), (0.5, (0.2, 0.4), POOR),
    (0.9, (0.8, 0.5), GOOD), (0.6, (0.8, 0.5), FAIR), (0.1, (0.8, 0.5), POOR)])
def test_levels_follow_their_limits(value, limits, level):
    assert graded(value, limits) == level


def test_text_and_page_say_the_verdict_and_claim_no_conformity():
    found = check(*pair_and(noisy_plane(1), noisy_plane(2), noisy_plane(3)), Settings(), 0.8)
    image = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    page = check_page(found, image, image, result_of(noisy_plane(3)), 'a board')
    for text in (check_text(found), check_json(found), page):
        assert 'no claim of conformity' in text and found.verdict() in text
    assert page.count('<img') >= 4


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder with a pair of a plane and its calibration."""
    path = tmp_path_factory.mktemp('check')
    rig(WIDTH, HEIGHT).to_yaml(path / 'left.yaml', path / 'right.yaml')
    for side, image in zip(('left', 'right'), plane_pair(WIDTH, HEIGHT, 40.0, 0.01)):
        write_image(path / f'{side}.png', image)
    return path


def depth_options():
    """Return the options for disparities of 25 to 60 px."""
    limits = surface_settings(25.0, 60.0).range
    return ['--range.min_depth', f'{limits.min_depth}', '--range.max_depth',
            f'{limits.max_depth}']


def test_the_command_checks_a_folder_and_writes_figures_and_a_page(folder, tmp_path, capsys):
    figures, page = tmp_path / 'check.json', tmp_path / 'check.html'
    status = main(['check', str(folder), '--distance', '800', '--json', str(figures), '--report',
                   str(page), *depth_options()])
    content = json.loads(figures.read_text())
    assert status == {GOOD: 0, FAIR: 0, POOR: 1}[content['verdict']]
    assert abs(content['figures']['bias_percent']) < 0.1
    assert content['figures']['plane_rms_px'] < 0.1
    assert content['figures']['density'] > 0.9
    assert content['sentence'] in capsys.readouterr().out
    assert page.read_text().startswith('<!DOCTYPE html>')
    assert main(['check', str(folder), '--json', str(figures)]) == 1


@pytest.mark.parametrize('more, message', [
    (['--radius', '20'], '--sphere-bar and --radius belong together'),
    (['--distance', '-1'], '--distance -1: expected millimeters above 0'),
    (['--pairs', '0'], '--pairs 0')])
def test_impossible_options_are_refused(folder, capsys, more, message):
    assert main(['check', str(folder), *more]) == 2
    assert message in capsys.readouterr().err


def test_a_recording_is_checked_by_its_own_calibration(tmp_path, capsys):
    folder = ROOT / 'sample/solids_hue2d'
    status = main(['check', str(folder / 'recording'), '--pairs', '1', '--config',
                   str(folder / 'settings.yaml'), '--json', str(tmp_path / 'check.json'),
                   '--matching.third_view', 'off'])
    said = capsys.readouterr().out
    assert status == 1 and 'The sensor is not in order' in said  # solids stand on the board
    assert 'place of the board          450.0 mm' in said
    assert json.loads((tmp_path / 'check.json').read_text())
