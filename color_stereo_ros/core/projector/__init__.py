# SPDX-License-Identifier: Apache-2.0
"""The projector as a third view: its geometry, found and followed in the pairs themselves."""

from .features import left_right_pairs, PatternFeatures
from .finding import Finding, ProjectorFinder, Reason
from .model import ProjectorModel
from .patches import Measured
from .tracking import ProjectorTracker, Track

__all__ = ['Finding', 'Measured', 'PatternFeatures', 'ProjectorFinder', 'ProjectorModel',
           'ProjectorTracker', 'Reason', 'Track', 'left_right_pairs']
