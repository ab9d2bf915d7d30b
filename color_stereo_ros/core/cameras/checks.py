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
"""What a calibrated camera and a calibrated pair must be; each refusal names field and value."""

import numpy as np

from .lenses import LENSES
from ...errors import brief, CalibrationError

ROTATION_TOLERANCE = 1e-3    # largest deviation of R R^T from the identity
PROJECTION_TOLERANCE = 0.01  # px, between the entries of P that both cameras share
DUST = 1e-6                  # of the focal length: an entry that is no more counts as zero
TURN = ('turn both cameras, or their images before they are calibrated, by 90 degrees, so that '
        'one is beside the other')
SIZE_LIMITS = (8, 32766)     # px: windows of the methods, 16-bit maps of OpenCV
BASELINE_LIMITS = (0.001, 5.0)  # m
OTHER_NAMES = {'fisheye': 'equidistant', 'kannala_brandt': 'equidistant', 'radtan': 'plumb_bob'}
"""What OpenCV and Kalibr call the distortion models of ROS."""


def matrix(label, values, shape):
    """Return values as a float64 array of the given shape."""
    try:
        flat = np.array(values, np.float64).ravel()
    except (TypeError, ValueError, OverflowError) as error:
        raise CalibrationError(f'{label} = {brief(values)} is no list of numbers') from error
    expected = abs(int(np.prod(shape)))
    if shape != (-1,) and flat.size != expected:
        raise CalibrationError(f'{label} has {flat.size} values, expected {expected}')
    return flat.reshape(shape)


def check_finite(label, array):
    """Refuse an array with a value that is no finite number."""
    for index in np.flatnonzero(~np.isfinite(array))[:1]:
        raise CalibrationError(f'{label}[{index}] = {array.flat[index]} is not a finite number')


def check_size(camera):
    """Refuse a width or height that is no number of pixels."""
    for field in ('width', 'height'):
        value = getattr(camera, field)
        low, high = SIZE_LIMITS
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) \
                or not low <= value <= high:
            raise CalibrationError(f'{camera.name} {field} = {brief(value)} px is not an '
                                   f'image size, expected {low} .. {high} px')


def check_raw(camera):
    """Refuse K, D, R or a lens model from which no raw image can be rectified."""
    check_distortion(camera)
    check_finite(f'{camera.name} K', camera.K)
    check_intrinsics(camera)
    check_finite(f'{camera.name} R', camera.R)
    check_rotation(f'{camera.name} R', camera.R)


def says_no_raw_camera(camera):
    """Return whether K, R or the lens model are empty, as drivers of rectified images do."""
    return not camera.K.any() or not camera.R.any() or not camera.distortion_model


def check_distortion(camera):
    """Refuse an unknown lens model and coefficients that it does not have."""
    model = camera.distortion_model
    if not isinstance(model, str) or model not in LENSES:
        same = OTHER_NAMES.get(str(model).lower())
        hint = f'; ROS calls the same model {same}' if same else ''
        raise CalibrationError(f'{camera.name} distortion_model = {brief(model)} is unknown, '
                               f'expected one of {", ".join(LENSES)}{hint}')
    check_finite(f'{camera.name} D', camera.D)
    most = LENSES[model].lengths[-1]
    if camera.D.size > most:
        index = most + int(np.flatnonzero(camera.D[most:])[0])
        known = [name for name, lens in LENSES.items() if lens.lengths[-1] >= camera.D.size]
        raise CalibrationError(
            f'{camera.name} D[{index}] = {camera.D[index]}, but distortion_model {model} has '
            f'{most} coefficients' + (f': is it {" or ".join(known)}?' if known else ''))


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
    if not deviation <= ROTATION_TOLERANCE or determinant < 0:
        raise CalibrationError(
            f'{label} = {rotation.ravel().tolist()} is not a rotation: R R^T deviates from the '
            f'identity by {deviation:.3g}, determinant {determinant:.3g}')


