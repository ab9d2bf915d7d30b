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
"""Sparse least squares: what views share, and their poses, by the Schur complement."""

from dataclasses import dataclass

import numpy as np

from .views import SIDES
from ..errors import CalibrationError

DAMPING = 1e-4, 1e-12, 1e12
"""Levenberg-Marquardt: first, least and largest; chosen: the usual ones."""
STEPS = 100        # at most; a good start needs about ten
CONVERGED = 1e-6   # decrease of the sum of squares: steps of a thousandth of a sigma
WEAK = 10.0        # standard deviation of distortion coefficients before anything is seen: it
#                    settles those of rational lenses that no image can tell apart
SINGULAR = 1e-13   # least eigenvalue of the information, scaled to a unit diagonal


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations of one state."""

    cost: float
    """Sum of the squared weighted residuals."""
    shared: np.ndarray
    """float64 (k, k), information on the free shared values."""
    shared_gradient: np.ndarray
    """float64 (k,)."""
    mixed: np.ndarray
    """float64 (V, k, 6)."""
    poses: np.ndarray
    """float64 (V, 6, 6)."""
    pose_gradients: np.ndarray
    """float64 (V, 6)."""
    derivatives: dict
    """'left' and 'right': by the free shared values (m, 2, k) and by the poses (m, 2, 6), float64,
    of the weighted projections of the corners."""

    def step(self, damping):
        """Return the step of the free shared values (k,) and of the poses (V, 6)."""
        diagonal = np.arange(6)
        poses = self.poses.copy()
        poses[:, diagonal, diagonal] *= 1 + damping
        to_poses = np.linalg.solve(poses, np.swapaxes(self.mixed, 1, 2))  # (V, 6, k)
        from_poses = np.linalg.solve(poses, self.pose_gradients[:, :, None])[:, :, 0]
        shared = self.shared * (1 + damping * np.eye(len(self.shared)))
        reduced = shared - np.einsum('vkp,vpl->kl', self.mixed, to_poses)
        gradient = self.shared_gradient - np.einsum('vkp,vp->k', self.mixed, from_poses)
        change = _solved(reduced, gradient)
        return change, from_poses - to_poses @ change

    def information(self):
        """Return the information on the free shared values when poses are unknown, (k, k)."""
        return self.shared - view_informations(self.mixed, self.poses).sum(0)


def view_informations(mixed, poses):
    """Return what each view loses to its unknown pose, float64 (V, k, k)."""
    return mixed @ np.linalg.solve(poses, np.swapaxes(mixed, 1, 2))


def _solved(matrix, vector):
    """Return the solution of a scaled positive definite system; of an empty one nothing."""
    if not vector.size:
        return vector
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    return scale * np.linalg.solve(matrix * np.outer(scale, scale), scale * vector)


def inverse_information(information):
    """
    Return the covariance of an information matrix (k, k).

    Raises
    ------
    CalibrationError
        If the views do not determine the values.

    """
    diagonal = np.diag(information)
    if (diagonal <= 0).any():
        raise CalibrationError(UNDETERMINED)
    scale = 1 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    if values[0] < SINGULAR:
        raise CalibrationError(UNDETERMINED)
    half = vectors / np.sqrt(values) * scale[:, None]
    return half @ half.T


UNDETERMINED = ('the views do not determine the cameras: tilt the board by 30 to 50 degrees in '
                'different directions, and let it reach the edges of both images')


class Problem:
    """
    The corners of some views and what they weigh.

    Parameters
    ----------
    model : BoardModel
    corners : dict
        'left' and 'right': Corners.
    count : int
        Number of views.

    """

    def __init__(self, model, corners, count):
        """Begin with the weights that the standard deviations say."""
        self.model = model
        self.corners = corners
        self.count = count
        self.kept = {side: np.ones(len(corners[side].ids), bool) for side in SIDES}
        self.view_weights = np.ones(count)
        self._prior = None

    def prior(self, state):
        """Return the information on each shared value before anything is seen, float64 (n,)."""
        if self._prior is None or self._prior.size != state.shared.size:
            self._prior = np.array(['D[' in name for name in state.parameters.names]
                                   + [False, False]) / WEAK**2
        return self._prior

    def residuals(self, state):
        """Return seen less projected pixels of both cameras, dict of float64 (m, 2)."""
        return {side: seen.pixels - self.model.project(state, side, seen.view, seen.ids)[0]
                for side, seen in self.corners.items()}

    def cost(self, state):
        """Return the sum of the squared weighted residuals."""
        return sum(float((self._weights(side)**2 * (residuals**2).sum(1)).sum())
                   for side, residuals in self.residuals(state).items()) + self._beside(state)

    def _beside(self, state):
        """Return what the prior adds to the sum of squares."""
        return float(self.prior(state) @ state.shared**2)

    def equations(self, state, free):
        """
        Return the normal equations.

        Parameters
        ----------
        state : State
            What is estimated.
        free : numpy.ndarray, bool, shape (n + 2,)
            Which of the shared values are estimated.

        """
        parts = [self._rows(state, side, free) for side in SIDES]
        cost = sum(float((each**2).sum()) for each, _, _ in parts) + self._beside(state)
        number, prior = int(free.sum()), self.prior(state)[free]
        shared, gradient = np.diag(prior), -prior * state.shared[free]
        mixed, poses = np.zeros((self.count, number, 6)), np.zeros((self.count, 6, 6))
        pose_gradients = np.zeros((self.count, 6))
        for side, (residuals, by_shared, by_pose) in zip(SIDES, parts):
            flat = by_shared.reshape(residuals.size, number)
            shared += flat.T @ flat
            gradient += flat.T @ residuals.ravel()
            for view in range(self.count):
                rows = self.corners[side].of_view(view)
                here = by_pose[rows].reshape(-1, 6)
                mixed[view] += by_shared[rows].reshape(len(here), number).T @ here
                poses[view] += here.T @ here
                pose_gradients[view] += here.T @ residuals[rows].ravel()
        derivatives = {side: each for side, (_, *each) in zip(SIDES, parts)}
        return Equations(cost, shared, gradient, mixed, poses, pose_gradients, derivatives)

    def pulls(self, equations, fields):
        """
        Return by what errors of the corners pull the free shared values, poses unknown.

        Parameters
        ----------
        equations : Equations
            Of the solution, with the weights that hold.
        fields : dict
            'left' and 'right': errors of the corners, float64 (m, 2, f), px.

        Returns
        -------
        pulls : numpy.ndarray, float64, shape (k, f)
            Times the covariance of the shared values: by how much the errors move them.

        """
        poses, found = 0.0, 0.0
        for side in SIDES:
            by_shared, by_pose = equations.derivatives[side]
            errors = fields[side] * self._weights(side)[:, None, None]
            found = found + np.einsum('mak,maf->kf', by_shared, errors)
            of_corners = np.einsum('map,maf->mpf', by_pose, errors)
            of_views = np.zeros((self.count, *of_corners.shape[1:]))
            np.add.at(of_views, self.corners[side].view, of_corners)
            poses = poses + of_views
        return found - np.einsum('vkp,vpf->kf', equations.mixed,
                                 np.linalg.solve(equations.poses, poses))

    def _rows(self, state, side, free):
        """Return weighted residuals (m, 2) and derivatives (m, 2, k), (m, 2, 6)."""
        seen = self.corners[side]
        pixels, by_shared, by_pose = self.model.project(state, side, seen.view, seen.ids)
        weights = self._weights(side)
        return ((seen.pixels - pixels) * weights[:, None],
                by_shared[:, :, free] * weights[:, None, None],
                by_pose * weights[:, None, None])

    def _weights(self, side):
        """Return the weight of each corner, 1/px."""
        seen = self.corners[side]
        return self.kept[side] * np.sqrt(self.view_weights[seen.view]) / seen.sigma

    def solved(self, state, free, least_decrease=CONVERGED):
        """
        Return the state with the least sum of squares near another one.

        Parameters
        ----------
        state : State
            What is estimated.
        free : numpy.ndarray, bool, shape (n + 2,)
            Which of the shared values are estimated.
        least_decrease : float
            The search ends when a step gains less.

        """
        damping, least, largest = DAMPING
        equations = self.equations(state, free)
        for _ in range(STEPS):
            tried, gain = self._tried(state, free, equations, damping)
            if gain > 0:
                state, damping = tried, max(damping / 10, least)
                if gain < least_decrease:
                    break
                equations = self.equations(state, free)
            elif abs(gain) < least_decrease or damping > largest:
                break
            else:
                damping *= 10
        return state

    def _tried(self, state, free, equations, damping):
        """Return the state after a step and by how much the sum of squares falls."""
        try:
            change, poses = equations.step(damping)
        except np.linalg.LinAlgError:
            return state, -np.inf
        shared = np.zeros(free.size)
        shared[free] = change
        if not (np.isfinite(change).all() and np.isfinite(poses).all()):
            return state, -np.inf
        tried = state.moved(shared, poses)
        if (tried.translations[:, 2] <= 0).any():
            return state, -np.inf
        gain = equations.cost - self.cost(tried)
        return tried, gain if np.isfinite(gain) else -np.inf
