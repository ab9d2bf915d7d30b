# SPDX-License-Identifier: Apache-2.0
"""What a calibrated camera and a calibrated pair must be; each refusal names field and value."""

import numpy as np

from ...errors import brief, CalibrationError
from .lenses import LENSES

ROTATION_TOLERANCE = 1e-3    # largest deviation of R R^T from the identity
PROJECTION_TOLERANCE = 0.01  # px, between the entries of P that both cameras share
BASELINE_LIMITS = (0.001, 5.0)  # m


def matrix(label, values, shape):
    """Return values as a read-only float64 array of the given shape, all finite."""
    try:
        flat = np.array(values, np.float64).ravel()
    except (TypeError, ValueError) as error:
        raise CalibrationError(f'{label} = {values!r} is no list of numbers') from error
    expected = abs(int(np.prod(shape)))
    if shape != (-1,) and flat.size != expected:
        raise CalibrationError(f'{label} has {flat.size} values, expected {expected}')
    for index in np.flatnonzero(~np.isfinite(flat))[:1]:
        raise CalibrationError(f'{label}[{index}] = {flat[index]} is not a finite number')
    array = flat.reshape(shape)
    array.setflags(write=False)
    return array


def check_size(camera):
    """Refuse a width or height that is no number of pixels."""
    for field in ('width', 'height'):
        value = getattr(camera, field)
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value <= 0:
            raise CalibrationError(
                f'{camera.name} {field} = {value!r} px is not an image size, expected > 0')


def check_distortion(camera):
    """Refuse an unknown lens model and a number of coefficients that it cannot have."""
    model = camera.distortion_model
    if model not in LENSES:
        raise CalibrationError(f'{camera.name} distortion_model = {brief(model)} is unknown, '
                               f'expected one of {", ".join(LENSES)}')
    lengths = LENSES[model].lengths
    if camera.D.size not in lengths:
        raise CalibrationError(
            f'{camera.name} D has {camera.D.size} values, expected '
            f'{" or ".join(map(str, lengths))} for distortion_model {model}')


def check_intrinsics(camera):
    """Refuse a K that is no camera matrix."""
    _check_focal_lengths(f'{camera.name} K', camera.K, 'the camera is not calibrated')
    if not np.array_equal(camera.K[2], (0, 0, 1)) or camera.K[1, 0] != 0:
        raise CalibrationError(f'{camera.name} K = {camera.K.ravel().tolist()} is no camera '
                               'matrix, expected [fx s cx, 0 fy cy, 0 0 1]')


def check_rotation(label, rotation):
    """Refuse a matrix that is no rotation."""
    deviation = np.abs(rotation @ rotation.T - np.eye(3)).max()
    determinant = np.linalg.det(rotation)
    if deviation > ROTATION_TOLERANCE or determinant < 0:
        raise CalibrationError(
            f'{label} = {rotation.ravel().tolist()} is not a rotation: R R^T deviates from the '
            f'identity by {deviation:.3g}, determinant {determinant:.3g}')


def check_projection(camera):
    """Refuse a P that is no projection of a rectified camera."""
    _check_focal_lengths(f'{camera.name} P', camera.P, 'no rectified camera')
    if not np.array_equal(camera.P[2], (0, 0, 1, 0)):
        raise CalibrationError(f'{camera.name} P[8..11] = {camera.P[2].tolist()}, '
                               'expected 0 0 1 0')
    if camera.P[0, 1] != 0 or camera.P[1, 0] != 0:
        raise CalibrationError(f'{camera.name} P[1], P[4] = {camera.P[0, 1]}, {camera.P[1, 0]}: '
                               'a rectified camera has no skew, expected 0')


def _check_focal_lengths(label, projection, problem):
    """Refuse a matrix (3, n) without focal lengths."""
    for index, value in ((0, projection[0, 0]), (projection.shape[1] + 1, projection[1, 1])):
        if value <= 0:
            raise CalibrationError(f'{label}[{index}] = {value} px: {problem}, expected a focal '
                                   'length > 0')


def check_whole_image(name, info):
    """Refuse binning and windows: the calibration would not be that of the image."""
    for field in ('binning_x', 'binning_y'):
        value = getattr(info, field, 0)
        if value > 1:
            raise CalibrationError(f'{name} {field} = {value} is not supported, expected 0 or 1: '
                                   'calibrate the images as they are sent')
    roi = getattr(info, 'roi', None)
    left, top, width, height = window = tuple(
        getattr(roi, field, 0) for field in ('x_offset', 'y_offset', 'width', 'height'))
    if window not in ((0, 0, 0, 0), (0, 0, info.width, info.height)):
        raise CalibrationError(
            f'{name} roi = {width} x {height} px at ({left}, {top}) is not supported, expected '
            'the whole image: calibrate the images as they are sent')


def check_same_size(left, right):
    """Refuse images of different sizes."""
    sizes = [f'{camera.width} x {camera.height}' for camera in (left, right)]
    if sizes[0] != sizes[1]:
        raise CalibrationError(f'left width x height = {sizes[0]} px, right = {sizes[1]} px: '
                               'expected equal sizes')


def check_baseline(left, right):
    """Refuse a pair whose right camera is not beside the left one, to its right."""
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


def check_shared_projection(left, right):
    """Refuse projections that differ in more than the principal column."""
    for index, (row, column), word in ((0, (0, 0), 'focal length fx'),
                                       (5, (1, 1), 'focal length fy'),
                                       (6, (1, 2), 'principal row cy')):
        values = left.P[row, column], right.P[row, column]
        if abs(values[0] - values[1]) > PROJECTION_TOLERANCE:
            raise CalibrationError(
                f'left P[{index}] = {values[0]} px and right P[{index}] = {values[1]} px: '
                f'a rectified pair has one {word}')


def checked_size(size):
    """Return width and height."""
    try:
        width, height = size
    except (TypeError, ValueError) as error:
        raise CalibrationError(f'size = {size!r}, expected (width, height)') from error
    return width, height


def checked_motion(R, t):
    """Return the checked rotation (3, 3) and translation (3, 1) from left to right."""
    rotation = np.array(R, np.float64)
    translation = np.array(t, np.float64).ravel()
    if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
        raise CalibrationError(f'R = {rotation.tolist()}, expected 3 x 3 finite numbers')
    check_rotation('R', rotation)
    if translation.size != 3 or not np.isfinite(translation).all():
        raise CalibrationError(f't = {translation.tolist()} m, expected 3 finite numbers')
    center = -rotation.T @ translation
    if center[0] <= 0 or center[0] < abs(center[1]):
        raise CalibrationError(
            f't = {translation.tolist()} m puts the right camera at {center.tolist()} m of the '
            'left one, expected to its right (x > 0): are left and right camera swapped?')
    return rotation, translation.reshape(3, 1)  # OpenCV 5 refuses a flat translation
