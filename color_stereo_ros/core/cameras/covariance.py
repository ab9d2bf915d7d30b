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
"""How well a calibration is known: its covariance, and what follows for depth and rows."""

from dataclasses import dataclass
import hashlib
from os import PathLike
from typing import Self

import cv2
import numpy as np

from .lenses import LENSES
from .parameters import SIDES, StereoParameters
from ...errors import CalibrationError
from ...files.atomic import write_text
from ...files.yaml import load_yaml, UnreadableError, yaml_text

DIGITS = 12      # of the values that a hash covers: rounding of other programs keeps them
SYMMETRY = 1e-6  # of the standard deviations: what rounding may leave


@dataclass(frozen=True, eq=False)
class StereoCovariance:
    """
    The covariance of the parameters of one calibration, the content of stereo_covariance.yaml.

    Raises
    ------
    CalibrationError
        If the matrix is no covariance of so many names.

    """

    names: tuple
    """str (n,), as `StereoParameters.names`."""
    matrix: np.ndarray
    """float64 (n, n), in the units of the parameters: px, 1, rad, m."""
    hashes: dict
    """'left' and 'right': the `camera_hash` of the cameras that the covariance belongs to."""

    def __post_init__(self):
        """Convert; refuse what is no covariance."""
        object.__setattr__(self, 'names', tuple(self.names))
        try:
            matrix = np.array(self.matrix, np.float64)
        except (TypeError, ValueError) as error:
            raise CalibrationError('the covariance holds values that are no numbers') from error
        _check_covariance(matrix, len(self.names))
        matrix.setflags(write=False)
        object.__setattr__(self, 'matrix', matrix)

    @classmethod
    def of(cls, calibration, matrix):
        """
        Return the covariance of a calibration.

        Parameters
        ----------
        calibration : StereoCalibration
            Of the two cameras.
        matrix : array-like, shape (n, n)
            In the order of `StereoParameters.from_calibration(calibration).names`.

        """
        return cls(StereoParameters.from_calibration(calibration).names, matrix,
                   hashes_of(calibration))

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Self:
        """
        Read a file that `write` has written.

        Parameters
        ----------
        path : path-like
            Of the file.

        Raises
        ------
        CalibrationError
            If it cannot be read or is no covariance; names the file.

        """
        try:
            content = load_yaml(path)
        except UnreadableError as error:
            raise CalibrationError(f'stereo covariance {path} {error}') from error
        keys = ('names', 'matrix', 'left', 'right')
        if not isinstance(content, dict) or not all(key in content for key in keys):
            raise CalibrationError(f'{path} is no stereo covariance, expected the keys '
                                   f'{", ".join(keys)}')
        if not isinstance(content['names'], list) or not isinstance(content['matrix'], list):
            raise CalibrationError(f'{path}: names and matrix are no lists')
        try:
            return cls(map(str, content['names']), content['matrix'],
                       {side: str(content[side]) for side in SIDES})
        except CalibrationError as error:
            raise CalibrationError(f'{path}: {error}') from error

    def write(self, path: str | PathLike[str]) -> None:
        """
        Write a YAML file; an existing file is replaced as a whole.

        Parameters
        ----------
        path : path-like
            Of the file.

        Raises
        ------
        CalibrationError
            If the file cannot be written.

        """
        try:
            write_text(path, self.text(), make_folders=False)
        except OSError as error:
            raise CalibrationError(f'stereo covariance {path} cannot be written: '
                                   f'{error}') from error

    def text(self):
        """Return the YAML text of the file."""
        return yaml_text({**{side: self.hashes[side] for side in SIDES},
                          'names': list(self.names), 'matrix': self.matrix.tolist()})

    def check(self, calibration):
        """
        Refuse a calibration that this covariance does not belong to.

        Parameters
        ----------
        calibration : StereoCalibration
            Of the two cameras.

        Raises
        ------
        CalibrationError
            Names the camera whose values differ.

        """
        check_hashes('the covariance', self.hashes, calibration)

    @property
    def std(self):
        """Return the standard deviation of each parameter, float64 (n,), in its unit."""
        return np.sqrt(np.diag(self.matrix))

    def depth_std(self, calibration, x, y, Z):
        """
        Return the standard deviation of the depth that comes from the calibration alone.

        Parameters
        ----------
        calibration : StereoCalibration
            With the same parameters; its hash is not compared.
        x, y : array-like, shape (...)
            Pixels of the rectified left image.
        Z : array-like, shape (...)
            Depth, m.

        Returns
        -------
        std : numpy.ndarray, float64, shape (...)
            m; NaN where the point lies beside or behind a camera.

        """
        return self._std(calibration, x, y, Z, depth_derivatives)

    def rows_std(self, calibration, x, y, Z):
        """Return the standard deviation of y_left - y_right, px; see `depth_std`."""
        return self._std(calibration, x, y, Z,
                         lambda *arguments: rectified_derivatives(*arguments)[0])

    def _std(self, calibration, x, y, Z, derivatives):
        known = StereoParameters.from_calibration(calibration).names
        if known != self.names:
            raise CalibrationError(f'the covariance has {len(self.names)} parameters, the '
                                   f'calibration {len(known)}: they do not belong together')
        by = derivatives(calibration, x, y, Z)
        return np.sqrt(np.einsum('...i,ij,...j->...', by, self.matrix, by))


