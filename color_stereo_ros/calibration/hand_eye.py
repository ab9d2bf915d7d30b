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
Hand-eye calibration: where the camera sits on the flange, or beside the robot.

    Z = G X B        G: pose of the flange in the base (eye in hand), or its inverse (eye to hand)
                     X: the camera in the flange (in hand) or in the base (to hand): wanted
                     B: the board in the camera, from its corners
                     Z: the board in the base (in hand) or in the flange (to hand): found as well

The start is the closed form of Park and Martin (1994), and OpenCV's solvers where its build has
them. X and Z are then refined together: each pose of the robot has noise in position and in
rotation, each pose of the board that of its corners. Where the noise of the robot is not given, it
is estimated from the residuals (restricted maximum likelihood), so that the standard deviations
hold for any robot. Poses that do not fit are left out, by name.

"""

from dataclasses import dataclass

import numpy as np

from . import hand_eye_causes as causes
from .hand_eye_start import starts
from .rigid import inverse, log, moved, product
from ..errors import CalibrationError

IN_HAND, TO_HAND = 'eye-in-hand', 'eye-to-hand'
MOUNTINGS = IN_HAND, TO_HAND
LEAST = 4  # poses; derived: three fix X and Z, the fourth tells whether they are right
FEW = 8  # poses; chosen: with fewer the noise of the robot is known to 20 % at best
ROUNDS = 20  # of weights and steps; chosen: eight suffice
STEP = 1e-6  # rad and m
DONE = 1e-9  # rad and m
ROUGH = 1e-6  # rad and m, enough to tell which poses fit
MEDIAN = 2.366  # median of chi square with 3 degrees of freedom
OUTLIER = 27.86  # chi square with 6 degrees of freedom that one pose in 10,000 exceeds
SMALL_SAMPLE = 10.0  # chosen: the robust scale of n poses is uncertain; limit times 1 + 10 / n
MOST_OUTLIERS = 1 / 3  # of the poses; chosen: with more nobody knows which ones are right
LARGEST_NOISE = 0.01, np.radians(2.0)  # m, rad; chosen: ten times that of a bad robot
LEAST_NOISE = 1e-7, 1e-7  # m, rad; chosen: below it a pose has no noise


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of the flange and of the board, which belong together one by one."""

    names: tuple
    """n texts, for example names of image files."""
    flange: tuple
    """(R, t) of base_from_flange, float64 (n, 3, 3) and (n, 3), m."""
    board: tuple
    """(R, t) of camera_from_board, float64 (n, 3, 3) and (n, 3), m."""
    covariance: np.ndarray
    """float64 (n, 6, 6) of the poses of the board, see `BoardPose.covariance`."""

    def __len__(self):
        return len(self.names)

    def chosen(self, keep):
        """Return some of the poses, by a bool array or by indices."""
        at = np.flatnonzero(keep) if np.asarray(keep).dtype == bool else np.asarray(keep)
        return Poses(tuple(self.names[k] for k in at), tuple(part[at] for part in self.flange),
                     tuple(part[at] for part in self.board), self.covariance[at])


@dataclass(frozen=True, eq=False)
class HandEye:
    """The result of a hand-eye calibration."""

    mounting: str
    """One of `MOUNTINGS`."""
    camera: tuple
    """(R, t) of flange_from_camera (in hand) or base_from_camera (to hand), t in m."""
    board: tuple
    """(R, t) of base_from_board (in hand) or flange_from_board (to hand)."""
    covariance: np.ndarray
    """float64 (6, 6) of the camera's (w, d): exp(w) R and t + d; rad and m."""
    robot_noise: tuple
    """Standard deviations of one coordinate of a pose: position in m, rotation in rad."""
    names: tuple
    """Names of all n poses."""
    used: np.ndarray
    """bool (n,): False = left out, because the pose does not fit the others."""
    position: np.ndarray
    """float64 (n, 3), m: measured minus predicted position of the flange, in the base."""
    rotation: np.ndarray
    """float64 (n, 3), rad: the same for its rotation."""
    doubts: tuple
    """Sentences for people, what should be looked after; empty if nothing."""

    @property
    def position_std(self):
        """Return the standard deviations of the camera's x, y, z, float64 (3,), m."""
        return np.sqrt(np.diag(self.covariance)[3:])

    @property
    def rotation_std(self):
        """Return those of its rotation about x, y, z of the parent frame, float64 (3,), rad."""
        return np.sqrt(np.diag(self.covariance)[:3])

    @property
    def dropped(self):
        """Return the names of the poses that were left out."""
        return tuple(name for name, used in zip(self.names, self.used) if not used)


