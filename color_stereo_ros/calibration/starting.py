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
"""First guesses of cameras and poses, from which the adjustment converges."""

import cv2
import numpy as np

from .board_model import State
from .views import SIDES
from ..core.cameras.lenses import LENSES
from ..core.cameras.parameters import StereoParameters
from ..errors import CalibrationError

FOCAL_LENGTHS = np.geomspace(0.3, 4.0, 10)
"""In widths of the image; chosen: lenses of 14 to 118 degrees."""
COEFFICIENTS = {'plumb_bob': 5, 'rational_polynomial': 8}
"""Distortion coefficients that are estimated; of another model all that it has."""
LARGEST_ERROR = 0.05
"""Of the image width: of the first guess in the middle view; chosen: a distorted lens needs it."""
NOT_TOGETHER = 'Did a camera move between the views, or are the pairs not synchronous?'
TRIED_VIEWS = 10
"""Views by which the focal length is chosen; chosen: more only cost time."""


def first_state(size, model, corners, views):
    """
    Return a State near the solution.

    Parameters
    ----------
    size : (int, int)
        Width and height, px.
    model : str
        Distortion model.
    corners : numpy.ndarray, float64, shape (N, 3)
        m, of the flat board.
    views : list of View
        Of which some are seen by both cameras.

    Raises
    ------
    CalibrationError
        If no pose of the board explains what was seen.

    """
    lenses = {side: _focal_length(size, model, corners, views, side) for side in SIDES}
    found = [{side: _poses(model, lenses[side], corners, getattr(view, side))
              for side in SIDES if view.seen(side)} for view in views]
    motions = [_motion(pose['left'][0], pose['right'][0]) for pose in found
               if pose.get('left') and pose.get('right')]
    if not motions:
        raise CalibrationError('no pose of the board explains the corners of any pair: are the '
                               'corners of both cameras numbered alike?')
    rotation, translation = _middle(motions)
    coefficients = np.zeros(COEFFICIENTS.get(model, LENSES[model].lengths[-1]))
    parameters = StereoParameters(size, model, np.concatenate([lenses['left'], coefficients]),
                                  np.concatenate([lenses['right'], coefficients]),
                                  rotation, translation)
    state = _with_poses(parameters, np.zeros(2), corners, views, found)
    _check_motion(state, corners, views)
    return state


def _check_motion(state, corners, views):
    """Refuse pairs that agree on no motion from one camera to the other."""
    errors = [_pair_error(state.parameters, corners, view, *pose) for view, pose in
              zip(views, zip(state.rotations, state.translations)) if view.is_pair]
    limit = LARGEST_ERROR * state.parameters.size[0]
    if np.median(errors) > limit:
        raise CalibrationError(
            f'the views do not fit together: in the middle one of {len(errors)} pairs the corners '
            f'lie {np.median(errors):.0f} px from where the other pairs put them, expected less '
            f'than {limit:.0f} px. {NOT_TOGETHER}')


def state_of(parameters, bend, corners, views):
    """Return the State of views that known cameras see; see `first_state`."""
    found = [{side: _poses(parameters.distortion_model, getattr(parameters, side), corners,
                           getattr(view, side)) for side in SIDES if view.seen(side)}
             for view in views]
    return _with_poses(parameters, bend, corners, views, found)


def _with_poses(parameters, bend, corners, views, found):
    """Return the State of cameras and of the best of the poses that were found in each view."""
    poses = [_best_pose(parameters, corners, view, pose) for view, pose in zip(views, found)]
    return State(parameters, bend, *(np.array(each) for each in zip(*poses)))


def _focal_length(size, model, corners, views, side):
    """Return fx, fy, cx, cy: the focal length that explains the views of a camera best."""
    seen = [getattr(view, side) for view in views if view.seen(side)]
    step = max(1, len(seen) // TRIED_VIEWS)
    center = (np.array(size) - 1) / 2

    def error(focal):
        intrinsics = np.array([focal, focal, *center])
        return np.median([_error(model, intrinsics, corners, each) for each in seen[::step]])

    tried = size[0] * FOCAL_LENGTHS
    errors = [error(focal) for focal in tried]
    best = tried[int(np.argmin(errors))]
    return np.array([best, best, *center])


def _error(model, intrinsics, corners, detection):
    """Return the error, px, of the best pose of one view with a lens."""
    poses = _poses(model, intrinsics, corners, detection)
    return min((pose[2] for pose in poses), default=np.inf) * intrinsics[0]


def _poses(model, intrinsics, corners, detection):
    """Return the poses (R, t, error) that a view allows, the better one first."""
    K = np.array([[intrinsics[0], 0, intrinsics[2]], [0, intrinsics[1], intrinsics[3]],
                  [0, 0, 1]])
    D = intrinsics[4:] if intrinsics.size > 4 else np.zeros(4)
    rays = LENSES[model].undistort(np.asarray(detection.pixels, np.float64), K, D)
    if not np.isfinite(rays).all():
        return []
    try:
        _, rotations, translations, errors = cv2.solvePnPGeneric(
            np.ascontiguousarray(corners[detection.ids]), np.ascontiguousarray(rays), np.eye(3),
            None, flags=cv2.SOLVEPNP_IPPE)
    except cv2.error:
        return []
    return [(cv2.Rodrigues(rotation)[0], translation.ravel(), float(np.ravel(error)[0]))
            for rotation, translation, error in zip(rotations, translations, errors)
            if translation[2] > 0 and np.isfinite([*rotation, *translation]).all()]


def _motion(left, right):
    """Return rotation vector and translation, (6,), from a pose in both cameras."""
    rotation = right[0] @ left[0].T
    return np.concatenate([cv2.Rodrigues(rotation)[0].ravel(), right[1] - rotation @ left[1]])


def _middle(motions):
    """Return rotation vector and translation: that motion from which the others differ least."""
    motions = np.array(motions)
    scale = np.maximum(np.median(np.abs(motions - np.median(motions, 0)), 0), 1e-9)
    distances = np.abs((motions[:, None] - motions) / scale).sum(-1)
    best = motions[int(np.argmin(np.median(distances, axis=1)))]
    return best[:3], best[3:]


def _best_pose(parameters, corners, view, found):
    """Return rotation (3, 3) and translation (3,) of a view in the left camera."""
    matrix, translation = parameters.matrix, parameters.translation
    poses = [pose[:2] for pose in found.get('left', ())]
    poses += [(matrix.T @ pose[0], matrix.T @ (pose[1] - translation))
              for pose in found.get('right', ())]
    if not poses:
        raise CalibrationError(f'view {view.name}: no pose of the board explains its corners')
    errors = [_pair_error(parameters, corners, view, *pose) for pose in poses]
    return poses[int(np.argmin(errors))]


def _pair_error(parameters, corners, view, rotation, translation):
    """Return the mean distance, px, of the corners of a view from those of a pose."""
    distances = []
    for side in filter(view.seen, SIDES):
        detection = getattr(view, side)
        points = corners[detection.ids] @ rotation.T + translation
        if side == 'right':
            points = points @ parameters.matrix.T + parameters.translation
        if (points[:, 2] <= 0).any():
            return np.inf
        pixels = LENSES[parameters.distortion_model].project(points, getattr(parameters, side))[0]
        distances.append(np.linalg.norm(pixels - detection.pixels, axis=1))
    return np.concatenate(distances).mean()
