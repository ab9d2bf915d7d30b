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
"""Which pose of the board helps most next, and how good the calibration will be with it."""

from dataclasses import dataclass

import numpy as np

from .board_model import BoardModel, State
from .least_squares import inverse_information, view_informations
from .rigid import exp
from .views import SIDES
from ..core.cameras.covariance import depth_derivatives, rectified_derivatives
from ..core.cameras.lenses import LENSES

SHARES = (0.4, 0.6, 0.85, 1.2)
"""Widths of the board in the image, image widths; beyond 1 it reaches past the edges."""
PLACES = (0.25, 0.5, 0.75)
"""Middle of the board in the left image, image widths and heights."""
TILTS = (25.0, 40.0, 52.0)
"""Degrees between the board's normal and the ray to its middle."""
DIRECTIONS = 8
"""Of the tilt, around the ray."""
TRIED = 600
"""Poses of the raster of which those that can be detected are kept."""
CANDIDATES = 150
"""Poses that are compared; chosen: more gain a few percent, and take longer."""
GRID = (7, 5)
"""Points of the rectified image where depth and rows are asked for."""
BEYOND = 0.15
"""Of the image: the outer points of the grid keep so much distance from the border."""
DOUBT = {'focal': 0.1, 'center': 0.05, 'coefficient': 0.3, 'rotation': 0.1, 'translation': 0.1,
         'bend': 0.01}
"""Standard deviations before any view: of the focal length, of the width, 1, rad, of the
baseline, of the width of the board."""


@dataclass(frozen=True)
class Detectable:
    """What the detection of a board needs."""

    whole: bool = False
    """Every corner must be inside the image; a chessboard needs that, a ChArUco board not."""
    margin: float = 8.0
    """px between a corner and the border of the image."""
    least_corners: int = 12
    """In each image."""
    least_square: float = 9.0
    """px, the shorter side of a square."""
    steepest: float = 58.0
    """Degrees between the normal of the board and the ray to its middle."""


@dataclass(frozen=True, eq=False)
class Advice:
    """The next pose of the board."""

    rotation: np.ndarray
    """float64 (3, 3): X_left = R X_board + t."""
    translation: np.ndarray
    """float64 (3,), m."""
    outlines: dict
    """'left' and 'right': float64 (4, 2), px: the outer corners of the board, in turn."""
    depth_std: float
    """m, of the depth at the working distance, root mean square over the image, as it is now."""
    expected_depth_std: float
    """m, with this view."""
    rows_std: float
    """px, of the rows, as it is now."""
    expected_rows_std: float
    """px, with this view."""

    @property
    def distance(self):
        """Return the distance from the left camera to the origin of the board, m."""
        return float(np.linalg.norm(self.translation))


@dataclass(frozen=True, eq=False)
class Quality:
    """What the covariance means for depth and rows at the working distance."""

    depth: np.ndarray
    """float64 (k, k): mean square of the depth is the trace of covariance times this, m^2."""
    rows: np.ndarray
    """float64 (k, k), px^2."""

    @classmethod
    def at(cls, calibration, distance):
        """Return the Quality of a StereoCalibration at a distance, m, over the image."""
        points = grid_of(calibration, distance)
        derivatives = (depth_derivatives(calibration, *points),
                       rectified_derivatives(calibration, *points)[0])
        # two columns for the bend of the board, which does not touch the cameras
        padded = [np.pad(each, ((0, 0), (0, 2))) for each in derivatives]
        return cls(*(each.T @ each / len(each) for each in padded))

    def of(self, covariance):
        """Return depth (m) and rows (px), root mean squares, of covariances (..., k, k)."""
        return tuple(np.sqrt(np.einsum('...ij,ij->...', covariance, weights))
                     for weights in (self.depth, self.rows))


def grid_of(calibration, distance):
    """Return x, y, px, and Z, m, of points (P,) all over the rectified left image."""
    geometry = calibration.geometry
    axes = [np.linspace(BEYOND * extent, (1 - BEYOND) * extent - 1, count)
            for extent, count in zip((geometry.width, geometry.height), GRID)]
    x, y = (each.ravel() for each in np.meshgrid(*axes))
    return x, y, np.full(x.size, float(distance))


