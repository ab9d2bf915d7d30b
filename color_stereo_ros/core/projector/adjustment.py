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
"""
Bundle adjustment: the geometry that explains matches best, with priors and covariance.

The residual of a match is a pair of numbers, px of the pattern. Its covariance has two parts:
that of the match, and that of the stereo depth of the point, which moves the prediction along a
line:

    C = sigma^2 I + g g' sigma_Z^2,      g = d(u, v) / dZ along the ray of the left camera

Stereo depth has slow errors, too, alike over large parts of the image. A few modes of them are
unknowns beside those of the projector, with a prior of one standard deviation each.

The unknowns are dimensionless or small: see `UNKNOWNS`. All sizes of the pattern count in widths
of it.

"""

from dataclasses import dataclass

import cv2
import numpy as np

from .model import COUNT, ProjectorModel
from .tuning import TUNING

UNKNOWNS = ('log focal', 'log aspect', 'skew', 'center u', 'center v', 'k1',
            'rotation x', 'rotation y', 'rotation z',
            'translation x', 'translation y', 'translation z')
"""log(fx / W), log(fy / fx), s / fx, cu / W, cv / W, k1, small turn in rad, translation in m."""

LENS = slice(0, 6)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Points with known places in the pattern."""

    points: np.ndarray
    """float64 (N, 3), m, rectified left camera."""
    places: np.ndarray
    """float64 (N, 2), column and row of the pattern, px."""
    sigma: np.ndarray
    """float64 (N,), standard deviation of the places along either axis, px."""
    depth_std: np.ndarray
    """float64 (N,), standard deviation of Z, m, independent from point to point."""
    modes: np.ndarray
    """float64 (N, M), m: how Z changes with slow errors of the depth, one standard deviation."""

    def __len__(self):
        """Return the number of points."""
        return len(self.points)

    def only(self, chosen):
        """Return some of the points, by a mask or by numbers."""
        return Evidence(self.points[chosen], self.places[chosen], self.sigma[chosen],
                        self.depth_std[chosen], self.modes[chosen])


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the unknowns before the evidence: a Gaussian."""

    mean: np.ndarray
    """float64 (6,), of the lens; that of the translation is 0, any rotation is as likely."""
    information: np.ndarray
    """float64 (12, 12), inverse of the covariance; 0 = free."""


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The outcome of an adjustment."""

    model: ProjectorModel
    cost: float
    """Half the sum of the robust squares and of the prior's, in standard deviations."""
    agree: np.ndarray
    """bool (N,), matches that agree."""
    scale: float
    """Robust standard deviation of the whitened residuals, 1 where sigma is right."""


FREEDOMS = {'distorted': (5,), 'cropped': (3,), 'stretched': (1,), 'keystoned': (1, 2, 3)}
"""What a prior may be freed of: radial distortion; column of the center; aspect; all of these."""


def usual_prior(size, depth):
    """
    Return what is known of any projector.

    Parameters
    ----------
    size : (int, int)
        Width and height of the pattern, px.
    depth : float
        Median depth of the scene, m.

    Returns
    -------
    prior : Prior

    """
    width, height = size
    tuning = TUNING.prior
    focal = 0.5 / np.tan(np.radians(tuning.field_of_view) / 2)
    mean = np.array([np.log(focal), 0.0, 0.0, (width - 1) / 2 / width, (height - 1) / 2 / width,
                     0.0])
    spread = np.array([tuning.focal_std, tuning.square_std, tuning.square_std,
                       tuning.column_std, tuning.row_std * height / width, tuning.straight_std])
    information = np.zeros((COUNT, COUNT))
    information[LENS, LENS] = np.diag(spread ** -2.0)
    information[6:9, 6:9] = np.eye(3) / np.pi ** 2  # any rotation
    information[9:12, 9:12] = np.eye(3) / (tuning.distance_std * depth) ** 2
    return Prior(mean, information)