def rectified_derivatives(calibration, x, y, Z):
    """
    Return how rows and disparity react when the true parameters leave those of a calibration.

    The images are rectified with the calibration. Points keep their place in the physical left
    camera.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    x, y : array-like, shape (...)
        Pixels of the rectified left image.
    Z : array-like, shape (...)
        Depth, m.

    Returns
    -------
    rows : numpy.ndarray, float64, shape (..., n)
        Derivatives of y_left - y_right by the true parameters, px per unit, in the order of
        `StereoParameters.names`; NaN where a point lies beside or behind a camera.
    disparity : numpy.ndarray, float64, shape (..., n)
        Derivatives of x_left - x_right.

    """
    parameters = StereoParameters.from_calibration(calibration)
    geometry = calibration.geometry
    x, y, Z = np.broadcast_arrays(*(np.asarray(each, np.float64) for each in (x, y, Z)))
    points = np.stack([(x - geometry.center_x_left) / geometry.focal_x * Z,
                       (y - geometry.center_y) / geometry.focal_y * Z, Z], -1).reshape(-1, 3)
    count = parameters.left.size
    left = points @ calibration.left.R  # R^T X as a row vector
    right = (points - [geometry.baseline, 0.0, 0.0]) @ calibration.right.R
    moved = np.zeros((len(points), 2, parameters.vector.size))
    by_left, _ = _on_rectified_pixels(calibration.left, parameters, parameters.left, left,
                                      points[:, 2])
    by_right, to_pixels = _on_rectified_pixels(calibration.right, parameters, parameters.right,
                                               right, points[:, 2])
    moved[:, :, :count] = by_left
    moved[:, :, count:2 * count] = -by_right
    moved[:, :, -6:-3] = -to_pixels @ rotated_by_vector(parameters.rotation, left)
    moved[:, :, -3:] = -to_pixels
    moved = moved.reshape(*x.shape, 2, -1)
    return moved[..., 1, :], moved[..., 0, :]


def depth_derivatives(calibration, x, y, Z):
    """Return derivatives of the measured depth, m per unit; see `rectified_derivatives`."""
    disparity = rectified_derivatives(calibration, x, y, Z)[1]
    # dZ / dd = -Z^2 / (f B)
    return -np.asarray(Z)[..., None]**2 / calibration.geometry.focal_baseline * disparity


def rotated_by_vector(rotation, points):
    """Return the derivatives of R X by the rotation vector of R, float64 (N, 3, 3), m/rad."""
    by_matrix = cv2.Rodrigues(rotation)[1].reshape(3, 3, 3)  # vector, row, column
    return np.einsum('iab,nb->nai', by_matrix, points)


def _on_rectified_pixels(camera, parameters, intrinsics, points, depth):
    """
    Return how the rectified image of fixed points (N, 3) of a raw camera moves.

    by_intrinsics, float64 (N, 2, 4 + n), px per unit; by_points, float64 (N, 2, 3), px/m.

    """
    points = np.where(points[:, 2:] > 0, points, np.nan)
    lens = LENSES[parameters.distortion_model]
    _, by_points, by_intrinsics = lens.project(points, intrinsics)
    # A step of one rectified pixel moves the point by Z / f along an axis of that camera.
    steps = camera.R[:2].T / camera.P[[0, 1], [0, 1]]
    raw_by_rectified = by_points @ steps * depth[:, None, None]
    inverse = _inverse(raw_by_rectified)
    return inverse @ by_intrinsics, inverse @ by_points


def _inverse(matrices):
    """Return the inverses of matrices (N, 2, 2), of no finite value where there is none."""
    (a, b), (c, d) = np.moveaxis(matrices, 0, -1)
    with np.errstate(divide='ignore', invalid='ignore'):
        inverse = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    return np.moveaxis(inverse, -1, 0)


def camera_hash(camera):
    """
    Return a hash of the values of a camera_info, however its file is written.

    Parameters
    ----------
    camera : CameraModel
        One camera of the pair.

    Returns
    -------
    text : str
        64 hexadecimal digits, of `DIGITS` digits of each value.

    """
    values = np.concatenate([getattr(camera, field).ravel() for field in 'DKRP'])
    # + 0.0 makes a zero of -0.0
    words = [str(camera.width), str(camera.height), camera.distortion_model,
             *(f'{value + 0.0:.{DIGITS}g}' for value in values)]
    return hashlib.sha256(' '.join(words).encode()).hexdigest()


def hashes_of(calibration):
    """Return the hashes of both cameras of a StereoCalibration, dict by 'left' and 'right'."""
    return {side: camera_hash(getattr(calibration, side)) for side in SIDES}


def check_hashes(what, hashes, calibration):
    """
    Refuse a calibration that something does not belong to.

    Parameters
    ----------
    what : str
        For the message: 'the covariance'.
    hashes : dict
        As `hashes_of` returned them.
    calibration : StereoCalibration
        Of the two cameras.

    Raises
    ------
    CalibrationError
        Names the camera whose values differ.

    """
    for side, value in hashes_of(calibration).items():
        if value != hashes[side]:
            raise CalibrationError(
                f'{what} belongs to another {side} calibration: its hash is '
                f'{hashes[side][:12]}, that of the {side} camera_info is {value[:12]}; '
                'calibrate anew, or use the files that were written together')


def _check_covariance(matrix, count):
    """Refuse a matrix that is no covariance of so many values."""
    if matrix.shape != (count, count):
        raise CalibrationError(f'the covariance has the shape {matrix.shape}, expected '
                               f'{(count, count)} for {count} names')
    if not np.isfinite(matrix).all():
        raise CalibrationError('the covariance holds values that are no finite numbers')
    variances = np.diag(matrix)
    if (variances < 0).any():
        raise CalibrationError('the covariance has a negative variance')
    scale = np.sqrt(np.outer(variances, variances)) + np.finfo(float).tiny
    if (np.abs(matrix - matrix.T) > SYMMETRY * scale).any():
        raise CalibrationError('the covariance is not symmetric')
    if (np.abs(matrix) > (1 + SYMMETRY) * scale).any():
        raise CalibrationError('the covariance holds a correlation beyond 1')