def first_information(parameters, corners):
    """
    Return what is known before any view, float64 (n + 2, n + 2).

    Parameters
    ----------
    parameters : StereoParameters
        Nominal ones: the data sheet of the lens, the drawing of the rig.
    corners : numpy.ndarray, float64, shape (N, 3)
        m.

    """
    width, baseline = parameters.size[0], np.linalg.norm(parameters.translation)
    lens = [DOUBT['focal'] * parameters.left[0]] * 2 + [DOUBT['center'] * width] * 2 + [
        DOUBT['coefficient']] * (parameters.left.size - 4)
    std = lens * 2 + [DOUBT['rotation']] * 3 + [DOUBT['translation'] * baseline] * 3 + [
        DOUBT['bend'] * np.ptp(corners[:, 0])] * 2
    return np.diag(1 / np.square(std))


class Guide:
    """
    Finds the next pose of a board.

    Parameters
    ----------
    corners : numpy.ndarray, float64, shape (N, 3)
        m, of the flat board.
    distance : float
        Working distance, m: where depth and rows shall be good.
    detectable : Detectable
    sigma : float
        px, of a corner.

    """

    def __init__(self, corners, distance, detectable=None, sigma=0.05):
        """Prepare the model of the board."""
        self.model = BoardModel(corners)
        self.distance = distance
        self.detectable = detectable or Detectable()
        self.sigma = sigma

    def next(self, parameters, information):  # noqa: A003
        """
        Return the next pose.

        Parameters
        ----------
        parameters : StereoParameters
            As they are known.
        information : numpy.ndarray, float64, shape (n + 2, n + 2)
            `Adjustment.information`, or `first_information` before any view.

        Returns
        -------
        advice : Advice or None
            None if no pose of the board can be detected in both images.

        """
        found = self.sequence(parameters, information, 1)
        return found[0] if found else None

    def sequence(self, parameters, information, count):
        """Return that many Advice, each for the time after those before it; see `next`."""
        state, information_of_views = self.candidates(parameters)
        if not len(information_of_views):
            return []
        quality = Quality.at(parameters.calibration(), self.distance)
        before = quality.of(inverse_information(information))
        found = []
        for _ in range(count):
            best = self.best(quality, information, information_of_views)
            information = information + information_of_views[best]
            expected = [float(each) for each in quality.of(inverse_information(information))]
            found.append(self._advice(state.of_views([best]), before, expected))
            before = expected
        return found

    @staticmethod
    def best(quality, information, informations):
        """Return the index of the view after which log depth + log rows is least."""
        depth, rows = quality.of(np.linalg.inv(information + informations))
        return int(np.argmin(np.log(depth) + np.log(rows)))

    def candidates(self, parameters):
        """
        Return poses that can be detected in both images, and what each would tell.

        Returns
        -------
        state : State
        informations : numpy.ndarray, float64, shape (V, n + 2, n + 2)

        """
        rotations, translations = _poses(parameters, self.model.corners)
        state = State(parameters, np.zeros(2), rotations, translations)
        chosen = np.flatnonzero(self._can_be_detected(state))
        if chosen.size > CANDIDATES:
            chosen = chosen[np.linspace(0, chosen.size - 1, CANDIDATES).astype(int)]
        state = state.of_views(chosen)
        if not chosen.size:
            return state, np.zeros((0, state.shared.size, state.shared.size))
        return state, self._informations(state)

    def _can_be_detected(self, state):
        """Return which views of a state both cameras can detect, bool (V,)."""
        possible = np.ones(len(state.rotations), bool)
        for side in SIDES:
            points, normals = _in_camera(self.model, state, side)
            middle = points.mean(1)
            cosine = np.abs((middle * normals).sum(1)) / np.linalg.norm(middle, axis=1)
            focal = getattr(state.parameters, side)[0]
            square = focal * _spacing(self.model.corners) / np.abs(middle[:, 2]) * cosine
            possible &= ((points[:, :, 2] > 0).all(1) & (square >= self.detectable.least_square)
                         & (cosine >= np.cos(np.radians(self.detectable.steepest))))
        chosen = np.flatnonzero(possible)
        if not chosen.size:
            return possible
        least = len(self.model.corners) if self.detectable.whole else min(
            self.detectable.least_corners, len(self.model.corners))
        for side in SIDES:
            pixels = _pixels(self.model, state.of_views(chosen), side)
            possible[chosen] &= self._inside(pixels, state.parameters.size).sum(1) >= least
        return possible

    def _inside(self, pixels, size):
        """Return which pixels (V, N, 2) are inside the image."""
        margin = self.detectable.margin
        return ((pixels >= margin) & (pixels <= np.array(size) - 1 - margin)).all(-1)

    def _projected(self, state, side):
        """Return pixels (V, N, 2) and derivatives (V, 2 N, k), (V, 2 N, 6) of all corners."""
        views, number = len(state.rotations), len(self.model.corners)
        view = np.repeat(np.arange(views), number)
        pixels, by_shared, by_pose = self.model.project(
            state, side, view, np.tile(np.arange(number), views))
        return (pixels.reshape(views, number, 2), by_shared.reshape(views, 2 * number, -1),
                by_pose.reshape(views, 2 * number, 6))

    def _informations(self, state):
        """Return the information of each view, its pose unknown, float64 (V, k, k)."""
        shared, mixed, poses = 0.0, 0.0, 0.0
        for side in SIDES:
            pixels, by_shared, by_pose = self._projected(state, side)
            weights = self._inside(pixels, state.parameters.size) / self.sigma
            weights = np.repeat(weights, 2, axis=1)[:, :, None]
            by_shared, by_pose = by_shared * weights, by_pose * weights
            transposed = np.swapaxes(by_shared, 1, 2)
            shared = shared + transposed @ by_shared
            mixed = mixed + transposed @ by_pose
            poses = poses + np.swapaxes(by_pose, 1, 2) @ by_pose
        return shared - view_informations(mixed, poses)

    def _advice(self, state, before, expected):
        """Return the Advice of a state of one view."""
        model = BoardModel(outline_of(self.model.corners))
        view, ids = np.zeros(4, int), np.arange(4)
        outlines = {side: model.project(state, side, view, ids)[0] for side in SIDES}
        return Advice(state.rotations[0], state.translations[0], outlines,
                      float(before[0]), expected[0], float(before[1]), expected[1])


