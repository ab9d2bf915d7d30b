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
How exact corners of boards are: `python -m color_stereo_ros.evaluation.corners`.

Two converging cameras with distorted lenses, Bayer mosaics, blur and noise see exact images of
boards. The errors of this package's corners stand beside those of OpenCV on the same images.

"""

import argparse
from dataclasses import dataclass, field

import cv2
import numpy as np

from ..calibration.boards import Board
from ..calibration.charuco import dictionary, is_available
from ..calibration.gray import gray_of
from ..core import StereoCalibration
from ..sim.boards import board_pair
from ..sim.geometry import Pose

BASELINE, CONVERGENCE, FOCAL = 0.2, 15.0, 640.0  # m, degrees, px at 640 columns
CASES = {('chessboard', 'usual'): (0, 30), ('chessboard', 'steep'): (35, 55),
         ('charuco', 'usual'): (0, 30), ('charuco', 'steep'): (35, 55),
         ('circles', 'usual'): (0, 30)}
"""Kind of board and name of the case: least and largest tilt, degrees."""
QUIET = 1e7  # electrons, a full well whose shot noise is less than a number of 8 bits
WINDOW = (5, 5)  # px, half width of cornerSubPix; the usual one of its examples


@dataclass
class Errors:
    """Errors of one method on the images of one case."""

    errors: list = field(default_factory=list)
    """px, float64 (n, 2) each."""
    sigmas: list = field(default_factory=list)
    """px, float64 (n,) each; empty where a method claims nothing."""
    boards: int = 0
    """Images in which the board was found."""

    def add(self, errors, sigma=None):
        """Add the errors of one image."""
        self.errors.append(errors)
        self.boards += 1
        if sigma is not None:
            self.sigmas.append(sigma)

    @property
    def rms(self):
        """Return the root of the mean square of either coordinate, px."""
        return float(np.sqrt((np.concatenate(self.errors) ** 2).mean()))

    @property
    def worst(self):
        """Return the largest error of a coordinate, px."""
        return float(np.abs(np.concatenate(self.errors)).max())

    @property
    def z68(self):
        """Return the 68th percentile of error / sigma; 1 is honest, NaN = nothing claimed."""
        if not self.sigmas:
            return float('nan')
        ratio = np.abs(np.concatenate(self.errors)) / np.concatenate(self.sigmas)[:, None]
        return float(np.percentile(ratio, 68))


def rig(width=640):
    """Return the StereoCalibration of the two cameras, 4 : 3, so many columns wide."""
    height, focal = width * 3 // 4, FOCAL * width / 640
    K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    rotation = cv2.Rodrigues(np.radians([0.0, CONVERGENCE, 0.0]))[0]
    half = np.radians(CONVERGENCE / 2)
    place = BASELINE * np.array([np.cos(half), 0, np.sin(half)])
    D = np.array([-0.12, 0.08, 0.001, -0.0007, 0.01])
    return StereoCalibration.from_arrays((width, height), K, D, K, 0.9 * D, rotation,
                                         -rotation @ place)


def facing(board, z, tilt=(0.0, 0.0, 0.0), x=0.05, y=0.0):
    """
    Return the Pose in the left camera of a board whose middle is at (x, y, z), m.

    Parameters
    ----------
    board : Board
        The calibration board.
    z : float
        m.
    tilt : (float, float, float)
        Degrees about the fixed axes x, y, z.
    x, y : float
        m.

    """
    rotation = Pose.from_degrees([0, 0, 0], tilt).rotation
    return Pose(rotation, np.array([x, y, z]) - rotation @ (*(np.array(board.size_m) / 2), 0.0))


def random_pose(board, tilts, generator):
    """Return a Pose whose tilt from the image plane lies between two angles in degrees."""
    tilt = np.radians(generator.uniform(*tilts))
    toward = generator.uniform(0, 2 * np.pi)
    axis = tilt * np.array([np.cos(toward), np.sin(toward), 0.0])
    spin = np.radians([0.0, 0.0, generator.uniform(-30, 30)])
    rotation = cv2.Rodrigues(axis)[0] @ cv2.Rodrigues(spin)[0]
    z = generator.uniform(0.30, 0.42)
    place = np.array([0.13 * z + generator.uniform(-0.02, 0.02), generator.uniform(-0.02, 0.02),
                      z])
    return Pose(rotation, place - rotation @ (*(np.array(board.size_m) / 2), 0.0))


def measured(kind, tilts, count, seed=0, width=640, **electronics):
    """
    Find the corners in random views with this package and with OpenCV.

    Parameters
    ----------
    kind : str
        Name in BOARDS.
    tilts : (float, float)
        Degrees.
    count : int
        Pairs of views.
    seed : int
        Of the random numbers.
    width : int
        Columns of the images.
    **electronics
        See `sim.boards.board_camera`.

    Returns
    -------
    errors : dict of str to Errors
        By method; 'ours' is the first one.

    """
    board, calibration = Board.usual(kind), rig(width)
    generator = np.random.default_rng(seed)
    methods = {'ours': _ours, **OPENCV[kind]}
    errors = {name: Errors() for name in methods}
    for index in range(count):
        pose = random_pose(board, tilts, generator)
        for view in board_pair(calibration, board, pose, seed=seed + index, **electronics):
            gray = gray_of(view.image)
            for name, method in methods.items():
                found = method(board, gray, view)
                if found is not None:
                    ids, pixels, *sigma = found
                    errors[name].add(pixels - view.pixels[ids], *sigma)
    return errors


def _ours(board, gray, _):
    found = board.detect(gray)
    return None if found is None else (found.ids, found.pixels, found.sigma)


def _subpix(board, gray, view):
    """Return what cornerSubPix makes of good starts: those that our own detection has."""
    found = board.detect(gray)
    if found is None:
        return None
    start = np.float32(np.round(found.pixels))[:, None].copy()
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-4)
    return found.ids, cv2.cornerSubPix(gray, start, WINDOW, (-1, -1), criteria)[:, 0]


def _sector(board, gray, view):
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, pixels = cv2.findChessboardCornersSB(gray, (board.columns - 1, board.rows - 1),
                                                flags=flags)
    return _in_order(pixels.reshape(-1, 2), view) if found else None


def _charuco(board, gray, view):
    aruco, markers = cv2.aruco, dictionary(board.dictionary)
    if not hasattr(aruco, 'CharucoDetector'):
        return None
    drawn = aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m,
                               markers)
    pixels, ids = aruco.CharucoDetector(drawn).detectBoard(gray)[:2]
    return None if ids is None else (ids.ravel(), pixels.reshape(-1, 2))


def _circles(board, gray, view):
    found, pixels = cv2.findCirclesGrid(gray, (board.columns, board.rows),
                                        flags=cv2.CALIB_CB_ASYMMETRIC_GRID)
    return _in_order(pixels.reshape(-1, 2), view) if found else None


def _in_order(pixels, view):
    """Return ids and pixels; OpenCV begins at any end."""
    ids = np.arange(len(pixels))
    return min(((ids, each) for each in (pixels, pixels[::-1])),
               key=lambda pair: np.abs(pair[1] - view.pixels).max())


OPENCV = {'chessboard': {'cornerSubPix': _subpix, 'SB': _sector},
          'charuco': {'cornerSubPix': _subpix, 'ChArUco': _charuco},
          'circles': {'circles': _circles}}
"""OpenCV's methods by kind of board."""


