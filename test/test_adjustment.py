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
"""The joint adjustment of simulated corners: how near the truth, and what it claims."""

from dataclasses import replace
import time

from board_views import (
    CORNERS, errors_of, guided_poses, modes, random_poses, rig, rms, rows_and_depth_errors, seen,
    SIZE)

from color_stereo_ros.calibration.adjustment import adjust, problem_of
from color_stereo_ros.calibration.board_model import BoardModel, State
from color_stereo_ros.calibration.evidence import agreement_of_halves, choose_lens
from color_stereo_ros.calibration.guidance import grid_of, Quality
from color_stereo_ros.calibration.least_squares import inverse_information
from color_stereo_ros.calibration.shared_errors import shared_covariance, smooth_terms
from color_stereo_ros.calibration.views import View
from color_stereo_ros.core import CalibrationError

import numpy as np

from proof import rms_bound

import pytest

RIVALS = {'plumb_bob': 'equidistant', 'rational_polynomial': 'plumb_bob',
          'equidistant': 'plumb_bob'}
"""A lens model and the one that it must be told from in the short run."""


@pytest.fixture(scope='module')
def fifteen():
    """Return the 15 poses that the guidance asks for with the rig of these tests."""
    return guided_poses(rig(), 15)


def adjusted(truth, poses, seed, **options):
    """Return the Adjustment of simulated views."""
    return adjust(SIZE, CORNERS, seen(truth, poses, np.random.default_rng(seed), **options),
                  truth.distortion_model)


def test_fifteen_guided_views_calibrate_to_the_limit(effort, figures, fifteen):
    truth, seeds = rig(), effort.seeds(10, 200)
    calibration = truth.calibration()
    quality, points = Quality.at(calibration, 0.35), grid_of(calibration, 0.35)
    errors, limits, claims, within = [], [], [], []
    for seed in seeds:
        found = adjusted(truth, fifteen, seed)
        errors.append(errors_of(found, truth))
        said = found.information * max(found.scale, 1.0)**2
        limits.append(quality.of(inverse_information(said)))
        change = (found.parameters.vector - truth.vector) / np.sqrt(np.diag(found.matrix))
        within.append(np.abs(change) < 3)
        depth = rows_and_depth_errors(found.calibration, truth)[1]
        claims.append(depth / found.covariance.depth_std(found.calibration, *points))
    focal, baseline, rows, depth = rms(errors, 0)
    depth_limit, rows_limit = rms(limits, 0)
    bounds = [1.15 if effort.full else rms_bound(len(seeds) * modes(found.matrix, weights))
              for weights in (quality.depth[:-2, :-2], quality.rows[:-2, :-2])]
    for name, value, unit, goal in (
            ('15 guided views, focal length', 100 * focal, '%', 0.012),
            ('15 guided views, baseline', 100 * baseline, '%', 0.006),
            ('15 guided views, rows', rows, 'px', 0.009),
            ('15 guided views, Z at 350 mm', 1e3 * depth, 'mm', 0.035),
            ('depth over Cramer-Rao', depth / depth_limit, '', bounds[0]),
            ('rows over Cramer-Rao', rows / rows_limit, '', bounds[1])):
        figures(f'calibration: {name}', value, unit, over=seeds, at_most=goal)
    figures('calibration: parameters within 3 sigma', np.mean(within), '', over=seeds,
            at_least=0.95)
    z68 = np.percentile(np.abs(claims), 68)
    figures('calibration: z68 of the depth', z68, '', over=seeds, at_least=0.8, at_most=1.25)


@pytest.mark.parametrize('model', ['rational_polynomial', 'equidistant'])
def test_other_lenses_are_calibrated_as_well(effort, figures, fifteen, model):
    truth, seeds = rig(model), effort.seeds(3, 40)
    quality = Quality.at(truth.calibration(), 0.35)
    errors, limits, within = [], [], []
    for seed in seeds:
        found = adjusted(truth, fifteen, seed)
        errors.append(errors_of(found, truth)[3])
        limits.append(quality.of(inverse_information(found.information))[0])
        covariance, calibration = found.covariance, found.calibration
        rows, depth = rows_and_depth_errors(calibration, truth)
        points = grid_of(calibration, 0.35)
        within += [np.abs(depth) < 3 * covariance.depth_std(calibration, *points),
                   np.abs(rows) < 3 * covariance.rows_std(calibration, *points)]
    figures(f'calibration: {model}, Z at 350 mm', 1e3 * rms(errors), 'mm', over=seeds)
    figures(f'calibration: {model}, Z over the claim', rms(errors) / rms(limits), '', over=seeds,
            at_most=1.15 if effort.full else rms_bound(
                len(seeds) * modes(found.matrix, quality.depth[:-2, :-2])))
    figures(f'calibration: {model}, rows and depth within 3 sigma', np.mean(within), '',
            over=seeds, at_least=0.95)