def outline_of(corners):
    """Return the outer corners of a board, float64 (4, 3), m, in turn."""
    (left, top), (right, bottom) = corners[:, :2].min(0), corners[:, :2].max(0)
    return np.array([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])


def _spacing(corners):
    """Return the least distance between a corner and another one, m."""
    distances = np.linalg.norm(corners[1:] - corners[0], axis=1)
    return distances.min()


def _in_camera(model, state, side):
    """Return corners (V, N, 3), m, and normals (V, 3) of the boards in a raw camera."""
    points = model.corners @ np.swapaxes(state.rotations, 1, 2) + state.translations[:, None]
    normals = state.rotations[:, :, 2]
    if side == 'left':
        return points, normals
    matrix = state.parameters.matrix
    return points @ matrix.T + state.parameters.translation, normals @ matrix.T


def _pixels(model, state, side):
    """Return the pixels (V, N, 2) of all corners, without derivatives."""
    points, _ = _in_camera(model, state, side)
    focal, center, D = np.split(getattr(state.parameters, side), [2, 4])
    rays = (points[:, :, :2] / points[:, :, 2:]).reshape(-1, 2)
    lens = LENSES[state.parameters.distortion_model]
    return (lens.distort(rays, D) * focal + center).reshape(*points.shape[:2], 2)


def _poses(parameters, corners):
    """Return rotations (V, 3, 3) and translations (V, 3) of a raster of poses, mixed."""
    middle = (corners.max(0) + corners.min(0)) / 2
    width = np.ptp(corners[:, 0])
    focal, center = parameters.left[:2], parameters.left[2:4]
    size = np.array(parameters.size)
    places = np.stack(np.meshgrid(PLACES, PLACES), -1).reshape(-1, 2)
    rays = np.column_stack([(places * size - center) / focal, np.ones(len(places))])
    turns = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    depths = focal[0] * width / (np.array(SHARES) * size[0])
    raster = np.meshgrid(depths, np.arange(len(rays)), np.radians(TILTS), turns)
    # A fixed mixture: any part of the list is spread over all kinds of poses.
    order = np.random.default_rng(0).permutation(raster[0].size)[:TRIED]
    depth, place, tilt, direction = (each.ravel()[order] for each in raster)
    rays = rays[place.astype(int)]
    rotations = _tilted(rays, tilt, direction)
    return rotations, depth[:, None] * rays - rotations @ middle


def _tilted(rays, tilt, direction):
    """Return the rotations (V, 3, 3) of boards that are tilted against rays (V, 3)."""
    normal = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    right = np.cross([0.0, 1.0, 0.0], normal)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    facing = np.stack([right, np.cross(normal, right), normal], axis=2)
    axis = np.stack([np.cos(direction), np.sin(direction), np.zeros(len(rays))], axis=1)
    return facing @ exp(tilt[:, None] * axis)
