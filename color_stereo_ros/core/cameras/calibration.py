# SPDX-License-Identifier: Apache-2.0
"""A calibrated stereo pair: read, checked and written as ROS camera_info."""

from dataclasses import dataclass
from functools import cached_property
import os
from pathlib import Path

import numpy as np
import yaml

from ...errors import CalibrationError
from ...files.yaml import load_yaml, UnreadableError
from .geometry import RectifiedGeometry
from .lenses import LENSES

ROTATION_TOLERANCE = 1e-3    # largest deviation of R R^T from the identity
PROJECTION_TOLERANCE = 0.01  # px, between the entries of P that both cameras share
# Of a camera_info file, in the order of the fields of CameraModel.
PLAIN_FIELDS = 'image_width', 'image_height', 'distortion_model'
MATRIX_FIELDS = ('distortion_coefficients', 'camera_matrix', 'rectification_matrix',
                 'projection_matrix')
BASELINE_LIMITS = (0.001, 5.0)  # m


@dataclass(frozen=True, eq=False)
class CameraModel:
    """
    One camera of a stereo pair: the content of its camera_info.

    Raises
    ------
    CalibrationError
        When built with a value that no calibrated camera has; names field and value.

    """

    name: str
    """'left' or 'right'; error messages begin with it."""
    width: int
    """Columns of the raw image, px."""
    height: int
    """Rows of the raw image, px."""
    distortion_model: str
    """A name in `lenses.LENSES`: plumb_bob, rational_polynomial or equidistant."""
    D: np.ndarray
    """float64 (n,), distortion coefficients in OpenCV's order; empty = no distortion."""
    K: np.ndarray
    """float64 (3, 3), raw camera matrix, px."""
    R: np.ndarray
    """float64 (3, 3), rotates physical camera coordinates into rectified ones."""
    P: np.ndarray
    """float64 (3, 4), projection of the rectified camera; P[0, 3] = -focal_x * baseline."""

    def __post_init__(self):
        """Convert to float64 arrays of the right shapes and refuse impossible values."""
        for field, shape in (('D', (-1,)), ('K', (3, 3)), ('R', (3, 3)), ('P', (3, 4))):
            object.__setattr__(self, field, _matrix(self, field, getattr(self, field), shape))
        _check_size(self)
        _check_distortion(self)
        _check_intrinsics(self)
        _check_rotation(f'{self.name} R', self.R)
        _check_projection(self)


def _matrix(camera, field, values, shape):
    """Return values as a read-only float64 array of the given shape, all finite."""
    label = f'{camera.name} {field}'
    try:
        flat = np.array(values, np.float64).ravel()
    except (TypeError, ValueError) as error:
        raise CalibrationError(f'{label} = {values!r} is no list of numbers') from error
    expected = abs(int(np.prod(shape)))
    if shape != (-1,) and flat.size != expected:
        raise CalibrationError(f'{label} has {flat.size} values, expected {expected}')
    for index in np.flatnonzero(~np.isfinite(flat))[:1]:
        raise CalibrationError(f'{label}[{index}] = {flat[index]} is not a finite number')
    matrix = flat.reshape(shape)
    matrix.setflags(write=False)
    return matrix


def _check_size(camera):
    for field in ('width', 'height'):
        value = getattr(camera, field)
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value <= 0:
            raise CalibrationError(
                f'{camera.name} {field} = {value!r} px is not an image size, expected > 0')
        object.__setattr__(camera, field, int(value))


def _check_distortion(camera):
    model = camera.distortion_model
    if model not in LENSES:
        raise CalibrationError(f'{camera.name} distortion_model = {model!r} is unknown, expected '
                               f'one of {", ".join(LENSES)}')
    lengths = LENSES[model].lengths
    if camera.D.size not in lengths:
        raise CalibrationError(
            f'{camera.name} D has {camera.D.size} values, expected '
            f'{" or ".join(map(str, lengths))} for distortion_model {model}')


