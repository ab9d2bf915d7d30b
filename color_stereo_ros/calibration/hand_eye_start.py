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
"""First values of a hand-eye calibration: closed forms, ours and OpenCV's."""

from itertools import combinations

import cv2
import numpy as np

from .rigid import apply, inverse, log, mean_rotation, product

PAIRS = 400  # chosen: more of them make the start slower, not better
SOLVERS = 'TSAI', 'PARK', 'HORAUD', 'ANDREFF', 'DANIILIDIS'


def starts(poses, in_hand):
    """
    Return several solutions.

    Parameters
    ----------
    poses : hand_eye.Poses
        Of flange and board, one of each for a shot.
    in_hand : bool
        The camera is on the flange.

    Returns
    -------
    solutions : list of (camera, board)
        Each is a motion (R, t), see `hand_eye`.

    """
    G = poses.flange if in_hand else inverse(poses.flange)
    cameras = [closed_form(G, poses.board)[0], *_by_opencv(G, poses.board)]
    return [(camera, _board(G, camera, poses.board)) for camera in cameras]


def closed_form(G, B):
    """
    Return X of A X = X B for all pairs of poses, and the size of the board that fits.

    Parameters
    ----------
    G, B : (R, t)
        float64 (n, 3, 3) and (n, 3), see `hand_eye`.

    Returns
    -------
    X : (R, t)
    scale : float
        By this the distances of the board have to be multiplied to fit those of the robot.

    """
    pairs = np.array(list(combinations(range(len(G[1])), 2)))
    pairs = pairs[::max(1, len(pairs) // PAIRS)]
    first, second = (tuple(part[at] for part in G) for at in pairs.T)
    A = product(inverse(second), first)
    first, second = (tuple(part[at] for part in B) for at in pairs.T)
    motion = product(second, inverse(first))
    R = mean_rotation(log(A[0])[:, :, None] * log(motion[0])[:, None, :])
    turned = apply(R, motion[1])
    left = np.concatenate([A[0] - np.eye(3), -turned[..., None]], axis=2)
    scaled = np.linalg.lstsq(left.reshape(-1, 4), -A[1].ravel(), rcond=None)[0]
    t = np.linalg.lstsq((A[0] - np.eye(3)).reshape(-1, 3), (turned - A[1]).ravel(),
                        rcond=None)[0]
    return (R, t), float(scaled[3])


def _board(G, camera, B):
    """Return the pose of the board that the poses have in the mean; the median of positions."""
    R, t = product(product(G, camera), B)
    return mean_rotation(R), np.median(t, axis=0)


def _by_opencv(G, B):
    """Return what OpenCV's solvers find; builds without them find nothing (the wheels of 5.0)."""
    solve = getattr(cv2, 'calibrateHandEye', None)
    if solve is None:
        return []
    found = []
    for name in SOLVERS:
        try:
            R, t = solve(list(G[0]), list(G[1]), list(B[0]), list(B[1]),
                         method=getattr(cv2, f'CALIB_HAND_EYE_{name}'))
        except cv2.error:
            continue  # some of them do not take every set of poses
        if np.isfinite(R).all() and np.isfinite(t).all():
            found.append((mean_rotation(R[None]), t.ravel()))
    return found
