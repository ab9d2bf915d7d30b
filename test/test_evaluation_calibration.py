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
"""Calibrations from rendered images: as near the truth as asked, and as they claim."""

from color_stereo_ros.calibration import charuco
from color_stereo_ros.calibration.guidance import grid_of
from color_stereo_ros.core.cameras.parameters import StereoParameters
from color_stereo_ros.evaluation.calibration import errors_at, study, summary
from color_stereo_ros.evaluation.corners import rig

import numpy as np
import pytest

KIND = 'charuco' if charuco.is_available() else 'chessboard'
BARS = {640: 0.02, 1280: 0.01}
"""Columns to the error of Z, %."""


@pytest.mark.long
def test_images_calibrate_to_their_bars(effort, figures):
    for width in BARS if effort.full else (640,):
        seeds = effort.seeds(3, 40 if width == 640 else 4)  # errors of one are all alike
        found = {name: value for name, (value, _) in summary(
            list(study(KIND, seeds, width))).items()}
        for name, goals in goals_of(width, effort.full).items():
            figures(f'calibration from images, {width} columns: {name}', found[name], '',
                    over=seeds, **goals)


def goals_of(width, full):
    """Return what figures have to reach; few seeds tell no z68."""
    goals = {'rows': {'at_most': 0.015}, 'Z': {'at_most': BARS[width]},
             'rows and Z within 3 sigma': {'at_least': 0.95}}
    for name, least in {'z68 of the parameters': 0.8, 'z68 of Z': 0.8, 'z68 of rows': 0.0}.items():
        goals[name] = {'at_least': least, 'at_most': 1.25} if full else {}
    return goals


def test_a_known_error_is_found():
    truth = rig()
    points = grid_of(truth, 0.35)
    rows, depth = errors_at(truth, truth, *points)
    assert np.abs(rows).max() < 1e-6 and np.abs(depth).max() < 1e-9
    parameters = StereoParameters.from_calibration(truth)
    vector = parameters.vector
    vector[-3:] *= 1.001  # the baseline alone
    rows, depth = errors_at(parameters.changed(vector).calibration(), truth, *points)
    assert depth == pytest.approx(0.001 * points[2], rel=1e-3)
    assert np.abs(rows).max() < 1e-6
