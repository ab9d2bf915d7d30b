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
"""The moments of a recording at which a robot stands still, with image pairs and its pose."""

import numpy as np

from .pairs import pairs_of
from .transforms import Transforms
from ..errors import ImageError, RecordingError
from ..messages.pairs import rgb_pair

STILL_MOVE, STILL_TURN = 2e-4, 1e-3  # m, rad; chosen: twice the noise of a good robot
SPAN = 150_000_000  # ns before and after the exposure; chosen: a robot that stops oscillates
APART_MOVE, APART_TURN = 0.01, 0.03  # m, rad; chosen: a new pose for people


def still_moments(recording, base, flange, say):
    """
    Yield pairs of images of a robot that stands still, once for each of its poses.

    Parameters
    ----------
    recording : Recording
        With images of one pair and the transforms of the robot.
    base, flange : str
        Names of frames.
    say : callable
        Takes a sentence about an image that cannot be read.

    Raises
    ------
    RecordingError
        If the frames are not connected, or the robot never stands still.

    Yields
    ------
    name : str
        The stamp of the left image, s.
    images : (left, right)
        uint8 (H, W, 3), RGB.
    pose : (R, t)
        base_from_flange, m.

    """
    transforms = Transforms(recording)
    transforms.check(base, flange)
    taken, topics = [], recording.stereo_topics()
    for pair in pairs_of(recording, topics.left_image, topics.right_image, say):
        pose = _still(transforms, base, flange, pair.stamp)
        if pose is None or not all(_apart(pose, other) for other in taken):
            continue
        try:
            images = rgb_pair(pair)
        except ImageError as error:
            say(str(error))
            continue
        taken.append(pose)
        yield f'{pair.stamp * 1e-9:.3f} s', (images.left, images.right), pose
    if not taken:
        raise RecordingError(f'{recording.path}: at no pair of images the frame {flange!r} stands '
                             f'still in {base!r}; stop the robot for half a second at each pose')


def _still(transforms, base, flange, stamp):
    """Return the pose of the flange at a time, or None where it moves or is not known."""
    try:
        before, pose, after = (transforms.pose(base, flange, stamp + shift)
                               for shift in (-SPAN, 0, SPAN))
    except RecordingError:
        return None
    moves = [_distance(pose, other) for other in (before, after)]
    still = all(move < STILL_MOVE and turn < STILL_TURN for move, turn in moves)
    return pose if still else None


def _apart(pose, other):
    move, turn = _distance(pose, other)
    return move > APART_MOVE or turn > APART_TURN


def _distance(first, second):
    cosine = (np.trace(first[0].T @ second[0]) - 1) / 2
    return np.linalg.norm(first[1] - second[1]), np.arccos(np.clip(cosine, -1, 1))
