# SPDX-License-Identifier: Apache-2.0
"""Poses and lens distortion of the simulated rig, in double precision."""

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
        # einsum: millions of 3-vectors are no work for the threads of a BLAS
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


def distort(rays, model, D):
    """
    Apply lens distortion to normalized image coordinates.

    Parameters
    ----------
    rays : numpy.ndarray, float64, shape (N, 2)
        X/Z and Y/Z.
    model : str
        plumb_bob, rational_polynomial or equidistant.
    D : numpy.ndarray, float64
        Coefficients in OpenCV's order; empty or zero = none.

    Returns
    -------
    distorted : numpy.ndarray, float64, shape (N, 2)

    """
    if model == 'equidistant':
        coefficients = np.zeros(4) if D.size == 0 else D
        return cv2.fisheye.distortPoints(rays[None], np.eye(3), coefficients)[0]
    if not np.any(D):
        return rays
    points = np.column_stack([rays, np.ones(len(rays))])
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), D)[0][:, 0]


def undistort(pixels, K, model, D):
    """Return the normalized coordinates (N, 2) seen by raw pixels (N, 2) of a camera."""
    if model == 'equidistant':
        coefficients = np.zeros(4) if D.size == 0 else D
        return cv2.fisheye.undistortPoints(pixels[None], K, coefficients)[0]
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    if hasattr(cv2, 'undistortPointsIter'):
        return cv2.undistortPointsIter(pixels[None], K, D, np.eye(3), np.eye(3), criteria)[:, 0]
    return cv2.undistortPoints(pixels[None], K, D, None, None, None, criteria)[:, 0]
