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
"""The drift between two cameras, from exact and noisy row evidence."""

from functools import lru_cache

from color_stereo_ros.core import StereoCalibration
from color_stereo_ros.core.cameras.lenses import LENSES
from color_stereo_ros.core.health.drift import (
    aligned_axes, corrected, COUNT, expected_fields, PhysicalRight, row_errors, SHOWN, turn)
from color_stereo_ros.core.health.health import BLIND
from color_stereo_ros.core.health.tracking import HealthTracker
from color_stereo_ros.core.health.tuning import TUNING
from color_stereo_ros.core.rows.alignment import Alignment, RowEvidence
import cv2
import numpy as np
import pytest

SIZE = 640, 480
KNOCK = np.array([0.2, -0.15, 0.25, 0.05, 0.0, 0.0]) / SHOWN
BARREL = (-0.28, 0.09, 0.0006, -0.0004, -0.01)
BASELINE = 0.2


def camera_matrix(focal):
    """Return K (3, 3) of a camera, px."""
    return np.array([[focal, 0, (SIZE[0] - 1) / 2], [0, focal, (SIZE[1] - 1) / 2], [0, 0, 1]])


@lru_cache(maxsize=None)
def rig(kind='plain'):
    """Return a verged pair; kind: plain, barrel, fisheye or unequal."""
    left, right, model = (), (), None
    if kind in ('barrel', 'unequal'):
        left, right = BARREL, BARREL
    if kind == 'fisheye':
        left = right = (0.02, -0.01, 0.003, -0.001)
        model = 'equidistant'
    focals = (640, 480) if kind == 'unequal' else (640, 640)
    rotation = cv2.Rodrigues(np.radians([0.4, 12.0, -0.3]))[0]
    return StereoCalibration.from_arrays(
        SIZE, camera_matrix(focals[0]), left, camera_matrix(focals[1]), right, rotation,
        rotation @ [-BASELINE, 0.002, 0.004], model)


def observed(calibration, drift, count=600, flat=False, seed=1):
    """
    Return where a pair that has drifted shows points, in the images rectified as calibrated.

    Returns
    -------
    left, right : numpy.ndarray, float64, shape (N, 2)
        Columns and rows, px.

    """
    random, geometry = np.random.default_rng(seed), calibration.geometry
    left = random.uniform((10, 10), (SIZE[0] - 10, SIZE[1] - 10), (count, 2))
    depth = np.full(count, 0.45) if flat else random.uniform(0.35, 0.6, count)
    rays = np.column_stack([(left[:, 0] - geometry.center_x_left) / geometry.focal_x,
                            (left[:, 1] - geometry.center_y) / geometry.focal_y, np.ones(count)])
    way = geometry.baseline * np.array([1, *drift[4:]])
    points = (rays * depth[:, None] - way) @ calibration.right.R @ turn(drift).T
    camera = calibration.right
    K = camera.K.copy()
    K[:2, :2] *= 1 + drift[3]
    lens = LENSES[camera.distortion_model]
    raw = lens.distort(points[:, :2] / points[:, 2:], camera.D) @ K[:2, :2].T + K[:2, 2]
    back = np.column_stack([lens.undistort(raw, camera.K, camera.D), np.ones(count)]) @ camera.R.T
    right = back[:, :2] / back[:, 2:] * [geometry.focal_x, geometry.focal_y] + [
        geometry.center_x_right, geometry.center_y]
    return left, right


def alignment(calibration, drift, noise=0.0, seed=1, **options):
    """Return what the core would show of the rows of such a pair."""
    left, right = observed(calibration, drift, seed=seed, **options)
    inside = ((right > 5) & (right < np.array(SIZE) - 6)).all(axis=1)
    left, right = left[inside], right[inside]
    dy = right[:, 1] - left[:, 1] + np.random.default_rng(seed + 100).normal(
        0, noise, len(left))
    evidence = RowEvidence(right[:, 0], left[:, 1], dy, np.full(len(dy), max(noise, 0.02)),
                           left[:, 0] - right[:, 0])
    return Alignment.unknown(SIZE).but(observable=True, agreeing=True, evidence=evidence)


