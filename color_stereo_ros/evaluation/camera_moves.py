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
How small moves of a camera during a calibration are found: simulated sessions.

    python -m color_stereo_ros.evaluation.camera_moves [--sessions N] [--sigma PX ...]

Corners of guided views, as a hand meets them, get normal noise; before one of the views the right
camera is turned about a random axis. Sessions at rest say how often a move is named that was
none: plain ones, ones with bad views anywhere or last, with corners that claim too much, and of a
rough board. The constants of `calibration.moves` are chosen from this table.

"""

import argparse
from dataclasses import dataclass

import cv2
import numpy as np

from .calibration import held, poses_for, VIEWS
from .corners import rig
from ..calibration.adjustment import adjust
from ..calibration.board_kind import Detection
from ..calibration.boards import Board
from ..calibration.moves import evidence_of, place_of
from ..calibration.views import LEAST_CORNERS, SIDES, View
from ..core.cameras.lenses import LENSES
from ..core.cameras.parameters import StereoParameters
from ..errors import CalibrationError

TURNS = 0.01, 0.02, 0.03, 0.1, 0.3  # degrees
SIGMAS = 0.003, 0.05                # px: rendered images of this package, usual detectors
AT_REST = 'at rest', 'bad views', 'bad end', 'bold corners', 'rough board'
BAD = 2, 10.0                       # views, and factor of their noise
BOLD = 2.5                          # factor by which corners claim too much
ROUGH = 2e-4                        # m, standard deviation of the height of each corner
HEAD = ('| session | sigma, px | named | elsewhere | not told | refused otherwise | step over '
        'scatter | step, rad | scatter of all | sides over all |\n'
        '|---|---|---|---|---|---|---|---|---|---|')


@dataclass(frozen=True)
class Session:
    """What came out of one session."""

    truth: int | None
    """The first view after the move; None: at rest."""
    found: int | None
    """The same as named."""
    refused: bool
    """The views were refused for another reason."""
    evidence: object
    """MoveEvidence, or None."""


def seen(truth, corners, poses, generator, sigmas, claim, names):
    """Return the views of a board in some poses, list of View; sigmas, px: one for each view."""
    lens, views = LENSES[truth.distortion_model], []
    for name, pose, sigma in zip(names, poses, sigmas):
        left = pose.to_parent(corners)
        points = {'left': left, 'right': left @ truth.matrix.T + truth.translation}
        found = {}
        for side in SIDES:
            pixels = lens.project(points[side], getattr(truth, side))[0]
            ids = np.flatnonzero(((pixels > 4) & (pixels < np.array(truth.size) - 5)).all(1))
            if len(ids) >= LEAST_CORNERS:
                noisy = pixels[ids] + generator.normal(0, sigma, (len(ids), 2))
                found[side] = Detection(ids, noisy, np.full(len(ids), claim))
        views.append(View(name, **found))
    return views


def turned(truth, degrees, generator):
    """Return StereoParameters after a turn of the right camera about a random axis."""
    axis = generator.normal(size=3)
    turn = cv2.Rodrigues(np.radians(degrees) * axis / np.linalg.norm(axis))[0]
    vector = truth.vector.copy()
    vector[-6:-3] = cv2.Rodrigues(turn @ truth.matrix)[0].ravel()
    vector[-3:] = turn @ truth.translation
    return truth.changed(vector)


def session(board, poses, kind, sigma, seed):
    """
    Return the Session of one seed.

    Parameters
    ----------
    board : Board
        The calibration board.
    poses : list of Pose
        As the guidance asks for them.
    kind : str or float
        One of `AT_REST`, or by how many degrees the camera is turned.
    sigma : float
        Noise of the corners, px.
    seed : int
        Of hands, noise and move.

    """
    generator, truth = np.random.default_rng([seed, 18]), rig_parameters()
    poses = held(poses, board, seed)
    corners, sigmas = board.corners.copy(), np.full(len(poses), sigma)
    if kind == 'bad views':
        sigmas[generator.choice(len(poses), BAD[0], replace=False)] *= BAD[1]
    if kind == 'bad end':
        sigmas[-BAD[0]:] *= BAD[1]
    if kind == 'rough board':
        corners[:, 2] += generator.normal(0, ROUGH, len(corners))
    claim = sigma / BOLD if kind == 'bold corners' else sigma
    names = [f'{number:02d}' for number in range(len(poses))]
    place, after = None, truth
    if kind not in AT_REST:
        place = int(generator.integers(2, len(poses) - 1))
        after = turned(truth, kind, generator)
    views = seen(truth, corners, poses[:place], generator, sigmas[:place], claim, names[:place])
    if place is not None:
        views += seen(after, corners, poses[place:], generator, sigmas[place:], claim,
                      names[place:])
    try:
        adjustment = adjust(truth.size, board.corners, views)
    except CalibrationError:
        return Session(place, None, True, None)
    pairs, evidence = evidence_of(board, views, adjustment)
    found = place_of(evidence)
    return Session(place, None if found is None else int(pairs[found].name), False, evidence)


def rig_parameters():
    """Return the StereoParameters of the rig of the corner study."""
    return StereoParameters.from_calibration(rig(640))


def line(kind, sigma, sessions):
    """Return a line of the table."""
    told = [each for each in sessions if each.found is not None]
    named = sum(each.found == each.truth for each in told)
    silent = sum(each.found is None and not each.refused for each in sessions)
    known = [each.evidence for each in sessions if each.evidence is not None]
    name = kind if kind in AT_REST else f'{kind} degrees'
    columns = [quantiles([each.step / each.scatter for each in known if each.run is not None]),
               quantiles([each.step for each in known if each.run is not None]),
               quantiles([each.scale for each in known]),
               quantiles([each.sides / each.scale for each in known if each.sides])]
    return (f'| {name} | {sigma} | {named} | {len(told) - named} | {silent} | '
            f'{sum(each.refused for each in sessions)} | ' + ' | '.join(columns) + ' |')


def quantiles(values):
    """Return least, middle and largest of some values and their number, a text."""
    values = np.asarray(values, np.float64)
    values = values[np.isfinite(values)]
    if not values.size:
        return '-'
    return ' '.join(f'{each:.2g}' for each in np.percentile(values, (0, 50, 100))) + (
        f' ({len(values)})')


def main(argv=None):
    """Print the table."""
    parser = argparse.ArgumentParser(
        description='How small moves of a camera during a calibration are found.')
    parser.add_argument('--sessions', type=int, default=40, metavar='N', help='of each line')
    parser.add_argument('--sigma', type=float, nargs='+', default=SIGMAS, metavar='PX',
                        help='noise of the corners')
    args = parser.parse_args(argv)
    board = Board.usual('chessboard')
    poses = poses_for(rig(640), board)
    print(f'{VIEWS} views, {args.sessions} sessions a line; least, middle, largest (number)\n')
    print(HEAD, flush=True)
    for sigma in args.sigma:
        for kind in (*AT_REST, *TURNS):
            sessions = [session(board, poses, kind, sigma, seed)
                        for seed in range(args.sessions)]
            print(line(kind, sigma, sessions), flush=True)


if __name__ == '__main__':
    main()
