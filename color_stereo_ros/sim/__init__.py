# SPDX-License-Identifier: Apache-2.0
"""The simulated rig: a projector and two cameras in front of a scene, with exact truth."""

from .errors import SceneError, SimulatorMissingError
from .renderer import render, Renderer, Rendering
from .scene import load_scene, rig_names, Scene, scene_names
from .truth import Truth

__all__ = ['Renderer', 'Rendering', 'Scene', 'SceneError', 'SimulatorMissingError', 'Truth',
           'load_scene', 'render', 'rig_names', 'scene_names']
