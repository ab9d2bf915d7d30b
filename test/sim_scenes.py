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
"""Small scenes and patterns for the tests of the simulated rig."""

import os

# One variant for the whole process, without the seconds that compiling takes; LLVM has its test.
os.environ.setdefault('COLOR_STEREO_SIM_VARIANT', 'scalar_rgb')

import cv2  # noqa: E402

import numpy as np  # noqa: E402

from color_stereo_ros.sim import load_scene  # noqa: E402, I100

SIZE = 96
CARD = {'shape': 'plane', 'position': [0, 0, 0.4], 'size': [2.0, 2.0]}
BALL = {'shape': 'sphere', 'position': [0.02, 0, 0.33], 'radius': 0.03}
QUIET = {'full_well': 1e7, 'read_noise': 0, 'speckle': 0}


def small_rig(projector=None, base='paper', **cameras):
    """Return the description of a rig with 96 x 96 px and the same field of view."""
    return {'base': base, 'cameras': {'width': SIZE, 'height': SIZE, 'focal': 120, **cameras},
            'projector': projector or {}}


def scene_of(*objects, rig=None, **fields):
    """Return a scene of objects before the small rig."""
    return load_scene({'objects': list(objects), 'rig': rig or small_rig(), **fields})


def smooth_pattern(height=192, width=256, seed=0):
    """Return a colored pattern without sharp edges, uint8 (H, W, 3)."""
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 8, width // 8, 3))
    return cv2.resize(coarse.astype(np.uint8), (width, height), interpolation=cv2.INTER_CUBIC)


def uniform(value, height=192, width=256):
    """Return a pattern of one color."""
    return np.full((height, width, 3), value, np.uint8)