@pytest.mark.parametrize('kind', ['plain', 'barrel', 'fisheye', 'unequal'])
def test_rows_agree_once_the_true_drift_is_known(kind):
    calibration = rig(kind)
    drift = KNOCK + np.array([0, 0, 0, 0, 0.002, -0.003])
    left, right = observed(calibration, drift)
    geometry = calibration.geometry
    camera = PhysicalRight.of(calibration)
    raw = camera.raw((right - [geometry.center_x_right, geometry.center_y])
                     / [geometry.focal_x, geometry.focal_y])
    rays = (left - [geometry.center_x_left, geometry.center_y]) / [geometry.focal_x,
                                                                   geometry.focal_y]
    error, by_drift = row_errors(drift, camera, raw, rays, geometry.focal_y)
    assert np.abs(error).max() < 1e-4
    assert np.abs(row_errors(np.zeros(COUNT), camera, raw, rays, geometry.focal_y)[0]).max() > 1
    for index in range(COUNT):
        step = 1e-6 * np.eye(COUNT)[index]
        ahead, behind = (row_errors(drift + each, camera, raw, rays, geometry.focal_y)[0]
                         for each in (step, -step))
        assert (ahead - behind) / 2e-6 == pytest.approx(by_drift[:, index], abs=3.0, rel=5e-3)


@pytest.mark.parametrize('kind', ['plain', 'barrel', 'fisheye', 'unequal'])
def test_fields_say_what_a_small_drift_does(kind):
    calibration = rig(kind)
    still = observed(calibration, np.zeros(COUNT))
    for index in range(COUNT):
        drift = 1e-5 * np.eye(COUNT)[index]
        left, right = observed(calibration, drift)
        rows, disparities = expected_fields(calibration, *left.T, left[:, 0] - right[:, 0])
        moved = right - still[1]
        assert moved[:, 1] == pytest.approx(rows @ drift, abs=2e-4)
        assert -moved[:, 0] == pytest.approx(disparities @ drift, abs=2e-4)


@pytest.mark.parametrize('kind', ['plain', 'barrel', 'fisheye', 'unequal'])
def test_a_corrected_calibration_has_equal_rows_and_true_depth(kind):
    calibration = rig(kind)
    drift = KNOCK + np.array([0, 0, 0, 0, 0.002, -0.003])
    fixed = corrected(calibration, drift)
    left, right = observed(calibration, drift)
    geometry = calibration.geometry
    offsets = np.array([geometry.center_x_right, geometry.center_y])
    scale = np.array([geometry.focal_x, geometry.focal_y])
    raw = PhysicalRight.of(calibration).raw((right - offsets) / scale)
    place = [PhysicalRight.of(fixed).rays(raw) @ fixed.right.R.T,
             np.column_stack([(left - [geometry.center_x_left, geometry.center_y]) / scale,
                              np.ones(len(left))]) @ aligned_axes(drift).T]
    rays = [each[:, :2] / each[:, 2:] for each in place]
    assert np.abs((rays[0] - rays[1])[:, 1] * geometry.focal_y).max() < 1e-3
    assert fixed.geometry == calibration.geometry
    assert np.allclose(fixed.left.R @ fixed.left.R.T, np.eye(3))


@pytest.mark.parametrize('kind', ['plain', 'barrel', 'fisheye', 'unequal'])
def test_one_pair_tells_pitch_roll_and_yaw_of_a_knock(kind):
    calibration = rig(kind)
    tracker = HealthTracker(calibration)
    health = tracker.follow(tracker.unknown(), alignment(calibration, KNOCK, noise=0.05))
    error = np.abs((health.drift - KNOCK) * SHOWN)
    assert health.knocked and health.drifted and health.correctable
    assert (error[:3] < 4 * health.std[:3] * SHOWN[:3]).all()
    assert (error[[0, 2]] < [0.002, 0.003]).all() and error[1] < 0.015
    assert 'the cameras have moved' in health.sentence()
    applied = tracker.to_apply(health)
    assert applied[:4] == pytest.approx(health.drift[:4]) and not applied[4:].any()


def test_pairs_after_a_correction_show_the_same_drift():
    calibration = rig('barrel')
    tracker = HealthTracker(calibration)
    health = tracker.follow(tracker.unknown(), alignment(calibration, KNOCK))
    applied = tracker.to_apply(health)
    left, right = observed(calibration, KNOCK)
    geometry = calibration.geometry
    raw = PhysicalRight.of(calibration).raw(
        (right - [geometry.center_x_right, geometry.center_y])
        / [geometry.focal_x, geometry.focal_y])
    fixed = corrected(calibration, applied, baseline=False)
    rays = PhysicalRight.of(fixed).rays(raw) @ fixed.right.R.T
    right = rays[:, :2] / rays[:, 2:] * [geometry.focal_x, geometry.focal_y] + [
        geometry.center_x_right, geometry.center_y]
    evidence = RowEvidence(right[:, 0], left[:, 1], (right - left)[:, 1],
                           np.full(len(left), 0.05), left[:, 0] - right[:, 0])
    assert np.abs(evidence.dy).max() < 0.05
    seen = Alignment.unknown(SIZE).but(observable=True, agreeing=True, evidence=evidence)
    after = tracker.follow(health.but(applied=applied), seen)
    assert after.drift == pytest.approx(health.drift, abs=1e-4)
    assert after.is_applied and 'corrected' in after.sentence()
    assert np.array_equal(tracker.to_apply(after), after.applied)


