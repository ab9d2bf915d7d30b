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
What may be wrong with the views of a pair, found before anything is calibrated.

Each camera alone tells where each board is. A rigid pair then has the same motion between its
cameras in every view. What makes the motions differ is told by what makes them agree: a shift by
some views, a mirrored image, a moment at which a camera was moved.

"""

from dataclasses import dataclass

import cv2
import numpy as np

from .views import SIDES
from ..errors import CalibrationError

LEAST_VIEWS = 4         # with both cameras; chosen: three give no residual worth the name
LEAST_TILT = 12.0       # degrees between the boards that differ most
CORNERS = 8             # of a view that takes part here
ODD = 0.01              # spread of the motions, of the baseline or rad, that is suspicious
LOOSE = 0.04            # and that is refused even if its reason is not known
CONVINCING = 1 / 3      # of the spread: an explanation must leave less than that
SIMPLE = 2.0            # px: a larger residual means that the simple camera does not fit
LAGS = (1, -1, 2, -2)   # views
MIRROR_TRIES = 6        # views in which a mirrored board is looked for
SEGMENT = 2             # views on either side of a moment at which a camera moved
FLAGS = (cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST
         | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3)
"""A simple camera: views of a poor choice do not determine more."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Where the right camera is as one view has it."""

    rotation: np.ndarray
    """float64 (3,), rotation vector from the left to the right camera, rad."""
    center: np.ndarray
    """float64 (3,), the right camera in the frame of the left one, m."""


def check_shots(board, shots, size, reopened=None):
    """
    Refuse shots from which no pair can be calibrated, with the reason.

    Parameters
    ----------
    board : Board
        The calibration board.
    shots : list of Shot
        Those without a problem, in the order in which they were taken.
    size : (int, int)
        Width and height, px.
    reopened : callable or None
        Returns both gray images of a shot by its place in the list; None where they are gone.

    Raises
    ------
    CalibrationError

    """
    _check_numbers(board, shots, reopened)
    poses = [_camera_poses(board, [shot.detections[side] for shot in shots], size)
             for side in range(2)]
    if any(rms > SIMPLE for _, rms in poses):
        return  # a lens that the simple camera does not describe: its motions tell nothing
    poses = [column for column, _ in poses]
    _check_tilt(poses)
    motions = motions_of(*poses)
    spread = spread_of(motions)
    if spread > ODD:
        _explain(board, shots, size, poses, reopened if spread > LOOSE else None)
    _check_order(motions)
    if spread > LOOSE:
        _refuse_loose(shots)


def explain(board, shots, size, reopened=None):
    """
    Refuse shots that were not calibrated well where the reason can be found.

    Parameters and errors are those of `check_shots`. Without an explanation nothing happens.

    """
    poses = [_camera_poses(board, [shot.detections[side] for shot in shots], size)
             for side in range(2)]
    if all(rms <= SIMPLE for _, rms in poses):
        _explain(board, shots, size, [column for column, _ in poses], reopened)


def _check_numbers(board, shots, reopened):
    seen = [sum(detection is not None for detection in column)
            for column in zip(*(shot.detections for shot in shots))] or [0, 0]
    both = sum(None not in shot.detections for shot in shots)
    if both >= LEAST_VIEWS:
        return
    mirrored = _mirrored_sides(board, shots, reopened)
    if mirrored:
        raise CalibrationError(f'the board is found in the {" and the ".join(mirrored)} images '
                               'only when they are mirrored: switch mirroring off in the camera')
    counts = f'left {seen[0]}, right {seen[1]}, both {both} of {len(shots)} views'
    if not any(seen):
        raise CalibrationError(
            f'no image shows the {board.describe()}: compare kind and numbers of the board with '
            'the options; light it evenly, focus the cameras, hold it still, keep the pattern of '
            'the projector off')
    if not all(seen):
        alone, other = (SIDES if seen[0] else SIDES[::-1])
        raise CalibrationError(f'the board is seen by the {alone} camera only ({counts}): show '
                               f'it to both; look at an image of the {other} camera')
    raise CalibrationError(f'both cameras see the board in too few views ({counts}), expected '
                           f'at least {LEAST_VIEWS}, better 15: hold it where both see it')


