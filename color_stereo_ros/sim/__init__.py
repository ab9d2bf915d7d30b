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
"""The simulated rig: a projector and two cameras in front of a scene, with exact truth."""

from .errors import SceneError, SimulatorMissingError
from .renderer import render, Renderer, Rendering
from .scene import load_scene, rig_names, Scene, scene_names
from .truth import Truth

__all__ = ['Renderer', 'Rendering', 'Scene', 'SceneError', 'SimulatorMissingError', 'Truth',
           'load_scene', 'render', 'rig_names', 'scene_names']