def _check_intrinsics(camera):
    for index, value in ((0, camera.K[0, 0]), (4, camera.K[1, 1])):
        if value <= 0:
            raise CalibrationError(f'{camera.name} K[{index}] = {value} px: the camera is not '
                                   'calibrated, expected a focal length > 0')
    if not np.array_equal(camera.K[2], (0, 0, 1)) or camera.K[1, 0] != 0:
        raise CalibrationError(f'{camera.name} K = {camera.K.ravel().tolist()} is no camera '
                               'matrix, expected [fx s cx, 0 fy cy, 0 0 1]')


def _check_rotation(label, matrix):
    deviation = np.abs(matrix @ matrix.T - np.eye(3)).max()
    determinant = np.linalg.det(matrix)
    if deviation > ROTATION_TOLERANCE or determinant < 0:
        raise CalibrationError(
            f'{label} = {matrix.ravel().tolist()} is not a rotation: R R^T deviates from the '
            f'identity by {deviation:.3g}, determinant {determinant:.3g}')


def _check_projection(camera):
    for index, value in ((0, camera.P[0, 0]), (5, camera.P[1, 1])):
        if value <= 0:
            raise CalibrationError(f'{camera.name} P[{index}] = {value} px: no rectified camera, '
                                   'expected a focal length > 0')
    if not np.array_equal(camera.P[2], (0, 0, 1, 0)):
        raise CalibrationError(f'{camera.name} P[8..11] = {camera.P[2].tolist()}, '
                               'expected 0 0 1 0')
    if camera.P[0, 1] != 0 or camera.P[1, 0] != 0:
        raise CalibrationError(f'{camera.name} P[1], P[4] = {camera.P[0, 1]}, {camera.P[1, 0]}: '
                               'a rectified camera has no skew, expected 0')


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """
    Two calibrated cameras and the geometry between them.

    Raises
    ------
    CalibrationError
        When built from cameras that are no horizontal stereo pair; names field and value.

    """

    left: CameraModel
    right: CameraModel

    def __post_init__(self):
        """Refuse cameras that do not belong together."""
        _check_same_size(self.left, self.right)
        _check_baseline(self.left, self.right)
        _check_shared_projection(self.left, self.right)

    @cached_property
    def geometry(self):
        """Return the RectifiedGeometry of the pair."""
        left, right = self.left.P, self.right.P
        return RectifiedGeometry(
            width=self.left.width, height=self.left.height,
            focal_x=float(left[0, 0]), focal_y=float(left[1, 1]),
            center_x_left=float(left[0, 2]), center_x_right=float(right[0, 2]),
            center_y=float(left[1, 2]), baseline=float(-right[0, 3] / right[0, 0]))

    @property
    def right_from_left(self):
        """
        Return rotation (3, 3) and translation (3,), m, of the physical cameras.

        X_right = R X_left + t.

        """
        # Rectified frames differ by the baseline only: R_r X_right = R_l X_left - (B, 0, 0)
        rotation = self.right.R.T @ self.left.R
        return rotation, -self.right.R.T @ np.array([self.geometry.baseline, 0.0, 0.0])

    @classmethod
    def from_yaml(cls, left, right):
        """
        Read two ROS camera_info YAML files.

        Parameters
        ----------
        left, right : path-like

        Returns
        -------
        calibration : StereoCalibration

        Raises
        ------
        CalibrationError
            If a file cannot be read, is no calibration, or holds impossible values.

        """
        return cls(_camera_from_yaml('left', left), _camera_from_yaml('right', right))

    @classmethod
    def from_camera_info(cls, left, right):
        """
        Take two sensor_msgs/CameraInfo messages, or anything with the same fields.

        Parameters
        ----------
        left, right : object
            With fields width, height, distortion_model, d, k, r and p.

        Returns
        -------
        calibration : StereoCalibration

        Raises
        ------
        CalibrationError
            If a value is impossible.

        """
        return cls(_camera_from_info('left', left), _camera_from_info('right', right))

    @classmethod
    def from_arrays(cls, size, K_left, D_left, K_right, D_right, R, t, distortion_model=None):
        """
        Rectify a pair that is known by its physical parameters.

        Parameters
        ----------
        size : (int, int)
            Width and height of the raw images, px.
        K_left, K_right : array-like, shape (3, 3)
            Camera matrices, px.
        D_left, D_right : array-like, shape (n,)
            Distortion coefficients in OpenCV's order; empty or None = no distortion.
        R : array-like, shape (3, 3)
        t : array-like, shape (3,)
            X_right = R X_left + t, m.
        distortion_model : str, optional
            Default: rational_polynomial if one of D_left and D_right has more than 5 values,
            otherwise plumb_bob.

        Returns
        -------
        calibration : StereoCalibration
            R and P are those of cv2.stereoRectify with flags=0 and alpha=0: converging cameras
            keep their scene in view by different principal points, and no rectified pixel lies
            outside the raw images where that is possible.

        Raises
        ------
        CalibrationError
            If a value is impossible.

        """
        distortion = [() if D is None else np.ravel(D) for D in (D_left, D_right)]
        if distortion_model is None:
            longest = max(len(D) for D in distortion)
            distortion_model = 'rational_polynomial' if longest > 5 else 'plumb_bob'
        # The raw cameras are checked before OpenCV sees them; R and P follow.
        raw = [CameraModel(name, *_checked_size(size), distortion_model, D, K, np.eye(3),
                           np.eye(3, 4))
               for name, D, K in zip(('left', 'right'), distortion, (K_left, K_right))]
        rotation, translation = _checked_motion(R, t)
        rectified = LENSES[distortion_model].rectified_views(*raw, rotation, translation)
        return cls(*(CameraModel(camera.name, camera.width, camera.height, distortion_model,
                                 camera.D, camera.K, R_rect, P)
                     for camera, (R_rect, P) in zip(raw, rectified)))

    def to_yaml(self, left_path, right_path):
        """
        Write two ROS camera_info YAML files; an existing file is replaced as a whole.

        Parameters
        ----------
        left_path, right_path : path-like

        Raises
        ------
        CalibrationError
            If a file cannot be written.

        """
        _camera_to_yaml(self.left, left_path)
        _camera_to_yaml(self.right, right_path)


