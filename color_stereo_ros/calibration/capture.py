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
"""Calibration while somebody holds the board: which pose next, and when it is good enough."""

import cv2
import numpy as np

from .adjustment import adjust
from .gray import gray_of
from .guidance import Detectable, Guide
from .shots import check_sizes, detect_shot
from .still import StillWatch
from .views import SIDES
from ..errors import CalibrationError

FIRST = 4  # views with both cameras before poses can be compared
FIRST_POSES = (
    'hold the board in the middle of both images, tilted by about 40 degrees, left edge nearer',
    'the same with the right edge nearer',
    'the same with the upper edge nearer',
    'the same with the lower edge nearer')
LINE, SHOWN = (255, 190, 0), (0, 200, 120)  # RGB of the next pose and of the board as it is
PARTS = ('left', 'middle', 'right'), ('upper', 'middle', 'lower')
LEANING = 8.0  # degrees: less is no tilt that words name


class Capture:
    """
    Takes pairs of images, keeps those in which the board stands still in a new place.

    Parameters
    ----------
    board : Board
    target : float
        Standard deviation of the depth at which the views suffice, m.
    most : int
        Views after which it ends in any case.
    distance : float or None
        Working distance, m; None = that of the first views.
    model : str
        Lens model of the calibrations in between.

    """

    def __init__(self, board, target, most, distance=None, model='plumb_bob'):
        self._board = board
        self._target = target
        self._most = most
        self._distance = distance
        self._model = model
        self._watch = StillWatch()
        self.shots = []
        """Shots of the views that were taken."""
        self.images = []
        """Both gray images of each of them."""
        self.advice = None
        """Advice about the next pose, None while the views are too few for one."""
        self.depth_std = np.inf
        """m, of the depth at the working distance, after the last view."""

    @property
    def done(self):
        """Return whether the views suffice, or are as many as may be."""
        return self.depth_std <= self._target or len(self.shots) >= self._most

    def look(self, pair):
        """
        Look at the next pair.

        Parameters
        ----------
        pair : ImagePair
            The images of both cameras.

        Returns
        -------
        shot : Shot
        taken : bool
            It has become a view, and the advice is new.

        Raises
        ------
        CalibrationError
            If the size of the images has changed.

        """
        shot = detect_shot(self._board, pair)
        if None in shot.detections or not self._watch.look(shot):
            return shot, False
        check_sizes([*self.shots, shot])
        self.shots.append(shot)
        self.images.append([gray_of(image) for image in pair.images()])
        self._advise()
        return shot, True

    def _advise(self):
        """Calibrate with the views so far, and find the next pose."""
        if len(self.shots) < FIRST:
            return
        views = [shot.view for shot in self.shots]
        try:
            found = adjust(self.shots[0].sizes[0], self._board.corners, views, self._model)
            calibration = found.calibration
        except CalibrationError:
            self.advice = None  # not determined yet
            return
        if self._distance is None:
            self._distance = float(np.median(found.translations[:, 2]))
        sigma = max(found.scale, 1.0) * np.median(np.concatenate(
            [found.corners[side].sigma for side in SIDES]))
        guide = Guide(self._board.corners, self._distance,
                      Detectable(whole=self._board.kind != 'charuco'), sigma)
        self.advice = guide.next(found.parameters, found.information)
        if self.advice is not None:
            self.depth_std = self.advice.depth_std
        else:
            self.depth_std = depth_std(found, calibration, self._distance)

    def words(self):
        """Return what to do next, one line."""
        if self.advice is None:
            return FIRST_POSES[len(self.shots) % len(FIRST_POSES)]
        return pose_in_words(self.advice, self._board, self.shots[0].sizes[0])

    def account(self):
        """Return how good the calibration is, and how good it is with the next view, as text."""
        if self.advice is None:
            return f'{len(self.shots)} views'
        return (f'{len(self.shots)} views: depth {1e3 * self.advice.depth_std:.3f} mm at '
                f'{1e3 * self._distance:.0f} mm, rows {self.advice.rows_std:.3f} px (1 sigma); '
                f'with the next view {1e3 * self.advice.expected_depth_std:.3f} mm, '
                f'{self.advice.expected_rows_std:.3f} px')


def depth_std(adjustment, calibration, distance):
    """Return the standard deviation of the depth, m, root mean square over the image."""
    from .guidance import grid_of
    values = adjustment.covariance.depth_std(calibration, *grid_of(calibration, distance))
    return float(np.sqrt(np.nanmean(values**2)))


def pose_in_words(advice, board, size):
    """
    Return a pose of the board as words for the person who holds it.

    Parameters
    ----------
    advice : Advice
        The pose that tells most.
    board : Board
        The calibration board.
    size : (int, int)
        Width and height of the images, px.

    """
    middle = advice.outlines['left'].mean(axis=0)
    column, row = (names[int(np.clip(3 * value // extent, 0, 2))]
                   for names, value, extent in zip(PARTS, middle, size))
    place = 'middle' if row == column == 'middle' else ' '.join(
        dict.fromkeys(each for each in (row, column) if each != 'middle'))
    distance = np.linalg.norm(advice.rotation @ board.corners.mean(axis=0) + advice.translation)
    return (f'hold the board {100 * distance:.0f} cm before the left camera, in the {place} of '
            f'the left image, {_leaning(advice.rotation)}')


def _leaning(rotation):
    """Return which edge is nearer, and by how many degrees the board is tilted."""
    normal = rotation[:, 2] * np.sign(rotation[2, 2])
    tilt = np.degrees(np.arccos(np.clip(normal[2], -1, 1)))
    if tilt < LEANING:
        return 'facing the camera'
    edges = []
    # Z = -(n_x X + n_y Y) / n_z: with n_x > 0 the plane comes nearer to the right
    for value, low, high in ((normal[1], 'upper', 'lower'), (normal[0], 'left', 'right')):
        if abs(value) > np.sin(np.radians(LEANING)):
            edges.append(high if value > 0 else low)
    return f'tilted by {tilt:.0f} degrees, {" ".join(edges)} edge nearer'


def picture(images, shot, advice):
    """
    Draw both images with the board as it is and the outline of the next pose.

    Parameters
    ----------
    images : (numpy.ndarray, numpy.ndarray)
        uint8 (H, W, 3), RGB.
    shot : Shot
        What the cameras see.
    advice : Advice or None
        The pose that tells most; None: not known yet.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, 2 W, 3)
        RGB.

    """
    drawn = []
    for image, side, detection in zip(images, SIDES, shot.detections):
        image = image.copy()
        if detection is not None:
            for place in np.rint(detection.pixels).astype(int):
                cv2.circle(image, place.tolist(), 3, SHOWN, -1, cv2.LINE_AA)
        if advice is not None:
            outline = np.rint(advice.outlines[side]).astype(np.int32)
            cv2.polylines(image, [outline], True, LINE, 3, cv2.LINE_AA)
            # the first corner, so that the board is not held upside down
            cv2.circle(image, outline[0].tolist(), 9, LINE, -1, cv2.LINE_AA)
        drawn.append(image)
    return np.hstack(drawn)
