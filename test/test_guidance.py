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
"""Guidance: few chosen views are worth many others, and every pose can be detected."""

import time

from board_views import (
    CORNERS, errors_of, guided_poses, inside, modes, project, random_poses, rig, rms, seen, SIZE)

from color_stereo_ros.calibration.adjustment import adjust
from color_stereo_ros.calibration.board_model import BoardModel
from color_stereo_ros.calibration.guidance import (
    Detectable, first_information, grid_of, Guide, Quality)
from color_stereo_ros.calibration.least_squares import inverse_information

import numpy as np

from proof import rms_bound

import pytest

SIDES = ('left', 'right')


def test_eight_guided_views_are_not_worse_than_fifty_random_ones(effort, figures):
    truth, seeds = rig(), effort.seeds(3, 40)
    chosen, errors, expected = guided_poses(truth, 8), [], []
    quality = Quality.at(truth.calibration(), 0.35)
    for seed in seeds:
        rng = np.random.default_rng(seed)
        guided = adjust(SIZE, CORNERS, seen(truth, chosen, rng))
        anywhere = adjust(SIZE, CORNERS, seen(truth, random_poses(truth, 50, rng), rng))
        both = guided, anywhere
        errors.append([errors_of(each, truth)[2:] for each in both])
        expected.append([quality.of(inverse_information(each.information))[::-1]
                         for each in both])
    for name, weights, real, claimed in zip(
            ('rows', 'Z'), (quality.rows, quality.depth), rms(errors, 0).T, rms(expected, 0).T):
        goal = claimed[0] / claimed[1]
        figures(f'guidance: 8 guided over 50 random views, {name}, expected', goal, '',
                over=seeds, at_most=1.0)
        freedoms = [len(seeds) * modes(each.matrix, weights[:-2, :-2]) for each in both]
        figures(f'guidance: 8 guided over 50 random views, {name}', real[0] / real[1], '',
                over=seeds, at_most=1.0 if effort.full else goal * rms_bound(*freedoms))


def test_the_expected_quality_is_that_of_the_view_when_it_is_taken():
    truth = rig()
    first = adjust(SIZE, CORNERS, seen(truth, guided_poses(truth, 5), np.random.default_rng(0)))
    advice = Guide(CORNERS, 0.35).next(first.parameters, first.information)
    poses = guided_poses(truth, 5) + [(advice.rotation, advice.translation)]
    after = adjust(SIZE, CORNERS, seen(truth, poses, np.random.default_rng(0)))
    quality = Quality.at(after.calibration, 0.35)
    covariance = inverse_information(after.information)
    np.testing.assert_allclose(quality.of(covariance),
                               (advice.expected_depth_std, advice.expected_rows_std), rtol=0.1)
    points = grid_of(first.calibration, 0.35)
    assert advice.depth_std == pytest.approx(rms(
        first.covariance.depth_std(first.calibration, *points)), rel=1e-6)
    assert advice.rows_std == pytest.approx(rms(
        first.covariance.rows_std(first.calibration, *points)), rel=1e-6)
    assert advice.expected_depth_std < advice.depth_std
    assert advice.expected_rows_std < advice.rows_std


@pytest.mark.parametrize('whole', [False, True])
def test_every_pose_can_be_detected_in_both_images(whole):
    truth, model = rig(), BoardModel(CORNERS)
    guide = Guide(CORNERS, 0.35, Detectable(whole=whole, least_corners=20, steepest=45.0))
    state, informations = guide.candidates(truth)
    assert len(informations) == len(state.rotations) > 10
    for rotation, translation in zip(state.rotations, state.translations):
        for side in SIDES:
            pixels = project(truth, model, (rotation, translation), side)
            assert inside(pixels, margin=7.9).sum() >= (len(CORNERS) if whole else 20)
        points = CORNERS @ rotation.T + translation
        middle = points.mean(0) / np.linalg.norm(points.mean(0))
        assert abs(middle @ rotation[:, 2]) > np.cos(np.radians(45.1))


def test_the_outlines_are_the_outer_corners_in_both_images():
    truth = rig()
    advice = Guide(CORNERS, 0.35).next(truth, first_information(truth, CORNERS))
    for side in SIDES:
        pixels = project(truth, BoardModel(CORNERS), (advice.rotation, advice.translation), side)
        np.testing.assert_allclose(advice.outlines[side], pixels[[0, 10, 87, 77]], atol=1e-6)
    assert advice.distance == pytest.approx(np.linalg.norm(advice.translation))


def test_a_board_that_no_pose_can_show_gives_no_advice():
    truth = rig()
    assert Guide(10 * CORNERS, 0.35, Detectable(whole=True, least_square=500.0)).next(
        truth, first_information(truth, 10 * CORNERS)) is None


def test_the_next_pose_is_found_while_the_board_is_moved(effort, figures):
    truth = rig()
    guide, information = Guide(CORNERS, 0.35), first_information(truth, CORNERS)
    times = []
    for _ in range(rounds := effort.count(2, 10)):
        begin = time.process_time()
        guide.next(truth, information)
        times.append(time.process_time() - begin)
    figures('guidance: next pose, time of one core', 1e3 * np.median(times), 'ms', over=rounds)
