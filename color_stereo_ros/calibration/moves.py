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
Whether a camera was moved a little between two views: found after an adjustment.

The simple camera of `suspicions` does not see moves of less than half a degree. An adjustment
does: it drops the views of the smaller side whole, or its residuals grow, and those of each side
alone do not.

"""

from dataclasses import dataclass

import cv2
import numpy as np

from .adjustment import adjust
from .suspicions import motions_of, moved_between, SEGMENT
from ..core.cameras.lenses import LENSES
from ..errors import CalibrationError

# Chosen from `evaluation.camera_moves`, the table of docs/calibration.md.
STEP = 5.0          # times the scatter on either side: motions that make a step; two bad views at
#                     the end reach 4.5 in 124 sessions
LEAST_STEP = 1e-4   # rad and of the baseline, .006 degrees: less is no move; .01 degrees, the
#                     least that is found under .003 px, show 1.7e-4
CORNERS = 8         # of a view that takes part here; a pose takes 4, two more rows tell its errors
LOOSE = 1.2         # scatter of the residuals over what the corners say, of a suspicious fit; at
#                     rest up to 1.05, a turn of .03 degrees under .05 px 1.0 to 1.4
SIDE = 4            # pairs that a side needs to be adjusted alone; one more than the least
BETTER = 0.8        # of that scatter: both sides must stay below; at rest, the best split of a
#                     loose fit leaves .99 and more
PLACES = 9          # splits that are tried first


@dataclass(frozen=True)
class MoveEvidence:
    """What speaks for a move; see `place_of`."""

    run: int | None
    """The first pair after the views of one side, which were dropped; None: no such run."""
    step: float
    """By how much the motion between the cameras differs there, rad and of the baseline."""
    scatter: float
    """Of the motions on either side."""
    scale: float
    """Scatter of the residuals of all views over what the corners say."""
    split: int | None
    """The first pair after the best split, where the fit of all is loose; None: not tried."""
    sides: float
    """Scatter of the worse side of that split alone; 0: not tried."""


def check_moved(board, views, adjustment):
    """
    Refuse views between which a camera was moved.

    Parameters
    ----------
    board : Board
        The calibration board.
    views : list of View
        In the order in which they were taken.
    adjustment : Adjustment
        Of all of them.

    Raises
    ------
    CalibrationError
        Names the views.

    """
    pairs, evidence = evidence_of(board, views, adjustment)
    place = place_of(evidence)
    if place is not None:
        raise moved_between(pairs[place - 1].name, pairs[place].name)


def evidence_of(board, views, adjustment):
    """Return the views that take part, list of View, and a MoveEvidence; see `check_moved`."""
    pairs = [view for view in views
             if view.is_pair and min(len(view.left.ids), len(view.right.ids)) >= CORNERS]
    run = end_of_run([view.name in adjustment.dropped for view in pairs])
    step, scatter = 0.0, np.inf
    if run is not None:
        step, scatter = step_of(_motions(board, pairs, adjustment.parameters), run)
    split, sides = None, 0.0
    if not is_step(step, scatter) and adjustment.scale > LOOSE:
        split, sides = _split(board, pairs, adjustment)
    return pairs, MoveEvidence(run, step, scatter, adjustment.scale, split, sides)


def place_of(evidence):
    """Return the first pair after a move, or None."""
    if is_step(evidence.step, evidence.scatter):
        return evidence.run
    return evidence.split if evidence.sides < BETTER * evidence.scale else None


def end_of_run(dropped):
    """Return the place between views of which all before, or all after, were dropped, or None."""
    for place in range(SEGMENT, len(dropped) - SEGMENT + 1):
        if len({*dropped[:place]}) == len({*dropped[place:]}) == 1:
            return place if dropped[0] != dropped[-1] else None
    return None


def is_step(step, scatter):
    """Return whether a step of motions is large against their scatter; see `step_of`."""
    return step > max(LEAST_STEP, STEP * scatter)


def step_of(motions, place):
    """
    Return the step that motions make at a place, and their scatter on either side.

    Parameters
    ----------
    motions : list of Motion
        Between two views each.
    place : int
        The first motion after the step.

    Returns
    -------
    step, scatter : float
        rad and of the baseline; 0 and infinite where a side has no motion.

    """
    values = np.array([[*each.center, *each.rotation] for each in motions])
    values[:, :3] /= np.linalg.norm(np.nanmedian(values[:, :3], axis=0))
    # corners of one row of the board give no pose
    parts = [part[np.isfinite(part).all(axis=1)] for part in (values[:place], values[place:])]
    if not all(map(len, parts)):
        return 0.0, np.inf
    middles = [np.median(part, axis=0) for part in parts]
    scatter = max(float(np.median(np.linalg.norm(part - middle, axis=1)))
                  for part, middle in zip(parts, middles))
    return float(np.linalg.norm(middles[1] - middles[0])), scatter


def _motions(board, pairs, parameters):
    """Return the Motion of each pair through calibrated lenses."""
    lens = LENSES[parameters.distortion_model]
    return motions_of(*([_pose(board, getattr(pair, side), lens, getattr(parameters, side))
                         for pair in pairs] for side in ('left', 'right')))


def _pose(board, detection, lens, values):
    """Return rotation and translation of the board before a calibrated camera."""
    K = np.array([[values[0], 0, values[2]], [0, values[1], values[3]], [0, 0, 1.0]])
    rays, points = lens.undistort(detection.pixels, K, values[4:]), board.corners[detection.ids]
    _, turn, shift = cv2.solvePnP(points, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    turn, shift = cv2.solvePnPRefineLM(points, rays, np.eye(3), None, turn, shift)
    return cv2.Rodrigues(turn)[0], shift.ravel()


def _split(board, pairs, adjustment):
    """Return the split whose worse side fits best alone, and its scatter; None, 0: none."""
    places = range(SIDE, len(pairs) - SIDE + 1)
    if not places:
        return None, 0.0
    scatters = {}

    def scatter(place):
        if place not in scatters:
            scatters[place] = max(_scatter(board, side, adjustment)
                                  for side in (pairs[:place], pairs[place:]))
        return scatters[place]

    tried = np.unique(np.linspace(places[0], places[-1], PLACES).astype(int)).tolist()
    best = min(tried, key=scatter)
    while True:
        near = min((place for place in (best - 1, best, best + 1) if place in places),
                   key=scatter)
        if near == best:
            break
        best = near
    return best, scatter(best)


def _scatter(board, pairs, adjustment):
    """Return the scatter of the residuals of some pairs alone; infinite if they are too few."""
    parameters = adjustment.parameters
    try:
        found = adjust(parameters.size, board.corners, pairs, parameters.distortion_model)
    except CalibrationError:
        return np.inf
    return np.inf if found.dropped else found.scale
