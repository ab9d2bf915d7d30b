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
"""The physical parameters of a stereo pair as one vector, for estimates and covariances."""

from dataclasses import dataclass

import cv2
import numpy as np

from . import checks
from .calibration import StereoCalibration
from ...errors import CalibrationError

SIDES = ('left', 'right')
INTRINSICS = ('fx', 'fy', 'cx', 'cy')
MOTION = ('rotation.x', 'rotation.y', 'rotation.z',
          'translation.x', 'translation.y', 'translation.z')


@dataclass(frozen=True, eq=False)
class StereoParameters:
    """
    What a calibration estimates of a pair: two lenses and the motion between them.

    Raises
    ------
    CalibrationError
        If an array has a wrong shape or holds a value that is no finite number.

    """

    size: tuple
    """(width, height) of the raw images, px."""
    distortion_model: str
    """A name in `lenses.LENSES`; both cameras share it."""
    left: np.ndarray
    """float64 (4 + n,): fx, fy, cx, cy, px, then n distortion coefficients."""
    right: np.ndarray
    """float64 (4 + n,), as `left`."""
    rotation: np.ndarray
    """float64 (3,), rotation vector, rad: X_right = R X_left + t."""
    translation: np.ndarray
    """float64 (3,), t, m."""

    def __post_init__(self):
        """Convert to float64 arrays that cannot be written to; refuse wrong shapes."""
        object.__setattr__(self, 'size', checks.checked_size(self.size))
        for field, shape in (('left', (-1,)), ('right', (-1,)), ('rotation', (3,)),
                             ('translation', (3,))):
            values = checks.matrix(field, getattr(self, field), shape)
            checks.check_finite(field, values)
            values.setflags(write=False)
            object.__setattr__(self, field, values)
        if self.left.size != self.right.size or self.left.size < len(INTRINSICS):
            raise CalibrationError(f'left and right have {self.left.size} and {self.right.size} '
                                   'values, expected equal numbers of at least 4')

    @property
    def names(self):
        """Return the names of the values of `vector`, a tuple of str: 'left.fx', 'left.D[0]'."""
        coefficients = tuple(f'D[{index}]' for index in range(self.left.size - len(INTRINSICS)))
        return tuple(f'{side}.{name}' for side in SIDES
                     for name in INTRINSICS + coefficients) + MOTION

    @property
    def vector(self):
        """Return all values, float64 (n,): left, right, rotation, translation."""
        return np.concatenate([self.left, self.right, self.rotation, self.translation])

    @property
    def matrix(self):
        """Return the rotation as a matrix, float64 (3, 3)."""
        return cv2.Rodrigues(self.rotation)[0]

    @classmethod
    def from_vector(cls, size, distortion_model, vector):
        """
        Return the parameters of a vector.

        Parameters
        ----------
        size : (int, int)
            Width and height, px.
        distortion_model : str
            A name in `lenses.LENSES`.
        vector : array-like, shape (n,)
            As the property `vector`; both cameras have (n - 14) / 2 coefficients.

        Raises
        ------
        CalibrationError
            If the vector has an odd or too small number of values.

        """
        vector = np.asarray(vector, np.float64)
        each, rest = divmod(vector.size - len(MOTION), 2)
        if rest or each < len(INTRINSICS):
            raise CalibrationError(f'{vector.size} values are no stereo parameters, expected an '
                                   'even number of at least 14')
        return cls(size, distortion_model, *np.split(vector, [each, 2 * each, 2 * each + 3]))

    def changed(self, vector):
        """Return parameters of the same size and model with other values, float64 (n,)."""
        return self.from_vector(self.size, self.distortion_model, vector)

    @classmethod
    def from_calibration(cls, calibration):
        """
        Return the parameters of a calibration.

        Parameters
        ----------
        calibration : StereoCalibration
            Of the two cameras.

        Raises
        ------
        CalibrationError
            If raw images cannot be rectified with it, a K has a skew, or the cameras have
            different lens models.

        """
        rotation, translation = calibration.right_from_left
        cameras = calibration.left, calibration.right
        models = [camera.distortion_model for camera in cameras]
        if models[0] != models[1]:
            raise CalibrationError(f'left distortion_model is {models[0]}, right is {models[1]}; '
                                   'expected the same')
        for camera in cameras:
            if camera.K[0, 1]:
                raise CalibrationError(f'{camera.name} K[1] = {camera.K[0, 1]}: a skew is no '
                                       'parameter of the calibration, expected 0')
        most = max(camera.D.size for camera in cameras)
        lenses = [np.concatenate([camera.K[[0, 1, 0, 1], [0, 1, 2, 2]], camera.D,
                                  np.zeros(most - camera.D.size)]) for camera in cameras]
        return cls((calibration.left.width, calibration.left.height), models[0], *lenses,
                   cv2.Rodrigues(rotation)[0].ravel(), translation)

    def calibration(self):
        """
        Return the StereoCalibration; R and P are those of `StereoCalibration.from_arrays`.

        Raises
        ------
        CalibrationError
            If the values are no horizontal stereo pair.

        """
        (K_left, D_left), (K_right, D_right) = (
            (np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), D)
            for fx, fy, cx, cy, *D in (self.left, self.right))
        return StereoCalibration.from_arrays(
            self.size, K_left, D_left, K_right, D_right, self.matrix, self.translation,
            self.distortion_model)