def hand_eye(poses, mounting=IN_HAND, robot_noise=None):
    """
    Calibrate where the camera is on the robot, or beside it.

    Parameters
    ----------
    poses : Poses
        Four or more, which turn about two axes or more. Twelve are good.
    mounting : str
        'eye-in-hand': the camera moves with the flange; 'eye-to-hand': the board does.
    robot_noise : (float, float), optional
        Standard deviation of one coordinate of the robot's position, m, and rotation, rad. None:
        estimated.

    Returns
    -------
    found : HandEye

    Raises
    ------
    CalibrationError
        If there are too few poses, they do not turn enough or about one axis only, or the two
        lists do not fit each other; says what is probably wrong.

    """
    if mounting not in MOUNTINGS:
        raise CalibrationError(f'mounting = {mounting!r} is none of {", ".join(MOUNTINGS)}')
    causes.check_motion(poses, LEAST)
    solution, keep = _robust(poses, mounting)
    if solution is None or _is_bad(solution.noise) or keep.mean() < 1 - MOST_OUTLIERS:
        raise CalibrationError(causes.likely(poses, mounting, fits=_fits))
    solution = _settled(poses.chosen(keep), mounting, solution, robot_noise)
    residuals = _residuals(poses, mounting, solution.camera, solution.board)
    doubts = causes.doubts(poses.chosen(keep), solution, FEW, robot_noise is not None)
    return HandEye(mounting, solution.camera, solution.board, solution.covariance[:6, :6],
                   solution.noise, poses.names, keep, residuals[:, 3:], residuals[:, :3],
                   tuple(doubts))


@dataclass(frozen=True, eq=False)
class Solution:
    """X and Z, and how well they are known."""

    camera: tuple
    board: tuple
    noise: tuple
    """Of the robot: m, rad."""
    covariance: np.ndarray = None
    """float64 (12, 12): rotation and position of the camera, then of the board."""
    chi: float = float('nan')
    """Weighted squares of the residuals over their degrees of freedom; 1 = as expected."""
    scale: tuple = (1.0, float('inf'))
    """True over stated size of the board, and its standard deviation."""


def _is_bad(noise):
    return noise[0] > LARGEST_NOISE[0] or noise[1] > LARGEST_NOISE[1]


def _fits(poses, mounting):
    """Return whether poses fit each other under a mounting."""
    solution, keep = _robust(poses, mounting)
    return (solution is not None and not _is_bad(solution.noise)
            and keep.mean() >= 1 - MOST_OUTLIERS)


def _robust(poses, mounting):
    """Return a Solution by the poses that agree, and which these are, bool (n,)."""
    best, least = None, np.inf
    for camera, board in starts(poses, mounting == IN_HAND):
        noise = _robust_noise(_residuals(poses, mounting, camera, board))
        if noise[0] / LARGEST_NOISE[0] + noise[1] / LARGEST_NOISE[1] < least:
            least = noise[0] / LARGEST_NOISE[0] + noise[1] / LARGEST_NOISE[1]
            best = Solution(camera, board, noise)
    if best is None:
        return None, np.zeros(len(poses), bool)
    keep = np.ones(len(poses), bool)
    for _ in range(ROUNDS):
        best, step = _stepped(poses, mounting, best, robust=True)
        residuals = _residuals(poses, mounting, best.camera, best.board)
        best = Solution(best.camera, best.board, _robust_noise(residuals))
        if np.abs(step).max() < ROUGH:
            break
    distances = _distances(poses, mounting, best)
    keep = distances < OUTLIER * (1 + SMALL_SAMPLE / len(poses))
    return best, keep


def _robust_noise(residuals):
    """Return the standard deviations of position and rotation that half the poses show."""
    squares = [np.sum(residuals[:, part] ** 2, axis=1) for part in (slice(3, 6), slice(3))]
    return tuple(max(np.sqrt(np.median(each) / MEDIAN), least)
                 for each, least in zip(squares, LEAST_NOISE))


def _settled(poses, mounting, solution, given):
    """Return the Solution of weighted least squares, the robot's noise given or estimated."""
    if given is not None:
        solution = Solution(solution.camera, solution.board, tuple(given))
    for _ in range(ROUNDS):
        solution, step = _stepped(poses, mounting, solution, estimate=given is None)
        if np.abs(step).max() < DONE:
            break
    return _with_scale(poses, mounting, solution)


def _stepped(poses, mounting, solution, robust=False, estimate=False):
    """Return the Solution after one step of Gauss and Newton, and the step (12,)."""
    residuals, jacobian, boards = _linearized(poses, mounting, solution)
    known = boards @ poses.covariance @ boards.transpose(0, 2, 1)
    noise = solution.noise
    spread = _spread(known, noise)
    weights = np.linalg.inv(spread)
    if robust:
        distances = np.einsum('ni,nij,nj->n', residuals, weights, residuals)
        weights = weights / (1 + distances / OUTLIER)[:, None, None]
    normal = np.einsum('nia,nij,njb->ab', jacobian, weights, jacobian)
    covariance = np.linalg.pinv(normal, hermitian=True)
    step = -covariance @ np.einsum('nia,nij,nj->a', jacobian, weights, residuals)
    step *= min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))
    left = residuals + jacobian @ step
    chi = np.einsum('ni,nij,nj', left, weights, left) / max(6 * len(poses) - 12, 1)
    if estimate:
        noise = _restricted(left, jacobian, known, noise)
    return Solution(moved(solution.camera, step[:6]), moved(solution.board, step[6:]), noise,
                    covariance, float(chi)), step


