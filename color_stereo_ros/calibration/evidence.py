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
"""What views say about each other: the lens model that predicts best, and halves that agree."""

from dataclasses import dataclass

import numpy as np

from .adjustment import adjust, judged, problem_of
from .board_model import BoardModel
from .guidance import grid_of
from .starting import COEFFICIENTS, state_of
from ..core.cameras.covariance import depth_derivatives, rectified_derivatives
from ..core.cameras.lenses import LENSES
from ..core.constants import ROBUST_STD
from ..errors import CalibrationError

FOLDS = 3
"""Parts of the views, each of which is predicted by the others; chosen: the usual few."""
CLEAR = 2.0
"""Standard errors by which a lens with more coefficients must predict better."""
USUAL = 'plumb_bob'
"""The model that most lenses have and every tool reads."""
RELEVANT = 0.01
"""Of the scatter: less is not worth a coefficient."""
SPLITS = 3
"""Ways to split the views into halves; chosen: one alone scatters by a third."""


@dataclass(frozen=True, eq=False)
class LensChoice:
    """Which lens model predicts the views best."""

    model: str
    scatter: dict
    """Model to the scatter of views that it did not see, in sigma of the corners; inf = the
    views cannot be explained with it."""
    reason: str
    """One sentence for people."""


def choose_lens(size, corners, views, models=None):
    """
    Choose the distortion model by cross-validation.

    Parameters
    ----------
    size : (int, int)
        px.
    corners : numpy.ndarray, float64, shape (N, 3)
        m.
    views : list of View
        Of the board.
    models : iterable of str, optional
        Default: all of `LENSES`.

    Returns
    -------
    choice : LensChoice
        `USUAL` unless another one predicts clearly better; then the model with the fewest
        coefficients that none predicts clearly better.

    Raises
    ------
    CalibrationError
        If the views can be explained with no model; the reason of the first one.

    """
    predicted, errors = {}, []
    for model in models or LENSES:
        try:
            predicted[model] = predicted_scatter(size, corners, views, model)
        except CalibrationError as error:
            errors.append(error)
    if not predicted:
        raise errors[0]
    scatter = {model: float(np.median(predicted[model])) if model in predicted else np.inf
               for model in models or LENSES}
    best = min(predicted, key=scatter.get)
    simple = sorted(predicted, key=lambda model: (
        model != USUAL, coefficients_of_model(model), scatter[model]))
    chosen = next(model for model in simple
                  if not _clearly_better(predicted[best], predicted[model]))
    others = ', '.join(f'{model} {value:.3f}' for model, value in scatter.items()
                       if model != chosen)
    return LensChoice(chosen, scatter, f'{chosen} predicts unseen views with a scatter of '
                      f'{scatter[chosen]:.3f} sigma of the corners (others: {others})')


def coefficients_of_model(model):
    """Return how many distortion coefficients of a model are estimated."""
    return COEFFICIENTS.get(model, LENSES[model].lengths[-1])


def _clearly_better(best, other):
    """Return whether one list of scatters (V,) is clearly smaller than another."""
    gain = np.log(other) - np.log(best)
    middle = np.median(gain)
    # of a median
    error = 1.2533 * ROBUST_STD * np.median(np.abs(gain - middle)) / np.sqrt(gain.size)
    return middle > max(RELEVANT, CLEAR * error)


def predicted_scatter(size, corners, views, model):
    """
    Return how well each view is predicted by a calibration that has not seen it.

    Returns
    -------
    scatter : numpy.ndarray, float64, shape (V,)
        Robust standard deviation of the residuals, in sigma of the corners. The pose of the
        view itself is fitted.

    """
    scatter = np.empty(len(views))
    for fold in range(FOLDS):
        unseen = [index for index in range(len(views)) if index % FOLDS == fold]
        known = [view for index, view in enumerate(views) if index % FOLDS != fold]
        found = adjust(size, corners, known, model)
        here = [views[index] for index in unseen]
        board = BoardModel(corners)
        state = state_of(found.parameters, found.bend, board.corners, here)
        problem = problem_of(board, here)
        state = problem.solved(state, np.zeros(state.shared.size, bool))
        scatter[unseen] = judged(problem, state)[1]
    return scatter


@dataclass(frozen=True)
class Agreement:
    """How far two calibrations differ that share no view; root mean squares over the image."""

    depth: float
    """m, at the working distance."""
    expected_depth: float
    """m: what both covariances say."""
    rows: float
    """px."""
    expected_rows: float
    """px."""

    @property
    def ratio(self):
        """Return the larger ratio of difference and expectation; 1 is honest."""
        return max(self.depth / self.expected_depth, self.rows / self.expected_rows)


def agreement_of_halves(size, corners, views, model, distance):
    """
    Calibrate with halves of the views and compare.

    Parameters
    ----------
    size : (int, int)
        px.
    corners : numpy.ndarray, float64, shape (N, 3)
        m.
    views : list of View
        At least twice as many pairs as an adjustment needs.
    model : str
        Distortion model.
    distance : float
        Working distance, m.

    Returns
    -------
    agreement : Agreement
        The mean squares of `SPLITS` ways to split the views.

    Raises
    ------
    CalibrationError
        If a half is no calibration by itself.

    """
    found = []
    for split in range(SPLITS):
        order = np.random.default_rng(split).permutation(len(views))
        halves = [[views[index] for index in sorted(half)]
                  for half in (order[::2], order[1::2])]
        found.append(_squares(*(adjust(size, corners, half, model) for half in halves),
                              distance))
    return Agreement(*np.sqrt(np.mean(found, axis=0)).tolist())


def _squares(first, second, distance):
    """Return mean squares of the differences of depth and rows, each before what is expected."""
    points = grid_of(first.calibration, distance)
    change = first.parameters.vector - second.parameters.vector
    covariance = first.matrix + second.matrix
    found = []
    for by in (depth_derivatives(first.calibration, *points),
               rectified_derivatives(first.calibration, *points)[0]):
        found += [np.mean((by @ change)**2), np.mean(np.einsum('pi,ij,pj->p', by, covariance,
                                                               by))]
    return found
