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
"""A small move of a camera between two views is named, and nothing else is taken for one."""

from types import SimpleNamespace

from board_views import CORNERS, guided_poses, random_poses, rig, seen, SIZE
from color_stereo_ros.calibration.adjustment import adjust
from color_stereo_ros.calibration.boards import Board
from color_stereo_ros.calibration.moves import check_moved, end_of_run, is_step, step_of
from color_stereo_ros.errors import CalibrationError
from color_stereo_ros.evaluation import corners
from color_stereo_ros.evaluation.calibration import poses_for
from color_stereo_ros.evaluation.camera_moves import line, session
import cv2
import numpy as np
import pytest

BOARD = SimpleNamespace(corners=CORNERS)
COUNT = 14


def turned(parameters, degrees):
    """Return StereoParameters after a turn of the right camera."""
    turn = cv2.Rodrigues(np.radians(degrees) * np.array([0.3, 0.9, 0.3]))[0]
    vector = parameters.vector.copy()
    vector[-6:-3] = cv2.Rodrigues(turn @ parameters.matrix)[0].ravel()
    vector[-3:] = turn @ parameters.translation
    return parameters.changed(vector)


def checked(poses, degrees, place, sigma=0.005, seed=1):
    """Check the views of poses, between which the right camera was turned."""
    random, truth = np.random.default_rng(seed), rig()
    before, after = (seen(each, poses, random, sigma) for each in (truth, turned(truth, degrees)))
    views = before[:place] + after[place:]
    check_moved(BOARD, views, adjust(SIZE, CORNERS, views))


@pytest.fixture(scope='module')
def guided():
    """Return guided poses."""
    return guided_poses(rig(), COUNT)


@pytest.mark.parametrize('degrees, place', [(0.3, 7), (0.03, 7), (0.1, 4), (0.1, 10), (0.3, 2)])
def test_a_small_move_is_named(guided, degrees, place):
    with pytest.raises(CalibrationError, match=f'moved between {place - 1:03d} and {place:03d}'):
        checked(guided, degrees, place)


def test_views_of_a_rig_at_rest_pass(effort):
    for seed in effort.seeds(2, 40):
        checked(random_poses(rig(), 10, np.random.default_rng(seed)), 0.0, 5, 0.05, seed)


def test_bad_views_here_and_there_are_no_move():
    assert end_of_run([False, False, True, False, True, False]) is None
    assert end_of_run([False, False, False, False, True]) is None
    assert end_of_run([False, False, False, True, True]) == 3
    assert end_of_run([True, True, False, False]) == 2
    assert end_of_run(6 * [False]) is None


def test_views_without_a_pose_hide_no_step():
    """Eight corners of one row of the board tell no pose."""
    random = np.random.default_rng(1)
    motions = [SimpleNamespace(center=np.array([0.2, 0, 0]) + random.normal(0, 1e-5, 3),
                               rotation=random.normal(0, 1e-5, 3) + 1e-3 * (number > 4))
               for number in range(10)]
    assert is_step(*step_of(motions, 5)) and not is_step(*step_of(motions[:5], 2))
    none = np.full(3, np.nan)
    motions[2] = motions[7] = SimpleNamespace(center=none, rotation=none)
    assert is_step(*step_of(motions, 5))
    assert not is_step(*step_of(2 * [motions[2]] + motions[5:], 2))


def test_the_study_counts_what_is_named():
    board = Board.usual('chessboard')
    poses = poses_for(corners.rig(640), board)
    moved, still = (session(board, poses, kind, 0.003, 1) for kind in (0.1, 'at rest'))
    assert moved.truth is not None and moved.found == moved.truth and not moved.refused
    assert still.truth is None and still.found is None and 0.9 < still.evidence.scale < 1.1
    assert line(0.1, 0.003, [moved]).startswith('| 0.1 degrees | 0.003 | 1 | 0 | 0 | 0 |')
    assert line('at rest', 0.003, [still]).startswith('| at rest | 0.003 | 0 | 0 | 1 | 0 |')