def _spread(known, noise):
    """Return the covariances (n, 6, 6) of the residuals of poses."""
    robot = np.diag(np.repeat([noise[1] ** 2, noise[0] ** 2], 3))
    return known + robot


def _restricted(residuals, jacobian, known, noise):
    """
    Return the robot's noise after one step of Fisher scoring of the restricted likelihood.

    The residuals have the covariance V = known + sum of theta_k V_k, with one theta for rotation
    and one for position (Patterson and Thompson 1971).

    """
    count = len(residuals)
    wide = np.zeros((6 * count, 6 * count))
    for k, block in enumerate(_spread(known, noise)):
        wide[6 * k:6 * k + 6, 6 * k:6 * k + 6] = np.linalg.inv(block)
    J, r = jacobian.reshape(-1, 12), residuals.ravel()
    seen = wide @ J
    P = wide - seen @ np.linalg.pinv(J.T @ seen, hermitian=True) @ seen.T
    parts = [np.tile(np.repeat(part, 3), count) for part in ([1.0, 0.0], [0.0, 1.0])]
    Pr = P @ r
    score = [Pr @ (part * Pr) - np.sum(part * np.diag(P)) for part in parts]
    fisher = [[one @ (P * P) @ other for other in parts] for one in parts]
    change = np.linalg.lstsq(np.array(fisher), np.array(score), rcond=None)[0]
    squares = np.square([noise[1], noise[0]])
    squares = np.clip(squares + change, squares / 9, squares * 9)
    turn, place = np.sqrt(np.maximum(squares, np.square([LEAST_NOISE[1], LEAST_NOISE[0]])))
    return float(place), float(turn)


def _with_scale(poses, mounting, solution):
    """Return the Solution with the scale of the board that the robot's way would ask for."""
    residuals, jacobian, boards = _linearized(poses, mounting, solution)
    known = boards @ poses.covariance @ boards.transpose(0, 2, 1)
    weights = np.linalg.inv(_spread(known, solution.noise))
    column = np.einsum('nij,nj->ni', boards[..., 3:], poses.board[1])
    wide = np.concatenate([jacobian, column[..., None]], axis=2)
    normal = np.einsum('nia,nij,njb->ab', wide, weights, wide)
    covariance = np.linalg.pinv(normal, hermitian=True)
    step = -covariance @ np.einsum('nia,nij,nj->a', wide, weights, residuals)
    return Solution(solution.camera, solution.board, solution.noise, solution.covariance,
                    solution.chi, (1 + float(step[12]), float(np.sqrt(covariance[12, 12]))))


def _distances(poses, mounting, solution):
    """Return the squared Mahalanobis distances (n,) of the poses from their prediction."""
    residuals, _, boards = _linearized(poses, mounting, solution)
    known = boards @ poses.covariance @ boards.transpose(0, 2, 1)
    weights = np.linalg.inv(_spread(known, solution.noise))
    return np.einsum('ni,nij,nj->n', residuals, weights, residuals)


def _linearized(poses, mounting, solution):
    """Return residuals (n, 6), Jacobians (n, 6, 12) of X and Z and (n, 6, 6) of the boards."""
    steps = STEP * np.concatenate([np.eye(6), -np.eye(6)])
    many = steps[:, None]  # one pose each step, over all views

    def columns(residuals):
        ahead, back = np.split(residuals, 2)
        return np.moveaxis((ahead - back) / (2 * STEP), 0, 2)

    X, Z = solution.camera, solution.board
    by_x = columns(_residuals(poses, mounting, moved(X, many), Z))
    by_z = columns(_residuals(poses, mounting, X, moved(Z, many)))
    by_board = columns(_residuals(poses, mounting, X, Z, moved(poses.board, many)))
    return (_residuals(poses, mounting, X, Z), np.concatenate([by_x, by_z], axis=2), by_board)


def _residuals(poses, mounting, camera, board, seen=None):
    """Return measured minus predicted poses of the flange, (..., n, 6): rotation, position."""
    predicted = product(board, inverse(product(camera, poses.board if seen is None else seen)))
    R, t = predicted if mounting == IN_HAND else inverse(predicted)
    turn = log(np.swapaxes(R, -1, -2) @ poses.flange[0])
    return np.concatenate([turn, poses.flange[1] - t], axis=-1)


def in_rectified(motion, calibration):
    """Return the pose of the rectified left camera where that of the physical one is given."""
    R, t = motion
    return R @ calibration.left.R.T, t


def as_millimeters(vectors):
    """Return lengths (n,) in mm of vectors (n, 3) in m."""
    return 1e3 * np.linalg.norm(vectors, axis=-1)


def as_degrees(vectors):
    """Return angles (n,) in degrees of rotation vectors (n, 3) in rad."""
    return np.degrees(np.linalg.norm(vectors, axis=-1))