def check_projection(camera):
    """Refuse a P that is no projection of a rectified camera."""
    check_finite(f'{camera.name} P', camera.P)
    _check_focal_lengths(f'{camera.name} P', camera.P, 'no rectified camera')
    if not np.array_equal(camera.P[2], (0, 0, 1, 0)):
        raise CalibrationError(f'{camera.name} P[8..11] = {camera.P[2].tolist()}, '
                               'expected 0 0 1 0')
    if camera.P[0, 1] != 0 or camera.P[1, 0] != 0:
        raise CalibrationError(f'{camera.name} P[1], P[4] = {camera.P[0, 1]}, {camera.P[1, 0]}: '
                               'a rectified camera has no skew, expected 0')


def without_dust(projection):
    """
    Return a camera matrix (3, n) whose rounding errors are gone.

    Programs that multiply matrices leave 1e-14 where a 0 or a 1 belongs. Such an entry moves no
    pixel by more than 1e-6 focal lengths.

    """
    clean = projection.copy()
    focal = np.abs(projection[[0, 1], [0, 1]]).max()
    for row, column in ((0, 1), (1, 0)):
        if abs(clean[row, column]) <= DUST * focal:
            clean[row, column] = 0.0
    last = np.eye(3, clean.shape[1])[2]
    clean[2] = np.where(np.abs(clean[2] - last) <= DUST, last, clean[2])
    return clean


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
    dust = DUST * left.P[0, 0]
    across, down = right.P[:2, 3] - left.P[:2, 3]
    (left_x, left_y), (right_x, right_y) = (
        np.where(np.abs(P[:2, 3]) > dust, P[:2, 3], 0.0) for P in (left.P, right.P))
    if abs(down) > dust:
        raise CalibrationError(_about_heights(left_y, right_y, abs(across) <= dust))
    if abs(across) <= dust:
        raise CalibrationError(_about_no_baseline(left_x, right.P[0, 3]))
    if across > 0:
        raise CalibrationError(_about_swapped(left_x, right_x))
    _check_plausible_baseline(-across / right.P[0, 0])


def _about_heights(left, right, vertical):
    """Return what is wrong with the P[7] of two cameras."""
    values = f'right P[7] = {right} px m'
    if left:
        values = f'left P[7] = {left} px m and {values}'
    if vertical:
        return (f'{values}, but the same P[3]: one camera is exactly above the other. Vertical '
                f'stereo is not supported: {TURN}')
    expected = 'equal values' if left else '0'
    return f'{values}: cameras above one another are not supported, expected {expected}'


def _about_no_baseline(left, right):
    """Return what is wrong with P[3] that are the same."""
    if left:
        return (f'left P[3] = {left} px m and right P[3] = {right} px m: no baseline between '
                'them, expected right P[3] = left P[3] - focal length * baseline')
    value = f'right P[3] = {right} px m' if not right else \
        f'right P[3] means a baseline of 0 m ({right} px m is a rounding error)'
    return f'{value}: the pair has no baseline, expected -focal length * baseline'


def _about_swapped(left, right):
    """Return what is wrong with P[3] of which the right one is larger."""
    if left:
        return (f'left P[3] = {left} px m, expected 0: are left and right camera swapped? (right '
                f'P[3] = {right} px m; the smaller one belongs to the right camera)')
    return (f'right P[3] = {right} px m is positive, expected -focal length * baseline: are left '
            'and right camera swapped?')


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
    rotation = matrix('R', R, (3, 3))
    translation = matrix('t', t, (3,))
    check_finite('R', rotation)
    check_finite('t', translation)
    check_rotation('R', rotation)
    if not translation.any():
        raise CalibrationError('t = [0.0, 0.0, 0.0] m: the pair has no baseline, expected the '
                               'translation from the left to the right camera')
    center = -rotation.T @ translation
    if abs(center[1]) > abs(center[0]):
        raise CalibrationError(
            f't = {translation.tolist()} m puts the right camera at {center.tolist()} m of the '
            'left one, expected to its right (x > 0): one camera is above the other. Vertical '
            f'stereo is not supported: {TURN}')
    if center[0] <= 0 or center[0] < abs(center[1]):
        raise CalibrationError(
            f't = {translation.tolist()} m puts the right camera at {center.tolist()} m of the '
            'left one, expected to its right (x > 0): are left and right camera swapped?')
    return rotation, translation.reshape(3, 1)  # OpenCV 5 refuses a flat translation
