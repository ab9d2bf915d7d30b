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
"""Pairs of disturbed rigs with truth, for the fits: the light of `evaluate --stress`."""

from .pairs import Pair
from ..stress.disturbances import DISTURBANCES
from ..stress.light import LightScenes
from ..stress.shot import Shots
from ...core import Settings

SCENES = 'casting', 'effector_bin'
APERIODIC = ('blur_right', 'blur_both', 'motion_right', 'jpeg', 'full_well', 'exposure', 'ambient',
             'worn')
"""The default pattern, named truthfully."""

DETAILED = 'unknown', 'sine_16_unknown', 'sweep_unknown', 'patches', 'speckle_pattern', 'passive'
"""What is measured by brightness, too."""

SLOW = 'gray', 'sine_1', 'sine_1_unknown', 'sweep'


def lit_pairs(scenes, cases, options):
    """
    Return the pairs of scenes under the hardest step of some disturbances.

    Parameters
    ----------
    scenes : sequence of str
        Of `stress.light.SCENES`.
    cases : sequence of str
        Of `stress.disturbances.DISTURBANCES`; or (str, level), which is not the hardest step.
    options : color_stereo_ros.evaluation.fits.run.Options
        `light` keeps the light, `cache` where there is none.

    Returns
    -------
    pairs : list of Pair
        The name of each is that of its disturbance.

    """
    kept = LightScenes(options.light or options.cache, samples=1 if options.quick else 2)
    return [pair_of(shots, case) for name in options.progress(scenes)
            for shots in (Shots(kept.scene(name), options.seed),) for case in cases]


def pair_of(shots, case):
    """Return the Pair of a scene under the hardest step of a disturbance; see `lit_pairs`."""
    case, level = (case, None) if isinstance(case, str) else case
    disturbance = DISTURBANCES[case]
    rig = disturbance.rig(disturbance.levels[-1] if level is None else level)
    left, right = shots.pair(rig)
    truth, scene = shots.truth(rig.mounting), shots.scene
    near, far = scene.depth_limits
    settings = Settings().updated({'range.min_depth': near, 'range.max_depth': far,
                                   **rig.settings})
    return Pair(case, scene.calibration, settings, left, right, truth.disparity, truth.visible,
                truth.lit & ~truth.visible, scene=scene.name)