def loosened(prior, kind):
    """Return a prior that knows less of the lens; kind: a key of FREEDOMS."""
    spread = TUNING.prior.distortion_std if kind == 'distorted' else TUNING.prior.loose_std
    information = prior.information.copy()
    for each in FREEDOMS[kind]:
        information[each, :] = information[:, each] = 0
        information[each, each] = spread ** -2
    return Prior(prior.mean, information)


def free_prior():
    """Return that nothing is known."""
    return Prior(np.zeros(6), np.zeros((COUNT, COUNT)))


def carried_prior(earlier, depth):
    """
    Return what an earlier pair tells: the lens of the projector, which may have moved.

    Parameters
    ----------
    earlier : ProjectorModel
        Of an earlier pair.
    depth : float
        Median depth of the scene, m.

    Returns
    -------
    prior : Prior

    """
    tuning = TUNING.prior
    covariance = tuning.inflation * to_unknowns(earlier)[LENS, LENS]
    covariance += np.eye(len(covariance)) * tuning.drift ** 2
    information = usual_prior(earlier.size, depth).information.copy()
    information[LENS, LENS] = np.linalg.inv(covariance)
    return Prior(lens_of(earlier), information)


def lens_of(model):
    """Return the first six unknowns of a model, float64 (6,)."""
    width = model.size[0]
    (fx, skew, cu), (_, fy, cv), _ = model.camera_matrix
    return np.array([np.log(fx / width), np.log(fy / fx), skew / fx, cu / width, cv / width,
                     model.distortion])


def model_of(lens, rotation, translation, size):
    """Return the ProjectorModel of unknowns and a pose, without covariance."""
    width = size[0]
    fx = width * np.exp(lens[0])
    K = [[fx, fx * lens[2], width * lens[3]], [0, fx * np.exp(lens[1]), width * lens[4]],
         [0, 0, 1]]
    return ProjectorModel(K, float(lens[5]), rotation, translation, size,
                          np.zeros((COUNT, COUNT)))


def to_parameters(model):
    """Return the Jacobian of `model.PARAMETERS` by the unknowns, float64 (12, 12)."""
    width = model.size[0]
    (fx, skew, _), (_, fy, _), _ = model.camera_matrix
    jacobian = np.eye(COUNT)
    jacobian[0, 0] = fx
    jacobian[1, :2] = fy
    jacobian[2, 0], jacobian[2, 2] = skew, fx
    jacobian[3, 3] = jacobian[4, 4] = width
    return jacobian


def to_unknowns(model):
    """Return the covariance of the unknowns of a model, float64 (12, 12)."""
    inverse = np.linalg.inv(to_parameters(model))
    return inverse @ model.covariance @ inverse.T


def predicted(model, points):
    """
    Return the places of points and how they depend on unknowns and depth.

    Parameters
    ----------
    model : ProjectorModel
        Geometry of the projector.
    points : numpy.ndarray, float64, shape (N, 3)
        m, rectified left camera.

    Returns
    -------
    places : numpy.ndarray, float64, shape (N, 2)
        px.
    jacobian : numpy.ndarray, float64, shape (N, 2, 12)
        By the unknowns.
    along : numpy.ndarray, float64, shape (N, 2)
        By Z along the ray of the left camera, px / m.
    ahead : numpy.ndarray, bool, shape (N,)
        Points in front of the projector.

    """
    turned = points @ model.rotation.T
    local = turned + model.translation
    ahead = local[:, 2] > TUNING.adjustment.nearest
    depth = np.where(ahead, local[:, 2], 1.0)
    x, y = local[:, 0] / depth, local[:, 1] / depth
    (fx, skew, cu), (_, fy, cv), _ = model.camera_matrix
    square = x * x + y * y
    k1 = model.distortion
    q = 1 + k1 * square
    a, b = fx * x + skew * y, fy * y
    places = np.stack([a * q + cu, b * q + cv], axis=-1)
    by_local = np.empty((len(points), 2, 3))
    for row, (value, by_x, by_y) in enumerate(((a, fx, skew), (b, 0.0, fy))):
        du_dx = by_x * q + value * 2 * k1 * x
        du_dy = by_y * q + value * 2 * k1 * y
        by_local[:, row, 0] = du_dx / depth
        by_local[:, row, 1] = du_dy / depth
        by_local[:, row, 2] = -(du_dx * x + du_dy * y) / depth
    jacobian = np.zeros((len(points), 2, COUNT))
    jacobian[:, 0, 0], jacobian[:, 1, 0] = a * q, b * q
    jacobian[:, 1, 1] = b * q
    jacobian[:, 0, 2] = fx * y * q
    jacobian[:, 0, 3] = jacobian[:, 1, 4] = model.size[0]
    jacobian[:, 0, 5], jacobian[:, 1, 5] = a * square, b * square
    # Y' = exp([w]x) R X + t: dY/dw = -[R X]x
    for row in (0, 1):
        jacobian[:, row, 6:9] = crossed(turned, by_local[:, row])
    jacobian[:, :, 9:12] = by_local
    along = np.einsum('nij,nj->ni', by_local, turned / points[:, 2:3])
    return places, jacobian, along, ahead


