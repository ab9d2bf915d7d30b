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
How exact a calibration from images is: `python -m color_stereo_ros.evaluation.calibration`.

Two converging cameras with distorted lenses, Bayer mosaics, blur and noise see exact images of a
board in the poses that the guidance asks for, as a hand meets them: else the small errors that
corners have in one pose would be the same in all seeds. The corners are found, the pair is
calibrated, and the result is compared with the truth.

"""

import argparse
from dataclasses import dataclass
import sys

import cv2
import numpy as np

from .corners import rig
from ..calibration.adjustment import adjust
from ..calibration.boards import Board
from ..calibration.charuco import is_available
from ..calibration.geometry import rectified
from ..calibration.gray import gray_of
from ..calibration.guidance import Detectable, first_information, grid_of, Guide
from ..calibration.views import View
from ..core.cameras.lenses import LENSES
from ..core.cameras.parameters import StereoParameters
from ..sim.boards import board_pair
from ..sim.geometry import Pose

DISTANCE = 0.35  # m, where depth and rows are asked for
VIEWS = 15
HAND = 1.0, 0.002  # degrees and m, standard deviations of how a hand meets a pose


@dataclass(frozen=True, eq=False)
class Outcome:
    """Errors of one calibration, and what it claimed."""

    depth: np.ndarray
    """float64 (P,), m, of a flat target at `DISTANCE`."""
    depth_std: np.ndarray
    rows: np.ndarray
    """float64 (P,), px."""
    rows_std: np.ndarray
    parameters: np.ndarray
    """float64 (n,), errors of the parameters, in standard deviations."""
    focal: float
    """Relative error, root mean square of the four focal lengths."""
    scale: float
    """Scatter of the residuals over what the corners say."""
    dropped: int
    """Views."""


def poses_for(truth, board, count=VIEWS, distance=DISTANCE):
    """Return the poses that the guidance asks for, a list of Pose in the left camera."""
    parameters = StereoParameters.from_calibration(truth)
    detectable = Detectable(whole=board.kind == 'chessboard')
    guide = Guide(board.corners, distance, detectable)
    return [Pose(advice.rotation, advice.translation) for advice in guide.sequence(
        parameters, first_information(parameters, board.corners), count)]


def held(poses, board, seed):
    """Return poses as a hand meets them, turned about the middle of the board and moved."""
    generator, middle = np.random.default_rng([seed, VIEWS]), np.array([*board.size_m, 0.0]) / 2
    found = []
    for pose in poses:
        turn = cv2.Rodrigues(np.radians(generator.normal(0, HAND[0], 3)))[0] @ pose.rotation
        place = pose.to_parent(middle[None])[0] + generator.normal(0, HAND[1], 3)
        found.append(Pose(turn, place - turn @ middle))
    return found


def views_of(truth, board, poses, seed, **electronics):
    """Return the View of rendered pairs in some poses."""
    views = []
    for index, pose in enumerate(poses):
        pair = board_pair(truth, board, pose, seed=1000 * seed + index, **electronics)
        views.append(View(f'{index:02d}', *(board.detect(gray_of(each.image)) for each in pair)))
    return views


def outcome(truth, board, views, distance=DISTANCE):
    """Return the Outcome of the calibration from some views."""
    found = adjust((truth.left.width, truth.left.height), board.corners, views)
    true = StereoParameters.from_calibration(truth)
    points = grid_of(truth, distance)
    rows, depth = errors_at(found.calibration, truth, *points)
    covariance = found.covariance
    change = found.parameters.vector - true.vector
    ends = np.concatenate([found.parameters.left[:2] / true.left[:2],
                           found.parameters.right[:2] / true.right[:2]])
    return Outcome(depth, covariance.depth_std(found.calibration, *points), rows,
                   covariance.rows_std(found.calibration, *points),
                   change / np.sqrt(np.diag(found.matrix)), _rms(ends - 1), found.scale,
                   len(found.dropped))


def errors_at(calibration, truth, x, y, Z):
    """
    Return errors of rows, px, and of the depth, m, both float64 (P,).

    Parameters
    ----------
    calibration, truth : StereoCalibration
        What was found and what is true.
    x, y, Z : numpy.ndarray, float64, shape (P,)
        px in the true rectified left image, and m.

    """
    geometry, true = calibration.geometry, truth.geometry
    seen = np.column_stack([(x - true.center_x_left) / true.focal_x * Z,
                            (y - true.center_y) / true.focal_y * Z, Z])
    points = seen @ truth.left.R
    parameters = StereoParameters.from_calibration(truth)
    lens = LENSES[parameters.distortion_model]
    raw = (lens.project(points, parameters.left)[0],
           lens.project(points @ parameters.matrix.T + parameters.translation,
                        parameters.right)[0])
    left, right = (rectified(camera, pixels) for camera, pixels in zip(
        (calibration.left, calibration.right), raw))
    depth = geometry.focal_baseline / (left[:, 0] - right[:, 0] - geometry.principal_offset)
    return left[:, 1] - right[:, 1], depth - (points @ calibration.left.R.T)[:, 2]


def study(kind, seeds, width=640, **electronics):
    """Yield the Outcome of each seed, with `VIEWS` guided views."""
    truth, board = rig(width), Board.usual(kind)
    poses = poses_for(truth, board)
    for seed in seeds:
        seen = views_of(truth, board, held(poses, board, seed), seed, **electronics)
        yield outcome(truth, board, seen)


def summary(outcomes):
    """Return the figures of some Outcome, a dict of name to (value, unit)."""
    def all_of(name):
        return np.concatenate([np.atleast_1d(getattr(each, name)) for each in outcomes])

    depth, rows = all_of('depth') / all_of('depth_std'), all_of('rows') / all_of('rows_std')
    return {
        'focal length': (100 * _rms(all_of('focal')), '%'),
        'rows': (_rms(all_of('rows')), 'px'),
        'Z': (100 * _rms(all_of('depth')) / DISTANCE, '%'),
        'Z, mean over the seeds': (100 * _rms(np.mean([each.depth for each in outcomes], 0))
                                   / DISTANCE, '%'),
        'parameters within 3 sigma': (float(np.mean(np.abs(all_of('parameters')) < 3)), ''),
        'rows and Z within 3 sigma': (float(np.mean(np.abs([depth, rows]) < 3)), ''),
        'z68 of the parameters': (float(np.percentile(np.abs(all_of('parameters')), 68)), ''),
        'z68 of Z': (float(np.percentile(np.abs(depth), 68)), ''),
        'z68 of rows': (float(np.percentile(np.abs(rows), 68)), ''),
        'scatter of the residuals': (float(np.mean(all_of('scale'))), 'sigma of the corners'),
        'views dropped': (float(np.mean(all_of('dropped'))), 'a calibration')}


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def main(argv=None):
    """Print the figures."""
    parser = argparse.ArgumentParser(
        description=f'Errors of calibrations from rendered images of {VIEWS} guided views.')
    parser.add_argument('--kind', default='charuco' if is_available() else 'chessboard',
                        choices=('charuco', 'chessboard'))
    parser.add_argument('--seeds', type=int, default=2, metavar='N',
                        help='each takes about 20 s at 640 columns')
    parser.add_argument('--width', type=int, default=640, metavar='N', help='columns')
    args = parser.parse_args(argv)
    outcomes = []
    for each in study(args.kind, range(args.seeds), args.width):
        outcomes.append(each)
        depth = 100 * _rms(each.depth) / DISTANCE
        print(f'seed {len(outcomes)} of {args.seeds}: Z {depth:.4f} %, '
              f'rows {_rms(each.rows):.4f} px', file=sys.stderr, flush=True)
    found = summary(outcomes)
    print(f'{args.kind}, {args.width} columns, {args.seeds} seeds')
    for name, (value, unit) in found.items():
        print(f'{name:28}{value:9.4f} {unit}')


if __name__ == '__main__':
    main()