def _mirrored_sides(board, shots, reopened):
    """Return the sides whose images show the board when they are mirrored, and never else."""
    if reopened is None:
        return []
    found = []
    for side, name in enumerate(SIDES):
        if any(shot.detections[side] is not None for shot in shots):
            continue
        step = max(1, len(shots) // MIRROR_TRIES)
        if any(board.detect(np.ascontiguousarray(reopened(place)[side][:, ::-1])) is not None
               for place in range(0, len(shots), step)):
            found.append(name)
    return found


def _camera_poses(board, detections, size):
    """
    Return the pose of the board in each view of one camera, and the residual, px.

    Rotation and translation are those of cv2.calibrateCamera, with a camera of one coefficient.
    They are None where the camera sees too little.

    """
    used = [place for place, each in enumerate(detections)
            if each is not None and len(each.ids) >= CORNERS]
    if len(used) < LEAST_VIEWS:
        return [None] * len(detections), 0.0
    points = [board.corners[detections[place].ids].astype(np.float32) for place in used]
    pixels = [detections[place].pixels.astype(np.float32)[:, None] for place in used]
    focal = float(max(size))
    camera = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    rms, _, _, turns, shifts = cv2.calibrateCamera(
        points, pixels, size, camera, np.zeros(5), flags=FLAGS | cv2.CALIB_USE_INTRINSIC_GUESS)
    poses = dict(zip(used, zip(turns, shifts)))
    return [None if place not in poses else
            (cv2.Rodrigues(poses[place][0])[0], poses[place][1].ravel())
            for place in range(len(detections))], rms


def _check_tilt(poses):
    """Refuse boards that are all parallel: they tell nothing of the focal length."""
    for side, column in zip(SIDES, poses):
        normals = np.array([turn[:, 2] for turn, _ in filter(None, column)])
        if len(normals) < 2:
            continue
        largest = np.degrees(np.arccos(np.clip((normals @ normals.T).min(), -1, 1)))
        if largest < LEAST_TILT:
            raise CalibrationError(
                f'all boards are nearly parallel for the {side} camera (within {largest:.0f} '
                f'degrees): tilt the board by 35 to 55 degrees, each time towards another side')


def motions_of(left, right):
    """Return the Motion of each view that has a pose in both cameras."""
    found = []
    for first, second in zip(left, right):
        if first is None or second is None:
            continue
        rotation = second[0] @ first[0].T
        translation = second[1] - rotation @ first[1]
        found.append(Motion(cv2.Rodrigues(rotation)[0].ravel(), -rotation.T @ translation))
    return found


def _check_order(motions):
    """Refuse cameras that are exchanged, or mirrored both."""
    if not motions:
        return
    x, y, _ = np.median([motion.center for motion in motions], axis=0)
    if abs(y) > abs(x):
        raise CalibrationError('one camera is above the other; turn both by 90 degrees, so that '
                               'one is beside the other')
    if x < 0:
        raise CalibrationError(
            f'the right camera is about {-x:.2f} m to the left of the left one: exchange the '
            'images of the two cameras; if they are right, both are mirrored')


def spread_of(motions):
    """
    Return how much motions differ, in shares of the baseline and rad, robustly.

    Parameters
    ----------
    motions : list of Motion
        Between two shots each.

    Returns
    -------
    spread : float
        Median distance from the median; infinite for less than three motions.

    """
    return float(np.median(_distances(motions))) if len(motions) >= 3 else np.inf


def _distances(motions):
    """Return how far motions are from their median, shares of the baseline plus rad, (n,)."""
    centers = np.array([motion.center for motion in motions])
    turns = np.array([motion.rotation for motion in motions])
    middle = np.median(centers, axis=0)
    far = np.linalg.norm(centers - middle, axis=1) / max(np.linalg.norm(middle), 1e-6)
    return far + np.linalg.norm(turns - np.median(turns, axis=0), axis=1)


def _explain(board, shots, size, poses, reopened):
    """Raise the explanation after which the motions agree."""
    left, right = poses
    motions = motions_of(left, right)
    limit = CONVINCING * spread_of(motions)
    for lag in LAGS:
        shifted = motions_of(left[:len(left) - lag], right[lag:]) if lag > 0 else \
            motions_of(left[-lag:], right[:lag])
        if len(shifted) >= LEAST_VIEWS and spread_of(shifted) < limit:
            late, early = SIDES[::-1] if lag > 0 else SIDES
            raise CalibrationError(
                f'the images are paired wrongly: each image of the {late} camera belongs to the '
                f'{early} one {abs(lag)} {"view" if abs(lag) == 1 else "views"} before it')
    _refuse_one_mirror(board, shots, size, poses, limit, reopened)
    place = moved_at(motions, limit)
    if place is not None:
        names = [shot.name for shot, first, second in zip(shots, left, right)
                 if first is not None and second is not None]
        raise moved_between(names[place - 1], names[place])


def moved_between(before, after):
    """Return the error that names the views between which a camera was moved."""
    return CalibrationError(
        f'a camera was moved between {before} and {after}: the views before and after agree among '
        'themselves only; calibrate anew with the views of one side')


def _refuse_loose(shots):
    """Refuse pairs whose cameras disagree for a reason that is not known."""
    skews = [abs(shot.skew) for shot in shots]
    told = f' (their stamps differ by up to {max(skews) / 1e6:.1f} ms)' if max(skews) else ''
    raise CalibrationError(
        'the two cameras disagree on how the board moves from view to view'
        f'{told}: the images of a pair were not taken at the same moment, or a camera is loose; '
        'trigger both cameras together, or hold the board still')


def _refuse_one_mirror(board, shots, size, poses, limit, reopened):
    """Refuse one camera whose images are mirrored: a chessboard is found in them all the same."""
    if reopened is None:
        return
    step = max(1, len(shots) // MIRROR_TRIES)
    places = range(0, len(shots), step)
    for side, name in enumerate(SIDES):
        flipped = [board.detect(np.ascontiguousarray(reopened(place)[side][:, ::-1]))
                   for place in places]
        tried = [[column[place] for place in places] for column in poses]
        tried[side], _ = _camera_poses(board, flipped, size)
        motions = motions_of(*tried)
        # with the other camera mirrored, too, they agree as well, but are exchanged
        if (len(motions) >= LEAST_VIEWS and spread_of(motions) < limit
                and np.median([motion.center[0] for motion in motions]) > 0):
            raise CalibrationError(f'the images of the {name} camera are mirrored: switch '
                                   'mirroring off in the camera')


def moved_at(motions, limit):
    """
    Return where motions change once for all, or None.

    Parameters
    ----------
    motions : list of Motion
        Between two shots each.
    limit : float
        The spread that both parts must stay below.

    Returns
    -------
    place : int or None
        The first motion after the change.

    """
    best = None
    for place in range(SEGMENT, len(motions) - SEGMENT + 1):
        parts = motions[:place], motions[place:]
        if max(map(_deviation, parts)) < limit:
            # The sum, not the median, sees that one motion is on the wrong side.
            total = sum(_distances(part).sum() for part in parts)
            if best is None or total < best[0]:
                best = total, place
    return None if best is None else best[1]


def _deviation(motions):
    """Return the spread of a part, also of two motions."""
    if len(motions) >= 3:
        return spread_of(motions)
    first, second = motions
    scale = max(np.linalg.norm(first.center), 1e-6)
    return float(np.linalg.norm(first.center - second.center) / scale
                 + np.linalg.norm(first.rotation - second.rotation)) / 2