def _check_same_size(left, right):
    sizes = [f'{camera.width} x {camera.height}' for camera in (left, right)]
    if sizes[0] != sizes[1]:
        raise CalibrationError(f'left width x height = {sizes[0]} px, right = {sizes[1]} px: '
                               'expected equal sizes')


def _check_baseline(left, right):
    if left.P[0, 3] != 0 or left.P[1, 3] != 0:
        index = 3 if left.P[0, 3] != 0 else 7
        raise CalibrationError(f'left P[{index}] = {left.P[0 if index == 3 else 1, 3]} px m, '
                               'expected 0: are left and right camera swapped?')
    shift = right.P[0, 3]
    if right.P[1, 3] != 0:
        raise CalibrationError(f'right P[7] = {right.P[1, 3]} px m: cameras above one another '
                               'are not supported, expected 0')
    if shift == 0:
        raise CalibrationError('right P[3] = 0.0 px m: the pair has no baseline, expected '
                               '-focal length * baseline')
    if shift > 0:
        raise CalibrationError(f'right P[3] = {shift} px m is positive, expected -focal length * '
                               'baseline: are left and right camera swapped?')
    _check_plausible_baseline(-shift / right.P[0, 0])


def _check_plausible_baseline(baseline):
    low, high = BASELINE_LIMITS
    if not low <= baseline <= high:
        hint = ': given in millimeters?' if baseline > high else ''
        raise CalibrationError(f'right P[3] means a baseline of {baseline:.6g} m, outside '
                               f'{low} .. {high} m{hint}')


def _check_shared_projection(left, right):
    for index, (row, column), word in ((0, (0, 0), 'focal length fx'),
                                       (5, (1, 1), 'focal length fy'),
                                       (6, (1, 2), 'principal row cy')):
        values = left.P[row, column], right.P[row, column]
        if abs(values[0] - values[1]) > PROJECTION_TOLERANCE:
            raise CalibrationError(
                f'left P[{index}] = {values[0]} px and right P[{index}] = {values[1]} px: '
                f'a rectified pair has one {word}')


