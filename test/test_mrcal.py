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
"""The adjustment equals that of mrcal, whose figures .ci/mrcal_figures.py made."""

import json
from pathlib import Path

from board_views import CORNERS, mrcal_views, Seen, SIZE

from color_stereo_ros.calibration.adjustment import adjust
from color_stereo_ros.calibration.views import View

import numpy as np

FIGURES = Path(__file__).parent / 'data' / 'mrcal.json'


def test_the_parameters_are_those_of_mrcal(effort, figures):
    kept = json.loads(FIGURES.read_text())['parameters']
    seeds = effort.seeds(2, len(kept))
    differences = []
    for seed in seeds:
        observations, _ = mrcal_views(seed)
        ids, sigma = np.arange(len(CORNERS)), np.full(len(CORNERS), 0.05)
        views = [View(str(index), *(Seen(ids, side[..., :2].reshape(-1, 2), sigma)
                                    for side in pair))
                 for index, pair in enumerate(observations)]
        found = adjust(SIZE, CORNERS, views)
        assert all(kept_side.all() for kept_side in found.kept.values())
        differences.append((found.parameters.vector - kept[seed]) / found.covariance.std)
    figures('calibration: difference to mrcal', np.abs(differences).max(), 'sigma', over=seeds,
            at_most=0.01)
