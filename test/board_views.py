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
"""Simulated corners of a board: exact projections with normal noise."""

from dataclasses import dataclass

from color_stereo_ros.calibration.board_model import BoardModel, State
from color_stereo_ros.calibration.guidance import first_information, grid_of, Guide
from color_stereo_ros.calibration.views import View
from color_stereo_ros.core.cameras.lenses import LENSES
from color_stereo_ros.core.cameras.parameters import StereoParameters
import cv2
import numpy as np

SIZE = (640, 480)
CORNERS = np.stack([*np.meshgrid(0.02 * np.arange(11), 0.02 * np.arange(8)),
                    np.zeros((8, 11))], axis=-1).reshape(-1, 3)
"""m; 12 x 9 squares of 20 mm, on A4."""
TURN = np.radians(15.0)
D = {'plumb_bob': [-0.1, 0.06, 0.0008, -0.0005, 0.01],
     'rational_polynomial': [0.5, 0.05, 0.0005, -0.0003, 0.002, 0.9, 0.15, 0.01],
     'equidistant': [0.03, -0.01, 0.002, -0.0005]}


@dataclass(frozen=True)
class Seen:
    """What a board's detection gives."""

    ids: np.ndarray
    pixels: np.ndarray
    sigma: np.ndarray


def rig(model='plumb_bob', focal=640.0):
    """Return the StereoParameters of a rig: 640 x 480, baseline .2 m, 15 degrees."""
    rotation = np.array([0.004, TURN, -0.003])
    center = np.array([0.2 * np.cos(TURN / 2), 0.001, 0.2 * np.sin(TURN / 2)])
    translation = -cv2.Rodrigues(rotation)[0] @ center
    return StereoParameters(SIZE, model, [focal, focal * 1.002, 322, 236, *D[model]],
                            [focal * 0.995, focal * 0.997, 317, 243,
                             *np.multiply(D[model], 0.95)], rotation, translation)


def middle_of(parameters, distance):
    """Return the point, left camera, at a distance from the rig that both cameras look at."""
    axis = cv2.Rodrigues(parameters.rotation / 2)[0].T @ [0, 0, 1.0]
    center = -parameters.matrix.T @ parameters.translation
    return center / 2 + distance * axis


def random_poses(parameters, count, rng, corners=CORNERS):
    """Return poses as people hold a board: anywhere, tilted a little, seen whole by both."""
    state, found = BoardModel(corners), []
    while len(found) < count:
        tilt = np.radians(rng.uniform(-40, 40, 3) * [1, 1, 0.5])
        rotation = cv2.Rodrigues(tilt)[0]
        place = middle_of(parameters, rng.uniform(0.25, 0.5)) + rng.uniform(-0.06, 0.06, 3)
        pose = rotation, place - rotation @ corners.mean(0)
        if all(inside(project(parameters, state, pose, side)).all()
               for side in ('left', 'right')):
            found.append(pose)
    return found


def inside(pixels, margin=5):
    """Return which pixels (N, 2) lie inside the image."""
    return ((pixels >= margin) & (pixels <= np.array(SIZE) - 1 - margin)).all(1)


def project(parameters, model, pose, side, bend=(0.0, 0.0)):
    """Return the exact pixels of all corners."""
    state = State(parameters, np.asarray(bend), pose[0][None], pose[1][None])
    ids = np.arange(len(model.corners))
    return model.project(state, side, np.zeros(len(ids), int), ids)[0]


def seen(parameters, poses, rng, sigma=0.05, bend=(0.0, 0.0), corners=CORNERS):
    """Return the views of some poses, list of View, with normal noise."""
    model, views = BoardModel(corners), []
    for index, pose in enumerate(poses):
        found = {}
        for side in ('left', 'right'):
            pixels = project(parameters, model, pose, side, bend)
            ids = np.flatnonzero(inside(pixels))
            noisy = pixels[ids] + rng.normal(0, sigma, (ids.size, 2))
            found[side] = Seen(ids, noisy, np.full(ids.size, sigma))
        views.append(View(f'{index:03d}', **found))
    return views


def rectified(calibration, truth, points):
    """Return what a calibration makes of points (N, 3), m, of the true raw left camera."""
    lens = LENSES[truth.distortion_model]
    seen = (lens.project(points, truth.left)[0],
            lens.project(points @ truth.matrix.T + truth.translation, truth.right)[0])
    pixels = []
    for camera, raw in zip((calibration.left, calibration.right), seen):
        rays = lens.undistort(raw, camera.K, camera.D)
        turned = np.column_stack([rays, np.ones(len(rays))]) @ camera.R.T @ camera.P[:, :3].T
        pixels.append(turned[:, :2] / turned[:, 2:])
    return pixels


def guided_poses(parameters, count, corners=CORNERS, distance=0.35, information=None):
    """Return the poses that the guidance asks for, list of (rotation, translation)."""
    if information is None:
        information = first_information(parameters, corners)
    found = Guide(corners, distance).sequence(parameters, information, count)
    return [(advice.rotation, advice.translation) for advice in found]


def points_at(calibration, distance):
    """Return points (P, 3), m, of a flat target, in the physical left camera of a calibration."""
    geometry = calibration.geometry
    x, y, Z = grid_of(calibration, distance)
    return np.stack([(x - geometry.center_x_left) / geometry.focal_x * Z,
                     (y - geometry.center_y) / geometry.focal_y * Z, Z], 1) @ calibration.left.R


def rows_and_depth_errors(calibration, truth, distance=0.35):
    """Return errors of rows, px, and depth, m, of a flat target, both float64 (P,)."""
    points = points_at(truth.calibration(), distance)
    left, right = rectified(calibration, truth, points)
    geometry = calibration.geometry
    depth = geometry.focal_baseline / (left[:, 0] - right[:, 0] - geometry.principal_offset)
    return left[:, 1] - right[:, 1], depth - (points @ calibration.left.R.T)[:, 2]


def errors_of(adjustment, truth, distance=0.35):
    """Return errors of focal length and baseline, 1, rows, px, and depth, m, RMS, (4,)."""
    found = adjustment.parameters
    focal = np.concatenate([found.left[:2] / truth.left[:2], found.right[:2] / truth.right[:2]])
    baseline = np.linalg.norm(found.translation) / np.linalg.norm(truth.translation)
    rows, depth = rows_and_depth_errors(adjustment.calibration, truth, distance)
    return np.array([rms(focal - 1), baseline - 1, rms(rows), rms(depth)])


def modes(covariance, weights):
    """Return how many independent normal errors x^T W x of a covariance is worth."""
    product = covariance @ weights
    return np.trace(product)**2 / np.trace(product @ product)


def rms(values, axis=None):
    """Return the root mean square."""
    return np.sqrt(np.mean(np.square(values), axis))


def mrcal_views(seed, count=15):
    """
    Return random views as mrcal takes them, and a start near the truth.

    Returns
    -------
    observations : numpy.ndarray, float64, shape (V, 2, 8, 11, 3)
        Pixels and weight.
    start : numpy.ndarray, float64, shape (24 + 6 V,)

    """
    truth, rng = rig(), np.random.default_rng(seed)
    poses = random_poses(truth, count, rng)
    views = seen(truth, poses, rng)
    pixels = np.array([[getattr(view, side).pixels for side in ('left', 'right')]
                       for view in views])
    observations = np.ones((count, 2, 8, 11, 3))
    observations[..., :2] = pixels.reshape(count, 2, 8, 11, 2)
    frames = [np.concatenate([cv2.Rodrigues(rotation)[0].ravel(), translation])
              for rotation, translation in poses]
    return observations, np.concatenate([truth.vector, *frames])