def _checked_size(size):
    try:
        width, height = size
    except (TypeError, ValueError) as error:
        raise CalibrationError(f'size = {size!r}, expected (width, height)') from error
    return width, height


def _checked_motion(R, t):
    """Return the checked rotation (3, 3) and translation (3, 1) from left to right."""
    rotation = np.array(R, np.float64)
    translation = np.array(t, np.float64).ravel()
    if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
        raise CalibrationError(f'R = {rotation.tolist()}, expected 3 x 3 finite numbers')
    _check_rotation('R', rotation)
    if translation.size != 3 or not np.isfinite(translation).all():
        raise CalibrationError(f't = {translation.tolist()} m, expected 3 finite numbers')
    center = -rotation.T @ translation
    if center[0] <= 0 or center[0] < abs(center[1]):
        raise CalibrationError(
            f't = {translation.tolist()} m puts the right camera at {center.tolist()} m of the '
            'left one, expected to its right (x > 0): are left and right camera swapped?')
    return rotation, translation.reshape(3, 1)  # OpenCV 5 refuses a flat translation


def _camera_from_info(name, info):
    """Return the CameraModel of one CameraInfo, which must describe the full image."""
    region = getattr(info, 'roi', None)
    for field, value in (('binning_x', getattr(info, 'binning_x', 0)),
                         ('binning_y', getattr(info, 'binning_y', 0)),
                         ('roi.x_offset', getattr(region, 'x_offset', 0)),
                         ('roi.y_offset', getattr(region, 'y_offset', 0))):
        if value > ('binning' in field):
            raise CalibrationError(f'{name} {field} = {value}: a part of the image or a coarser '
                                   'one is not supported, expected the image as calibrated')
    return CameraModel(name, info.width, info.height, info.distortion_model,
                       info.d, info.k, info.r, info.p)


def _camera_from_yaml(name, path):
    """Return the CameraModel of one camera_info file."""
    try:
        content = load_yaml(path)
    except UnreadableError as error:
        raise CalibrationError(f'{name} calibration {path} {error}') from error
    except TypeError as error:
        raise CalibrationError(f'{name} calibration {path} cannot be read: {error}') from error
    if not isinstance(content, dict):
        raise CalibrationError(f'{name} calibration {path} holds a {type(content).__name__}, '
                               'expected the fields of camera_info')
    for key in (*PLAIN_FIELDS, *MATRIX_FIELDS):
        field = content.get(key)
        if field is None or key in MATRIX_FIELDS and (
                not isinstance(field, dict) or 'data' not in field):
            raise CalibrationError(f'{name} calibration {path} has no usable field {key!r}')
    try:
        return CameraModel(name, *(content[key] for key in PLAIN_FIELDS),
                           *(content[key]['data'] for key in MATRIX_FIELDS))
    except CalibrationError as error:
        raise CalibrationError(f'{path}: {error}') from error


def _camera_to_yaml(camera, path):
    """Write one camera_info file by way of a temporary one beside it."""
    def matrix(values, rows, columns):
        return {'rows': rows, 'cols': columns, 'data': values.ravel().tolist()}

    text = yaml.safe_dump({
        'image_width': camera.width, 'image_height': camera.height, 'camera_name': camera.name,
        'camera_matrix': matrix(camera.K, 3, 3),
        'distortion_model': camera.distortion_model,
        'distortion_coefficients': matrix(camera.D, 1, camera.D.size),
        'rectification_matrix': matrix(camera.R, 3, 3),
        'projection_matrix': matrix(camera.P, 3, 4)}, sort_keys=False, default_flow_style=None)
    path = Path(path)
    temporary = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        temporary.write_text(text, encoding='utf-8')
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise CalibrationError(f'{camera.name} calibration {path} cannot be written: '
                               f'{error}') from error
