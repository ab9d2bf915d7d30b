# SPDX-License-Identifier: Apache-2.0
"""
What the projector as a third view adds, on scenes with truth.

`python -m color_stereo_ros.evaluation.third_view --light FOLDER` prints a table.

"""

import numpy as np

from ..core import make_pattern, PatternSettings
from ..core.projector.model import COUNT, ProjectorModel


def true_projector(rig, pattern=None):
    """Return the exact ProjectorModel of a simulated rig."""
    height, width = (make_pattern(PatternSettings()) if pattern is None else pattern).shape[:2]
    projector, camera = rig.projector, rig.left
    focal = projector.focal_length(width)
    camera_matrix = np.array([[focal, 0, width / 2 - 0.5],
                              [0, focal, height / 2 + projector.offset * height - 0.5], [0, 0, 1]])
    # X_rig = R_left R_rect^T X + p_left;  Y = R_p^T (X_rig - p_p)
    to_rig = camera.pose.rotation @ rig.calibration.left.R.T
    rotation = projector.pose.rotation.T @ to_rig
    translation = projector.pose.to_child(camera.pose.position)
    return ProjectorModel(camera_matrix, 0.0, rotation, translation, (width, height),
                          np.zeros((COUNT, COUNT)))