def table(count, width=640, seed=0):
    """Return the lines of a table: RMS error, largest error, images, z68 of each method."""
    lines = [f'{"board":12}{"tilt":8}{"method":14}{"RMS px":>8}{"max px":>8}{"found":>8}'
             f'{"z68":>7}']
    for (kind, name), tilts in CASES.items():
        if kind == 'charuco' and not is_available():
            continue
        for method, each in measured(kind, tilts, count, seed, width).items():
            lines.append(f'{kind:12}{name:8}{method:14}' + (
                f'{each.rms:8.3f}{each.worst:8.3f}{each.boards:5}/{2 * count}{each.z68:7.2f}'
                if each.boards else '   not found'))
    return lines


def limits(count, width=640, seed=0):
    """
    Measure the errors that corners have without noise and mosaic.

    Boards lie along the pixels, where every part of an edge meets them in one phase, or are
    turned by 12 to 35 degrees, where all phases occur.

    Returns
    -------
    along, turned : float
        Root of the mean square of either coordinate, px.

    """
    board, generator = Board.usual('chessboard'), np.random.default_rng(seed)
    errors = []
    for turns in ((-0.5, 0.5), (12, 35)):
        errors.append(Errors())
        for index in range(count):
            pose = facing(board, generator.uniform(0.38, 0.42), (0, -CONVERGENCE / 2,
                                                                 generator.uniform(*turns)))
            for view in board_pair(rig(width), board, pose, full_well=QUIET, read_noise=0.0,
                                   bayer='none'):
                ids, pixels, _ = _ours(board, gray_of(view.image), view)
                errors[-1].add(pixels - view.pixels[ids])
    return tuple(each.rms for each in errors)


def main(argv=None):
    """Print the table."""
    parser = argparse.ArgumentParser(description='Errors of corners on rendered boards, px.')
    parser.add_argument('--views', type=int, default=12, metavar='N', help='pairs of each case')
    parser.add_argument('--width', type=int, default=640, metavar='N', help='columns')
    parser.add_argument('--seed', type=int, default=0, metavar='N')
    parser.add_argument('--limits', action='store_true',
                        help='errors without noise, from which constants of the fit come')
    args = parser.parse_args(argv)
    if args.limits:
        along, turned = limits(args.views, args.width, args.seed)
        print(f'without noise and mosaic: along the pixels {along:.4f} px, turned {turned:.4f} px')
        return
    print('\n'.join(table(args.views, args.width, args.seed)))


if __name__ == '__main__':
    main()
