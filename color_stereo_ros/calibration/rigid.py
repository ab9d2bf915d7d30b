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
"""
Rigid motions as arrays: many rotations and poses at once, float64.

A motion is a pair (R, t): R (..., 3, 3), t (..., 3) in meters. `a_from_b` maps coordinates of b to
those of a. Rotation vectors are axis times angle, rad.

"""

import numpy as np

SMALL = 1e-9  # rad; derived: the second order of the sine is below the rounding there


def exp(vectors):
    """Return the rotations (..., 3, 3) of rotation vectors (..., 3): Rodrigues' formula."""
    vectors = np.asarray(vectors, np.float64)
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    cross = skew(vectors)
    safe = np.maximum(angle, SMALL)
    first = np.where(angle < SMALL, 1.0, np.sin(safe) / safe)
    second = 2 * np.square(np.sin(safe / 2) / safe)  # (1 - cos a) / a^2, without cancellation
    return np.eye(3) + first * cross + second * cross @ cross


def log(rotations):
    """Return the rotation vectors (..., 3), angle at most pi, of rotations (..., 3, 3)."""
    quaternions = quaternions_of(rotations)
    quaternions = quaternions * np.where(quaternions[..., 3:] < 0, -1.0, 1.0)
    axis, real = quaternions[..., :3], quaternions[..., 3]
    sine = np.linalg.norm(axis, axis=-1)
    factor = np.where(sine < SMALL, 2.0, 2 * np.arctan2(sine, real) / np.maximum(sine, SMALL))
    return factor[..., None] * axis


def skew(vectors):
    """Return the matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    vectors = np.asarray(vectors, np.float64)
    made = np.zeros((*vectors.shape[:-1], 3, 3))
    for row, column, at, sign in ((2, 1, 0, 1), (0, 2, 1, 1), (1, 0, 2, 1),
                                  (1, 2, 0, -1), (2, 0, 1, -1), (0, 1, 2, -1)):
        made[..., row, column] = sign * vectors[..., at]
    return made


def quaternions_of(rotations):
    """
    Return the unit quaternions (..., 4) as x, y, z, w of rotations (..., 3, 3).

    They are eigenvectors of a symmetric matrix (Bar-Itzhack 2000), which is exact at any angle
    and takes the nearest rotation where R has rounding errors.

    """
    R = np.asarray(rotations, np.float64)
    matrix = np.empty((*R.shape[:-2], 4, 4))
    trace = np.trace(R, axis1=-2, axis2=-1)[..., None, None]
    matrix[..., :3, :3] = R + np.swapaxes(R, -1, -2) - trace * np.eye(3)
    axis = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0],
                     R[..., 1, 0] - R[..., 0, 1]], axis=-1)
    matrix[..., 3, :3] = matrix[..., :3, 3] = axis
    matrix[..., 3, 3] = trace[..., 0, 0]
    return np.linalg.eigh(matrix)[1][..., -1]


def rotations_of(quaternions):
    """Return the rotations (..., 3, 3) of unit quaternions (..., 4), x, y, z, w."""
    quaternions = np.asarray(quaternions, np.float64)
    axis, real = quaternions[..., :3], quaternions[..., 3, None, None]
    outer = axis[..., :, None] * axis[..., None, :]
    square = np.sum(axis * axis, axis=-1)[..., None, None]
    return (real * real - square) * np.eye(3) + 2 * outer + 2 * real * skew(axis)


def product(first, second):
    """Return the motion a_from_c of a_from_b and b_from_c."""
    R, t = first
    return R @ second[0], apply(R, second[1]) + t


def inverse(motion):
    """Return b_from_a of a_from_b."""
    R, t = motion
    back = np.swapaxes(R, -1, -2)
    return back, -apply(back, t)


def apply(R, vectors):
    """Return rotated vectors (..., 3)."""
    return np.einsum('...ij,...j', R, vectors)


def moved(motion, step):
    """Return a motion after a small step (..., 6): exp(step[:3]) R, t + step[3:]."""
    R, t = motion
    return exp(step[..., :3]) @ R, t + step[..., 3:]


def mean_rotation(rotations):
    """Return the rotation (3, 3) with the least sum of squared distances to some (n, 3, 3)."""
    left, _, right = np.linalg.svd(np.sum(rotations, axis=0))
    return left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
