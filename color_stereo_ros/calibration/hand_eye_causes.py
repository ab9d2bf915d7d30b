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
"""Why a hand-eye calibration fails or should be doubted, in sentences for people."""

from dataclasses import replace

import numpy as np

from .hand_eye_start import closed_form
from .rigid import inverse, log, mean_rotation, quaternions_of, rotations_of
from ..errors import CalibrationError

FARTHEST = 20.0  # m; chosen: no arm reaches farther, and millimeters exceed it
LEAST_TURN = np.radians(3.0)  # root mean square; chosen: below it X is known to centimeters
LEAST_SECOND = np.radians(2.0)  # the same about the second axis
GOOD_TURN = np.radians(10.0)  # chosen: more does not improve much
SCALE_SIGMAS, SCALE_LEAST = 4.0, 0.003  # chosen: a doubt about the size of the squares
UNEXPECTED = 1.6  # chosen: chi square over its degrees of freedom of 60 is below it for sure


def check_motion(poses, least):
    """Raise CalibrationError unless there are enough poses, and they turn enough."""
    count = len(poses)
    if count < least:
        raise CalibrationError(f'{count} poses are too few: {least} is the least, 12 are good')
    farthest = np.linalg.norm(poses.flange[1], axis=1).max()
    if farthest > FARTHEST:
        raise CalibrationError(
            f'a flange pose lies {farthest:.0f} m from the base: the positions are probably in '
            'millimeters; say --units mm')
    spread, axes = turns(poses)
    if spread[0] < LEAST_TURN:
        raise CalibrationError(
            f'the flange turns by {np.degrees(spread[0]):.1f} degrees (root mean square) between '
            'the poses: too little to see where the camera is; tilt it by 20 to 40 degrees about '
            'two axes')
    if spread[1] < LEAST_SECOND:
        axis = ', '.join(f'{value:.2f}' for value in axes[0])
        raise CalibrationError(
            f'all poses turn about one axis, ({axis}) of the flange: the position of the camera '
            'along it cannot be seen; add poses that are tilted by 20 to 40 degrees about another '
            'axis')


def turns(poses):
    """Return how far the flange turns about its three principal axes, rad, and these (3, 3)."""
    middle = mean_rotation(poses.flange[0])
    vectors = log(middle.T @ poses.flange[0])
    values, axes = np.linalg.eigh(vectors.T @ vectors / len(vectors))
    return np.sqrt(np.maximum(values[::-1], 0)), axes.T[::-1]


def likely(poses, mounting, fits):
    """
    Return what is probably wrong with poses that do not fit each other, as a sentence.

    Parameters
    ----------
    poses : hand_eye.Poses
        Of flange and board, one of each for a shot.
    mounting : str
        Where the camera is: on the hand, or beside the robot.
    fits : callable
        Takes poses and a mounting and tells whether they fit.

    """
    for sentence, changed, kind in _suspects(poses, mounting):
        if len(changed) > 3 and fits(changed, kind):
            return f'the flange poses and the views do not fit: {sentence}'
    scale = _scale(poses, mounting)
    if scale is not None:
        return f'the flange poses and the views do not fit: {scale}'
    return ('the flange poses and the views do not fit: the rows of the file do not belong to the '
            'images, the poses are not those of the flange in the base, or board or camera have '
            'moved')


def _suspects(poses, mounting):
    """Yield (sentence, poses that then should fit, mounting) of the usual mistakes."""
    order = np.arange(len(poses))
    other = 'eye-to-hand' if mounting == 'eye-in-hand' else 'eye-in-hand'
    yield (f'they fit with --mounting {other}, or if the file holds the base in the flange '
           'instead of the flange in the base', poses, other)
    yield ('they fit in reverse order; sort the rows of the file as the images',
           _other_flange(poses, order[::-1]), mounting)
    yield ('they fit if each row belongs to the image after it; the first image has no row, or '
           'the last row is too many',
           _paired(poses, order[:-1], order[1:]), mounting)
    yield ('they fit if each row belongs to the image before it; the first row is too many, or '
           'an image is missing', _paired(poses, order[1:], order[:-1]), mounting)
    R, t = poses.flange
    first = quaternions_of(R)
    yield ('they fit if the quaternions are read as w x y z; write them as x y z w',
           replace(poses, flange=(rotations_of(first[:, [1, 2, 3, 0]]), t)), mounting)
    yield ('they fit if the rotations are inverted; give the flange in the base',
           replace(poses, flange=(np.swapaxes(R, -1, -2), t)), mounting)


def _other_flange(poses, order):
    return replace(poses, flange=tuple(part[order] for part in poses.flange))


def _paired(poses, rows, views):
    return replace(poses.chosen(views), flange=tuple(part[rows] for part in poses.flange))


def _scale(poses, mounting):
    """Return that robot and board have different units, None if that does not explain it."""
    G = poses.flange if mounting == 'eye-in-hand' else inverse(poses.flange)
    scale = closed_form(G, poses.board)[1]
    for factor, sentence in (
            (1e-3, 'the robot moves a thousandth of what the views show; are its positions in '
             'kilometers, or the size of the squares in millimeters instead of meters?'),
            (1e3, 'the robot moves a thousand times as far as the views show; are its positions '
             'in millimeters (--units mm)?')):
        if 0.8 < scale / factor < 1.25:
            return sentence
    return (f'the robot moves {scale:.3g} times as far as the views show; is the size of the '
            'squares right?' if 0.2 < scale < 0.95 or 1.05 < scale < 5 else None)


def doubts(poses, solution, few, given):
    """Return what should be looked after in a solution, as sentences."""
    found = []
    if len(poses) < few:
        found.append(f'{len(poses)} poses are few: the standard deviations are uncertain by a '
                     'third; 12 are good')
    spread = turns(poses)[0]
    if spread[1] < GOOD_TURN:
        found.append(f'the flange turns by {np.degrees(spread[1]):.0f} degrees only about its '
                     'second axis; tilts of 20 to 40 degrees about two axes give a better result')
    scale, std = solution.scale
    if abs(scale - 1) > max(SCALE_SIGMAS * std, SCALE_LEAST):
        found.append(f'the robot moves {scale:.4f} times as far as the views show (standard '
                     f'deviation {std:.4f}): the squares are of another size, or the baseline of '
                     'the calibration is wrong')
    if given and solution.chi > UNEXPECTED:
        found.append(f'the residuals are {np.sqrt(solution.chi):.1f} times as large as '
                     '--robot-noise says; the standard deviations are too small by this factor')
    return found