def test_a_sound_pair_raises_no_alarm(effort, figures):
    calibration = rig('barrel')
    tracker = HealthTracker(calibration)
    health = tracker.unknown()
    alarms, seeds = 0, effort.seeds(20, 1000)
    for seed in seeds:
        health = tracker.follow(health, alignment(calibration, np.zeros(COUNT), noise=0.1,
                                                  seed=seed))
        alarms += health.knocked or health.drifted
    figures('health: false alarms in sound pairs', alarms, 'pairs', over=seeds, at_most=0)
    assert 'holds' in health.sentence()
    assert not tracker.to_apply(health).any()


def test_a_small_knock_is_told_within_ten_pairs(effort, figures):
    calibration = rig('plain')
    tracker = HealthTracker(calibration)
    drift = np.array([0.02, 0, 0, 0, 0, 0]) / SHOWN
    silent, seeds = 0, effort.seeds(3, 100)
    for seed in seeds:
        health = tracker.unknown()
        for pair in range(20):
            health = tracker.follow(health, alignment(calibration, 0 * drift, 0.1,
                                                      seed=1000 * seed + pair))
        for pair in range(10):
            health = tracker.follow(health, alignment(calibration, drift, 0.1,
                                                      seed=1000 * seed + 500 + pair))
        silent += not health.drifted
        there = tracker.fields(140.0)[0] @ drift
        assert abs(health.rows - np.sqrt(np.mean(there ** 2))) < 0.05
    figures('health: knocks of .02 degrees of pitch not told within 10 pairs', silent, 'knocks',
            over=seeds, at_most=0)


def test_a_pattern_without_rows_says_so():
    tracker = HealthTracker(rig())
    blind = Alignment.unknown(SIZE).but(observable=False, agreeing=True)
    health = tracker.follow(tracker.unknown(), blind)
    assert health.sentence() == BLIND and not health.pairs
    seen = tracker.follow(health, alignment(rig(), KNOCK, noise=0.05))
    after = tracker.follow(seen, blind)
    assert after.drifted and np.array_equal(after.drift, seen.drift)


def test_most_pairs_cost_nothing():
    calibration = rig()
    tracker = HealthTracker(calibration)
    health = tracker.unknown()
    used = []
    for pair in range(12):
        after = tracker.follow(health, alignment(calibration, np.zeros(COUNT), 0.1, seed=pair))
        used.append(after.pairs > health.pairs)
        health = after
    assert used == [True] * 5 + [False, False, False, False, True] + [False] * 2


def test_a_pair_replaces_what_an_earlier_one_said_of_the_same_cells():
    calibration = rig()
    tracker = HealthTracker(calibration)
    seen = alignment(calibration, KNOCK, noise=0.05)
    once = tracker.follow(tracker.unknown(), seen)
    again = tracker.follow(once, seen)
    # the errors of a scene at rest come again: it tells nothing new
    assert again.std == pytest.approx(once.std, rel=0.02)
    other = tracker.follow(once, alignment(calibration, KNOCK, noise=0.05, seed=2).but(turn=1))
    assert (other.std[:3] < 0.8 * once.std[:3]).all()
    whole = other
    for asked in (2, 3):
        whole = tracker.follow(whole, alignment(calibration, KNOCK, noise=0.05,
                                                seed=asked + 1).but(turn=asked))
    assert np.linalg.matrix_rank(whole.information.sum(axis=0)) > COUNT
    assert (np.abs(whole.drift - KNOCK) < 3 * whole.std).all()


def test_a_drift_that_is_too_large_is_told_and_not_corrected():
    calibration = rig()
    tracker = HealthTracker(calibration)
    drift = np.array([0.0, 0.0, 1.5, 0.0, 0, 0]) / SHOWN
    health = tracker.follow(tracker.unknown(), alignment(calibration, drift, noise=0.05))
    assert health.drifted and not health.correctable
    assert not tracker.to_apply(health).any()
    assert 'calibrate them again' in health.sentence()


def test_values_are_immutable():
    health = HealthTracker(rig()).unknown()
    with pytest.raises(ValueError):
        health.drift[0] = 1
    assert set(health.numbers()) == {'pitch', 'yaw', 'roll', 'focal', 'baseline y', 'baseline z'}
    assert len(TUNING.use.largest) == 4