def test_the_standard_deviation_of_the_corners_is_measured(fifteen):
    views = [View(view.name, *(replace(side, sigma=side.sigma / 2)
                               for side in (view.left, view.right)))
             for view in seen(rig(), fifteen, np.random.default_rng(1))]
    assert adjust(SIZE, CORNERS, views).scale == pytest.approx(2.0, rel=0.05)


def test_errors_that_all_views_share_move_the_result_as_foretold(fifteen):
    views = seen(rig(), fifteen, np.random.default_rng(1))
    before, field = adjust(SIZE, CORNERS, views), {}
    for index, side in enumerate(('left', 'right')):
        terms = smooth_terms(before.corners[side].pixels, SIZE)
        field[side] = 0.05 * np.stack([terms[:, 3 + index], terms[:, 6 - index]], axis=1)
    parts = {side: np.split(field[side], np.flatnonzero(np.diff(before.corners[side].view)) + 1)
             for side in field}
    moved = [View(view.name, **{side: replace(getattr(view, side), pixels=getattr(
        view, side).pixels + parts[side][index]) for side in field})
        for index, view in enumerate(views)]
    after = adjust(SIZE, CORNERS, moved)
    problem = problem_of(BoardModel(CORNERS), views)
    state = State(before.parameters, before.bend, before.rotations, before.translations)
    equations = problem.equations(state, np.ones(state.shared.size, bool))
    noise = inverse_information(equations.information())
    change = noise @ problem.pulls(
        equations, {side: field[side][:, :, None] for side in field})[:, 0]
    expected = change[:-2] / np.sqrt(np.diag(before.matrix))
    found = (after.parameters.vector - before.parameters.vector) / np.sqrt(
        np.diag(before.matrix))
    assert np.abs(expected).max() > 1
    np.testing.assert_allclose(found, expected, atol=0.1)
    assert (np.diag(before.matrix) > np.diag(noise)[:-2]).all()
    u, v = np.meshgrid(np.arange(0.5, 640), np.arange(0.5, 480))
    terms = smooth_terms(np.column_stack([u.ravel(), v.ravel()]), SIZE)
    assert np.square(terms).sum(axis=1).mean() == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize('factor', [0.5, 4.0])
def test_bold_sigmas_do_not_change_what_views_share(fifteen, factor):
    """A common factor of all sigmas is in the scale; the shared errors move values as before."""
    views = seen(rig(), fifteen, np.random.default_rng(1))
    state = adjust(SIZE, CORNERS, views)
    state = State(state.parameters, state.bend, state.rotations, state.translations)

    def shared(some):
        problem = problem_of(BoardModel(CORNERS), some)
        equations = problem.equations(state, np.ones(state.shared.size, bool))
        return shared_covariance(problem, equations, SIZE,
                                 inverse_information(equations.information()))

    bold = [View(view.name, **{side: replace(getattr(view, side), sigma=getattr(
        view, side).sigma * factor) for side in ('left', 'right')}) for view in views]
    # robust weights and the priors of poses know the sigmas
    np.testing.assert_allclose(shared(bold), shared(views), rtol=0.005, atol=1e-10)
    told = [np.diag(adjust(SIZE, CORNERS, each).matrix) for each in (bold, views)]
    if factor < 1:  # the scale makes up for it
        np.testing.assert_allclose(*told, rtol=0.02)


def test_a_bent_board_is_modeled(effort, figures, fifteen):
    truth, seeds = rig(), effort.seeds(2, 40)
    bend = 0.0002, 0.0001
    bent = [adjusted(truth, fifteen, seed, bend=bend) for seed in seeds]
    flat = [adjusted(truth, fifteen, seed) for seed in seeds]
    for found in bent:
        assert np.all(np.abs(found.bend - bend) < 5 * found.bend_std)
    depth = [rms([errors_of(each, truth)[3] for each in group]) for group in (bent, flat)]
    figures('calibration: board bent by .3 mm over a flat one, Z', depth[0] / depth[1], '',
            over=seeds, at_most=1.2)


def out_of_step(views, truth, poses, indices, rng):
    """Return views of which some show the board a little later in the right camera."""
    changed = list(views)
    for index in indices:
        rotation, translation = poses[index]
        later = seen(truth, [(rotation, translation + [0.002, 0.001, -0.001])], rng)[0]
        changed[index] = replace(views[index], right=later.right)
    return changed


def blurred(views, indices, rng):
    """Return views of which some have corners with ten times the noise."""
    changed = list(views)
    for index in indices:
        changed[index] = View(views[index].name, *(
            replace(side, pixels=side.pixels + rng.normal(0, 0.5, side.pixels.shape))
            for side in (views[index].left, views[index].right)))
    return changed


