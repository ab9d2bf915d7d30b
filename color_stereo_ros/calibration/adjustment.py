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
"""Joint bundle adjustment of both cameras, with covariance; bad views are named and dropped."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .board_model import BENDS, BoardModel
from .least_squares import inverse_information, Problem, UNDETERMINED
from .shared_errors import shared_covariance
from .starting import first_state, NOT_TOGETHER
from .views import Corners, SIDES
from ..core.cameras.covariance import StereoCovariance
from ..core.cameras.parameters import StereoParameters
from ..core.constants import ROBUST_STD
from ..errors import CalibrationError

LEAST_VIEWS = 3        # pairs; fewer cannot determine focal lengths and distortion
GROSS = 5.0            # sigma: a corner beyond is left out
GROSS_SHARE = 0.2      # of the corners of a view: more, and the view is dropped
WORSE = 1.6            # times the scatter of the middle view: a view beyond is dropped
SCATTER = 4 * 1.17     # four sigma of a median deviation of n values is so much / sqrt(n)
ROUNDS = 8             # of robust weights, and of dropping; chosen: two or three suffice
LARGEST_FOCAL_STD = 0.02  # of the focal length: a calibration beyond is none


@dataclass(frozen=True, eq=False)
class Adjustment:
    """The result of a joint adjustment."""

    parameters: StereoParameters
    matrix: np.ndarray
    """float64 (n, n): covariance of `parameters.vector`, poses and bend unknown, with errors that
    corners share in all views."""
    information: np.ndarray
    """float64 (n + 2, n + 2): inverse of the covariance of the parameters and the bend."""
    bend: np.ndarray
    """float64 (2,), m: height of the middle of the board over its edges, along x and y."""
    bend_std: np.ndarray
    """float64 (2,), m."""
    scale: float
    """Scatter of the residuals over what the sigma of the corners says; 1 = as said."""
    views: tuple
    """The views that were used."""
    rotations: np.ndarray
    """float64 (V, 3, 3): X_left = R X_board + t of each used view."""
    translations: np.ndarray
    """float64 (V, 3), m."""
    residuals: dict
    """'left' and 'right': seen less projected, float64 (m, 2), px, of the used views."""
    corners: dict
    """'left' and 'right': `Corners` of the same rows."""
    kept: dict
    """'left' and 'right': bool (m,), False = left out as gross."""
    dropped: dict
    """Names of dropped views to the reason."""

    @cached_property
    def calibration(self):
        """Return the StereoCalibration."""
        return self.parameters.calibration()

    @cached_property
    def covariance(self):
        """Return the StereoCovariance of `calibration`."""
        return StereoCovariance.of(self.calibration, self.matrix)

    @property
    def rms(self):
        """Return the root mean square of the residuals of kept corners, px per coordinate."""
        kept = np.concatenate([self.residuals[side][self.kept[side]] for side in SIDES])
        return float(np.sqrt(np.mean(kept**2)))


def adjust(size, corners, views, distortion_model='plumb_bob', start=None):
    """
    Estimate two cameras from views of a board.

    Every corner weighs by its sigma. Views that fit much worse than the others are dropped as a
    whole, single gross corners are left out. The board may be bent along x and y.

    Parameters
    ----------
    size : (int, int)
        Width and height of the raw images, px.
    corners : numpy.ndarray, float64, shape (N, 3)
        m, of the flat board, z = 0.
    views : list of View
        At least `LEAST_VIEWS` of them seen by both cameras.
    distortion_model : str
        A name in `lenses.LENSES`.
    start : State, optional
        One pose for each view; without it, a start is found from the views alone.

    Returns
    -------
    adjustment : Adjustment

    Raises
    ------
    CalibrationError
        If the views are too few, too parallel, or do not fit together.

    """
    views = [view for view in views if any(map(view.seen, SIDES))]
    check_number(views)
    model = BoardModel(corners)
    state = first_state(size, distortion_model, model.corners, views) if start is None else start
    problem = problem_of(model, views)
    state = robust_state(problem, state)
    problem, state, views, dropped = without_bad_views(model, problem, state, views)
    return _result(problem, state, views, dropped)


def problem_of(model, views):
    """Return the Problem of some views of a BoardModel."""
    return Problem(model, {side: Corners.of(views, side) for side in SIDES}, len(views))


def check_number(views):
    """Refuse too few pairs."""
    pairs = sum(view.is_pair for view in views)
    if pairs < LEAST_VIEWS:
        raise CalibrationError(f'{pairs} views are seen by both cameras, expected at least '
                               f'{LEAST_VIEWS}')


def robust_state(problem, state):
    """Return a state from a first guess, in which bad views have little weight."""
    names = state.parameters.names + BENDS
    lenses = np.array(['D[' not in name for name in names])
    flat = np.array([name not in BENDS for name in names])
    for free in (lenses & flat, flat):
        state = problem.solved(state, free, least_decrease=1.0)
        for _ in range(2):
            _reweigh(problem, state)
            state = problem.solved(state, free, least_decrease=1.0)
    everything = np.ones(len(names), bool)
    for _ in range(ROUNDS):
        before = problem.view_weights
        _reweigh(problem, state)
        state = problem.solved(state, everything, least_decrease=0.1)
        if np.abs(problem.view_weights - before).max() < 0.05:
            break
    return state


def _reweigh(problem, state):
    """Give each view the weight of a Cauchy distribution of its scatter."""
    _, scatter, _ = judged(problem, state)
    problem.view_weights = 1 / (1 + (scatter / (2 * np.median(scatter)))**4)


def judged(problem, state):
    """
    Judge the views of a state.

    Returns
    -------
    gross : dict
        'left' and 'right': bool (m,), the corner lies beyond `GROSS` of the scatter of all.
    scatter : numpy.ndarray, float64, shape (V,)
        Robust standard deviation of the residuals of each view, in sigma of its corners.
    numbers : numpy.ndarray, int, shape (V,)
        Corners of each view.

    """
    residuals = problem.residuals(state)
    scaled = {side: np.abs(residuals[side]) / problem.corners[side].sigma[:, None]
              for side in SIDES}
    of_views = [np.concatenate([scaled[side][problem.corners[side].of_view(view)]
                                for side in SIDES]) for view in range(problem.count)]
    scatter = ROBUST_STD * np.array([np.median(each) for each in of_views])
    limit = GROSS * np.median(scatter)
    gross = {side: (scaled[side] > limit).any(1) for side in SIDES}
    return gross, scatter, np.array([len(each) for each in of_views])


def pixel_scatter(problem, state):
    """Return the median deviation of the residuals of each view, px, float64 (V,)."""
    residuals = problem.residuals(state)
    return np.array([np.median(np.abs(np.concatenate(
        [residuals[side][problem.corners[side].of_view(view)] for side in SIDES])))
        for view in range(problem.count)])


def without_bad_views(model, problem, state, views):
    """Return problem, state and views without the bad ones, and the reasons by name."""
    dropped = {}
    for _ in range(ROUNDS + len(views)):
        gross, scatter, numbers = judged(problem, state)
        reasons = _reasons(problem, gross, scatter, numbers, pixel_scatter(problem, state))
        if not reasons and all(np.array_equal(problem.kept[side], ~gross[side])
                               for side in SIDES) and (problem.view_weights == 1).all():
            break
        if reasons:
            # The worst first: it may have made others look bad.
            worst = max(reasons, key=lambda view: reasons[view][0])
            far = [view for view in reasons if reasons[view][0] > reasons[worst][0] / 2]
            dropped.update({views[view].name: reasons[view][1] for view in far})
            chosen = [view for view in range(len(views)) if view not in far]
            views = [views[view] for view in chosen]
            check_number_left(views, dropped)
            state, problem = state.of_views(chosen), problem_of(model, views)
            gross, _, _ = judged(problem, state)
        problem.kept = {side: ~gross[side] for side in SIDES}
        problem.view_weights = np.ones(len(views))
        state = problem.solved(state, np.ones(state.shared.size, bool))
    return problem, state, views, dropped


def check_number_left(views, dropped):
    """Refuse a result of which hardly a view is left."""
    if sum(view.is_pair for view in views) < LEAST_VIEWS or len(dropped) > len(views):
        raise CalibrationError(
            'the views do not fit together: ' + '; '.join(
                f'{name}: {reason}' for name, reason in dropped.items())
            + f'. {NOT_TOGETHER}')


def _reasons(problem, gross, scatter, numbers, pixels):
    """
    Return by view (how bad, the reason) where a view does not fit.

    What is wrong with a view (motion, another pose, an exchanged image) moves its corners in the
    image. A view whose corners fit as well in px as those of the others is good: there, only the
    standard deviations that the corners claim differ, and those of steep views are the least
    certain.

    """
    middle = np.median(scatter)
    worse_in_pixels = pixels > WORSE * np.median(pixels)
    reasons = {}
    for view in range(problem.count):
        here = np.concatenate([gross[side][problem.corners[side].of_view(view)]
                               for side in SIDES])
        times = scatter[view] / middle
        # two coordinates a corner
        if times > WORSE + SCATTER / np.sqrt(2 * numbers[view]) and worse_in_pixels[view]:
            reasons[view] = times, (f'its corners scatter {times:.1f} times as much as those of '
                                    'the middle view')
        elif here.mean() > GROSS_SHARE:
            reasons[view] = 1 + here.mean(), (f'{here.sum()} of its {here.size} corners lie far '
                                              'from where they belong')
    return reasons


def _result(problem, state, views, dropped):
    """Return the Adjustment of a converged state."""
    everything = np.ones(state.shared.size, bool)
    equations = problem.equations(state, everything)
    number = 2 * sum(int(kept.sum()) for kept in problem.kept.values())
    unknown = everything.size + 6 * problem.count
    if number <= unknown:
        raise CalibrationError(UNDETERMINED)
    scale = np.sqrt(equations.cost / (number - unknown))
    told = inverse_information(equations.information())
    # Errors that corners share do not scatter: small residuals are no reason to claim more.
    matrix = told * max(scale, 1.0)**2 + shared_covariance(
        problem, equations, state.parameters.size, told)
    information = inverse_information(matrix)
    _check_focal_lengths(state.parameters, matrix)
    return Adjustment(
        parameters=state.parameters, matrix=matrix[:-2, :-2],
        information=information, bend=state.bend, bend_std=np.sqrt(np.diag(matrix)[-2:]),
        scale=float(scale), views=tuple(views), rotations=state.rotations,
        translations=state.translations, residuals=problem.residuals(state),
        corners=problem.corners, kept=problem.kept, dropped=dropped)


def _check_focal_lengths(parameters, matrix):
    """Refuse a result that does not know its focal lengths."""
    for name, value, variance in zip(parameters.names, parameters.vector, np.diag(matrix)):
        if name.endswith(('fx', 'fy')) and np.sqrt(variance) > LARGEST_FOCAL_STD * value:
            raise CalibrationError(f'{name} = {value:.0f} px is known to {np.sqrt(variance):.0f} '
                                   f'px only: {UNDETERMINED}')