def crossed(one, other):
    """Return the cross products of vectors (N, 3); NumPy takes three times as long."""
    return np.stack([one[:, (axis + 1) % 3] * other[:, (axis + 2) % 3]
                     - one[:, (axis + 2) % 3] * other[:, (axis + 1) % 3] for axis in range(3)],
                    axis=-1)


def moved(model, step):
    """Return a model after a step of the unknowns."""
    turn = cv2.Rodrigues(step[6:9])[0]
    return model_of(lens_of(model) + step[LENS], turn @ model.rotation,
                    model.translation + step[9:12], model.size)


def apart(prior, model):
    """Return how far the unknowns of a model lie from a prior, float64 (12,)."""
    away = np.zeros(COUNT)
    away[LENS] = lens_of(model) - prior.mean
    away[9:12] = model.translation  # as long as the way from the left camera to the projector
    return away


def whitened(evidence, model, slow):
    """
    Return residuals and their Jacobian in standard deviations.

    Parameters
    ----------
    evidence : Evidence
        Where the patches of the pattern were found.
    model : ProjectorModel
        Geometry of the projector.
    slow : numpy.ndarray, float64, shape (M,)
        The modes of the depth, standard deviations.

    Returns
    -------
    residual : numpy.ndarray, float64, shape (N, 2)
    jacobian : numpy.ndarray, float64, shape (N, 2, 12 + M)
        By the unknowns and the modes.

    """
    places, jacobian, along, ahead = predicted(model, evidence.points)
    by_modes = along[:, :, None] * evidence.modes[:, None]
    residual = evidence.places - places - by_modes @ slow
    residual[~ahead] = TUNING.adjustment.behind
    jacobian = np.concatenate([jacobian, by_modes], axis=2)
    jacobian[~ahead] = 0
    # Cholesky factor of C = sigma^2 I + g g' sigma_Z^2, whose inverse makes the residuals white
    g = along * evidence.depth_std[:, None]
    variance = evidence.sigma ** 2
    first = np.sqrt(variance + g[:, 0] ** 2)
    mixed = g[:, 0] * g[:, 1] / first
    least = TUNING.adjustment.rounding * variance
    second = np.sqrt(np.maximum(variance + g[:, 1] ** 2 - mixed ** 2, least))
    residual[:, 0] /= first
    residual[:, 1] = (residual[:, 1] - mixed * residual[:, 0]) / second
    jacobian[:, 0] /= first[:, None]
    jacobian[:, 1] = (jacobian[:, 1] - mixed[:, None] * jacobian[:, 0]) / second[:, None]
    return residual, jacobian


