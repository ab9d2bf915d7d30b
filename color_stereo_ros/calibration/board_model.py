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
"""How a bent board in known poses appears in both cameras, with all derivatives."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..core.cameras.covariance import rotated_by_vector
from ..core.cameras.lenses import LENSES

BENDS = ('bend.x', 'bend.y')


@dataclass(frozen=True, eq=False)
class State:
    """Everything that an adjustment estimates."""

    parameters: object
    """StereoParameters."""
    bend: np.ndarray
    """float64 (2,), m: height of the middle of the board over its edges, along x and along y."""
    rotations: np.ndarray
    """float64 (V, 3, 3): X_left = R X_board + t of each view."""
    translations: np.ndarray
    """float64 (V, 3), m."""

    @property
    def shared(self):
        """Return what all views share, float64 (n + 2,): the parameters, then the bend."""
        return np.concatenate([self.parameters.vector, self.bend])

    def moved(self, shared, poses):
        """
        Return the state after a step.

        Parameters
        ----------
        shared : numpy.ndarray, float64, shape (n + 2,)
            What all views share: lenses, then the bends of the board.
        poses : numpy.ndarray, float64, shape (V, 6)
            Rotation vectors in the left camera, rad, and translations, m.

        """
        vector = self.parameters.vector + shared[:-2]
        turns = np.array([cv2.Rodrigues(turn)[0] for turn in poses[:, :3]]).reshape(-1, 3, 3)
        return State(self.parameters.changed(vector), self.bend + shared[-2:],
                     turns @ self.rotations, self.translations + poses[:, 3:])

    def of_views(self, chosen):
        """Return the state of some of the views, by index."""
        return replace(self, rotations=self.rotations[chosen],
                       translations=self.translations[chosen])


class BoardModel:
    """
    The projection of a board's corners.

    Parameters
    ----------
    corners : numpy.ndarray, float64, shape (N, 3)
        m, of the flat board, z = 0.

    """

    def __init__(self, corners):
        """Prepare the shapes of the bend."""
        self.corners = np.asarray(corners, np.float64)
        middle = (self.corners.max(0) + self.corners.min(0)) / 2
        half = np.maximum((self.corners.max(0) - self.corners.min(0)) / 2, 1e-9)
        # 1 in the middle, 0 at the edges
        self.shapes = 1.0 - ((self.corners - middle) / half)[:, :2]**2

    def bent(self, bend):
        """Return the corners of the bent board, float64 (N, 3), m."""
        corners = self.corners.copy()
        corners[:, 2] += self.shapes @ bend
        return corners

    def project(self, state, side, view, ids):
        """
        Project corners.

        Parameters
        ----------
        state : State
            What is estimated.
        side : str
            'left' or 'right'.
        view, ids : numpy.ndarray, int, shape (m,)
            View and corner of each point.

        Returns
        -------
        pixels : numpy.ndarray, float64, shape (m, 2)
        by_shared : numpy.ndarray, float64, shape (m, 2, n + 2)
            Derivatives by `State.shared`.
        by_pose : numpy.ndarray, float64, shape (m, 2, 6)
            Derivatives by the pose of the view, as `State.moved` takes it.

        """
        parameters = state.parameters
        lens = LENSES[parameters.distortion_model]
        rotations = state.rotations[view]
        turned = (rotations @ self.bent(state.bend)[ids][:, :, None])[:, :, 0]
        points = turned + state.translations[view]
        count = parameters.left.size
        by_shared = np.zeros((len(ids), 2, 2 * count + 8))
        if side == 'left':
            pixels, by_left, by_shared[:, :, :count] = lens.project(points, parameters.left)
        else:
            matrix = parameters.matrix
            pixels, by_right, by_shared[:, :, count:2 * count] = lens.project(
                points @ matrix.T + parameters.translation, parameters.right)
            by_shared[:, :, -8:-5] = by_right @ rotated_by_vector(parameters.rotation, points)
            by_shared[:, :, -5:-2] = by_right
            by_left = by_right @ matrix
        # d(exp(w) R X) / dw = -[R X]x
        by_pose = np.concatenate([np.cross(turned[:, None], by_left), by_left], axis=-1)
        normal = (by_left @ rotations)[:, :, 2]
        by_shared[:, :, -2:] = normal[:, :, None] * self.shapes[ids][:, None]
        return pixels, by_shared, by_pose
