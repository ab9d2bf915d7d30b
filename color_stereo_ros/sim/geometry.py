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
"""Poses of the simulated rig, in double precision."""

from dataclasses import dataclass

import cv2
import numpy as np


def rotation_from_degrees(angles):
    """Return the rotation matrix Rz Ry Rx of angles (x, y, z) in degrees about fixed axes."""
    matrices = [cv2.Rodrigues(np.radians(angle) * np.eye(3)[axis])[0]
                for axis, angle in enumerate(np.asarray(angles, np.float64))]
    return matrices[2] @ matrices[1] @ matrices[0]


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid motion: X_parent = rotation @ X_child + position."""

    rotation: np.ndarray
    """float64 (3, 3)."""
    position: np.ndarray
    """float64 (3,), m."""

    @classmethod
    def from_degrees(cls, position, rotation):
        """Build from a position in m and fixed-axis angles x, y, z in degrees."""
        return cls(rotation_from_degrees(rotation), np.asarray(position, np.float64))

    def __matmul__(self, other):
        """Return the pose of the child of a child."""
        return Pose(self.rotation @ other.rotation, self.to_parent(other.position))

    def to_parent(self, points):
        """Return points (..., 3) of the child frame in the parent frame."""
        return np.asarray(points) @ self.rotation.T + self.position

    def to_child(self, points):
        """Return points (..., 3) of the parent frame in the child frame."""
        # einsum: for 3-vectors the threads of a BLAS cost more than they save
        return np.einsum('...i,ij->...j', np.asarray(points, np.float64) - self.position,
                         self.rotation)

    def inverse(self):
        """Return the pose of the parent in the child frame."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position)

    @property
    def matrix(self):
        """Return the homogeneous 4 x 4 matrix."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.position
        return matrix