@dataclass(frozen=True, eq=False)
class State:
    """A model, the modes, and what the evidence says of them."""

    model: ProjectorModel
    slow: np.ndarray
    """float64 (M,), the modes, standard deviations."""
    residual: np.ndarray
    """float64 (N, 2), see `whitened`."""
    jacobian: np.ndarray
    """float64 (N, 2, 12 + M)."""

    @classmethod
    def of(cls, evidence, model, slow=None):
        """Return that of a model under some modes; None: there are no slow errors."""
        slow = np.zeros(evidence.modes.shape[1]) if slow is None else slow
        return cls(model, slow, *whitened(evidence, model, slow))

    def cost(self, width, prior):
        """Return half the sum of the robust squares and of the priors'."""
        bound = (TUNING.adjustment.outlier * width) ** 2
        away = apart(prior, self.model)
        robust = bound * np.log1p(_square(self.residual) / bound)
        return 0.5 * float(np.sum(robust) / width ** 2 + away @ prior.information @ away
                           + self.slow @ self.slow)

    def equations(self, width, prior):
        """Return the matrix and the right side of a step of unknowns and modes."""
        weight = 1 / (1 + _square(self.residual) / (TUNING.adjustment.outlier * width) ** 2)
        count = self.jacobian.shape[2]
        rows = self.jacobian.reshape(-1, count)
        weighted = rows * np.repeat(weight / width ** 2, 2)[:, None]
        sums = products(weighted, np.column_stack([rows, self.residual.ravel()]))
        normal, moment = np.ascontiguousarray(sums[:, :-1]), sums[:, -1]
        normal[:COUNT, :COUNT] += prior.information
        moment[:COUNT] -= prior.information @ apart(prior, self.model)
        normal[range(COUNT, count), range(COUNT, count)] += 1
        moment[COUNT:] -= self.slow
        return normal, moment


def products(one, other):
    """
    Return one' other of tall matrices (N, A) and (N, B).

    In blocks so small that no BLAS starts threads: these cost more than they save.

    """
    block = TUNING.adjustment.block
    whole = len(one) // block * block
    first, second = (each[:whole].reshape(-1, block, each.shape[1]) for each in (one, other))
    return (np.matmul(first.transpose(0, 2, 1), second).sum(axis=0)
            + one[whole:].T @ other[whole:])


def adjust(start, evidence, prior, rounds=None, scale=None):
    """
    Fit a model to evidence, some of which is wrong.

    Levenberg and Marquardt's method on reweighted least squares with Cauchy's weights. The scale
    of the weights falls from round to round, so that the start may be poor.

    Parameters
    ----------
    start : ProjectorModel
        Where the adjustment begins.
    evidence : Evidence
        Where the patches of the pattern were found.
    prior : Prior
        What is known before.
    rounds : int, optional
        Largest number of steps.
    scale : float, optional
        Of the residuals in standard deviations; measured from them if not given.

    Returns
    -------
    adjusted : Adjusted

    """
    tuning = TUNING.adjustment
    now = State.of(evidence, start)
    damping, width = tuning.damping, scale or robust_scale(now.residual)
    cost = now.cost(width, prior)
    for _ in range(rounds or tuning.rounds):
        normal, moment = now.equations(width, prior)
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), moment)
        tried = State.of(evidence, moved(now.model, step), now.slow + step[COUNT:])
        gained = cost - tried.cost(width, prior)
        if gained < -tuning.rounding * cost:
            damping = max(10 * damping, tuning.damping)
            if damping > tuning.largest_damping:
                break
            continue
        now, damping = tried, damping / 10
        narrowed = min(width, scale or robust_scale(now.residual))
        settled = narrowed > tuning.settled * width
        width = narrowed
        cost = now.cost(width, prior)
        if settled and gained < tuning.least_gain:
            break
    return _finished(now, width, prior, cost)


def _finished(state, width, prior, cost):
    covariance = np.linalg.inv(state.equations(width, prior)[0])[:COUNT, :COUNT]
    agree = _square(state.residual) < (TUNING.adjustment.gate * width) ** 2
    convert = to_parameters(state.model)
    model = state.model.but(covariance=convert @ covariance @ convert.T,
                            matches=int(np.count_nonzero(agree)))
    return Adjusted(model, cost, agree, width)


def robust_scale(residual):
    """Return the standard deviation of residuals (N, 2) that half of them stay within, >= 1."""
    # Rayleigh: half of the squares lie below 2 log 2
    return max(1.0, float(np.sqrt(np.median(_square(residual)) / (2 * np.log(2)))))


def _square(residual):
    return np.einsum('ni,ni->n', residual, residual)