@pytest.mark.parametrize('kind', ['out of step', 'blurred'])
def test_two_bad_views_are_named_and_dropped(effort, figures, fifteen, kind):
    truth, seeds = rig(), effort.seeds(2, 40)
    depth = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        good = seen(truth, fifteen, rng)
        bad = sorted(rng.choice(15, 2, replace=False))
        views = (out_of_step(good, truth, fifteen, bad, rng) if kind == 'out of step'
                 else blurred(good, bad, rng))
        found = adjust(SIZE, CORNERS, views)
        assert sorted(found.dropped) == [views[index].name for index in bad]
        clean = adjust(SIZE, CORNERS, [view for index, view in enumerate(good)
                                       if index not in bad])
        depth.append([errors_of(each, truth)[3] for each in (found, clean)])
    with_bad, without = rms(depth, 0)
    figures(f'calibration: 2 of 15 views {kind}, Z over clean', with_bad / without, '',
            over=seeds, at_most=1.2)


def test_a_view_that_claims_too_much_but_fits_in_pixels_stays(fifteen):
    views = seen(rig(), fifteen, np.random.default_rng(4))
    for index in (2, 9):  # as steep views of rendered boards: the sigma is too small by half
        views[index] = View(views[index].name, *(replace(side, sigma=side.sigma / 2.5)
                                                 for side in (views[index].left,
                                                              views[index].right)))
    found = adjust(SIZE, CORNERS, views)
    assert not found.dropped
    assert errors_of(found, rig())[3] < 1e-4


def test_single_gross_corners_are_left_out_and_the_view_stays(fifteen):
    truth = rig()
    views = seen(truth, fifteen, np.random.default_rng(3))
    pixels = views[4].left.pixels.copy()
    pixels[[3, 9]] += [[7.0, 0], [0, -3.0]]
    views[4] = replace(views[4], left=replace(views[4].left, pixels=pixels))
    found = adjust(SIZE, CORNERS, views)
    assert not found.dropped
    left_out = found.corners['left'].of_view(4).start + np.array([3, 9])
    assert set(left_out) <= set(np.flatnonzero(~found.kept['left']))
    assert errors_of(found, truth)[3] < 1e-4


def test_views_of_one_camera_help_its_lens(fifteen):
    views = seen(rig(), fifteen, np.random.default_rng(5))
    fewer = views[:8] + [replace(view, right=None) for view in views[8:]]
    both, one = adjust(SIZE, CORNERS, fewer), adjust(SIZE, CORNERS, views[:8])
    assert both.covariance.std[0] < 0.95 * one.covariance.std[0]


def test_bad_input_is_refused_in_a_clear_sentence(fifteen):
    truth, rng = rig(), np.random.default_rng(6)
    views = seen(truth, fifteen, rng)
    with pytest.raises(CalibrationError, match='2 views are seen by both cameras, expected'):
        adjust(SIZE, CORNERS, views[:2])
    alone = [replace(view, right=None) for view in views]
    with pytest.raises(CalibrationError, match='0 views are seen by both cameras'):
        adjust(SIZE, CORNERS, alone)
    rotation, translation = random_poses(truth, 1, rng)[0]
    parallel = [(np.eye(3), translation + [0, 0, shift]) for shift in (0, 0.01, 0.02)]
    with pytest.raises(CalibrationError, match='tilt the board'):
        adjust(SIZE, CORNERS, seen(truth, parallel, rng))
    shuffled = [replace(view, right=other.right) for view, other in zip(views, views[1:])]
    with pytest.raises(CalibrationError, match='do not fit together'):
        adjust(SIZE, CORNERS, shuffled)


def test_sixty_views_are_solved(figures, effort):
    truth = rig()
    views = seen(truth, random_poses(truth, 60, np.random.default_rng(7)),
                 np.random.default_rng(8))
    begin = time.process_time()
    found = adjust(SIZE, CORNERS, views)
    figures('calibration: 60 views, time of one core', time.process_time() - begin, 's',
            over=effort.count(1, 1))
    assert errors_of(found, truth)[3] < 2e-4 and not found.dropped


@pytest.mark.parametrize('model', RIVALS)
def test_the_lens_model_is_chosen_by_evidence(effort, model):
    truth = rig(model, focal=300.0)
    poses = guided_poses(truth, 18, distance=0.3)
    for seed in effort.seeds(1, 10):
        views = seen(truth, poses, np.random.default_rng(seed))
        choice = choose_lens(SIZE, CORNERS, views, effort.count((model, RIVALS[model]), None))
        assert choice.model == model, choice.reason
        assert choice.scatter[model] == pytest.approx(1.0, abs=0.15)


def test_halves_agree_as_they_claim(effort, figures, fifteen):
    seeds = effort.seeds(2, 40)
    ratios = []
    for seed in seeds:
        found = agreement_of_halves(SIZE, CORNERS,
                                    seen(rig(), fifteen, np.random.default_rng(seed)),
                                    'plumb_bob', 0.35)
        ratios.append(found.depth / found.expected_depth)
    figures('calibration: halves, difference of the depth over the claim', rms(ratios), '',
            over=seeds, at_least=0.5, at_most=1.6)
