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
"""Simulated pairs with truth, for the fits."""

from dataclasses import dataclass

import numpy as np

from ..third_view import true_projector
from ...core import make_pattern, PatternSettings, Settings

SCENES = ('solids', 'prism', 'casting', 'nut', 'printed', 'thin', 'corner', 'bin', 'airplane',
          'tilt_50', 'effector_bench', 'effector_bin', 'effector_nut', 'effector_thin',
          'effector_approach', 'flat_250', 'flat_550', 'material_polished_brass',
          'material_brushed_steel')
QUICK_SCENES = 'solids', 'effector_thin', 'flat_550'


@dataclass(frozen=True, eq=False)
class Pair:
    """A pair of images with its truth."""

    name: str
    calibration: object
    """StereoCalibration."""
    settings: Settings
    left: np.ndarray
    """uint8 (H, W, 3), raw."""
    right: np.ndarray
    """uint8 (H, W, 3), raw."""
    disparity: np.ndarray
    """(H, W), px, NaN = nothing there."""
    visible: np.ndarray
    """bool (H, W), seen by both cameras and lit."""
    alone: np.ndarray
    """bool (H, W), seen by the left camera only."""
    projector: object = None
    """The exact ProjectorModel; None: not known."""
    scene: str = None
    """Where `name` is that of a disturbance."""


def simulated(name, pattern=PatternSettings(), cache=None, seed=1, quick=False):
    """
    Render a scene that comes with the package.

    Parameters
    ----------
    name : str
        Of the scene.
    pattern : PatternSettings
        Of the pattern that is projected.
    cache : path-like or None
        Folder that keeps what does not depend on the pattern.
    seed : int
        Of the camera noise.
    quick : bool
        One sample per pixel and no bounced light: worse pictures, soon there.

    Returns
    -------
    pair : Pair

    """
    from ...sim import load_scene
    from ...sim.renderer import Renderer
    scene = load_scene(name)
    renderer = Renderer(scene, samples=1 if quick else 3, indirect=False if quick else None,
                        cache=cache)
    rendering = renderer.render(make_pattern(pattern), seed=seed)
    near, far = scene.rig.depth_limits
    settings = Settings(pattern=pattern).updated(
        {'range.min_depth': near, 'range.max_depth': far})
    truth = rendering.truth
    return Pair(name, rendering.calibration, settings, rendering.left_rgb, rendering.right_rgb,
                truth.disparity, truth.visible, truth.seen_by_left_only,
                true_projector(scene.rig, (pattern.height, pattern.width)))
