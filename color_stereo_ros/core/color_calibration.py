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
What is known of the colors of two cameras, and raw images corrected by it.

A raw number v of channel i at a pixel means

    light_i = (f((v - dark_i) / (255 - dark_i))) / (white_i field_i(pixel))
    f(x) = ((x + offset)^gamma - offset^gamma) / ((1 + offset)^gamma - offset^gamma)

in units of white light of the projector. `crosstalk` leads from the light of the three channels of
the projector to that of the camera; its inverse separates them again.

"""

from dataclasses import dataclass, fields
import math

import cv2
import numpy as np

from .color_kernels import correct_colors
from ..errors import CalibrationError
from ..files.atomic import write_text
from ..files.yaml import load_yaml, UnreadableError, yaml_text

FULL_SCALE = 255
PEDESTAL = 4.0
"""DN of a corrected image without light: noise about it is not clipped."""
CEILING = 250.0
"""Largest DN of a corrected channel that is not overexposed."""
SATURATED = 255
"""DN of a corrected channel that is overexposed."""
SATURATION_LEVEL = 254
"""color.saturation_level of corrected images."""
_FOCAL_TOLERANCE = 0.05
"""Two calibrations of one lens agree better than this; another lens does not."""
_LEAST_SHIFT = 0.05
"""px in the corner of the image; less chromatic aberration is not worth interpolating for."""
_DECIMALS = 6
_VERSION = 1
_RANGES = {'dark_level': (0.0, 128.0), 'gamma': (0.2, 5.0), 'offset': (0.0, 1.0),
           'white': (0.004, 10.0), 'crosstalk': (-1.0, 1.5), 'gain_field': (0.05, 20.0),
           'aberration': (-0.1, 0.1)}
_SHAPES = {'dark_level': (3,), 'gamma': (), 'offset': (), 'white': (3,), 'crosstalk': (3, 3),
           'gain_field': (None, None, 3), 'aberration': (2,)}


@dataclass(frozen=True, eq=False)
class CameraColor:
    """
    What is known of the colors of one camera.

    Raises
    ------
    CalibrationError
        When built with a value of a wrong shape or outside its range; names field and value.

    """

    size: tuple
    """Width and height of the raw image, px."""
    focal_length: tuple
    """fx and fy of K, px, by which another camera is known; () = not known."""
    dark_level: np.ndarray
    """float64 (3,), DN of each channel without light."""
    gamma: float
    """Of f above; 1 = linear."""
    offset: float
    """Of f above, share of full scale; 0.055 and a gamma of 2.4 make sRGB."""
    white: np.ndarray
    """float64 (3,), share of full scale of each channel under white light, after f."""
    crosstalk: np.ndarray
    """float64 (3, 3), share of each light (column) in each channel (row); rows add up to 1."""
    gain_field: np.ndarray
    """float64 (rows, columns, 3), factor of each channel on an even grid from corner to corner."""
    aberration: np.ndarray
    """float64 (2,), by which red and blue are magnified more than green, about the center."""

    def __post_init__(self):
        """Convert to float64 arrays of the right shapes and check their ranges."""
        for name, shape in _SHAPES.items():
            object.__setattr__(self, name, _checked(name, getattr(self, name), shape))
        size = tuple(int(each) for each in self.size)
        focal = tuple(float(each) for each in self.focal_length)
        if len(size) != 2 or min(size) < 1 or len(focal) not in (0, 2):
            raise CalibrationError(f'size = {self.size}, focal_length = {self.focal_length}: '
                                   'expected two numbers each')
        object.__setattr__(self, 'size', size)
        object.__setattr__(self, 'focal_length', focal)
        if np.abs(self.crosstalk.sum(axis=1) - 1).max() > 1e-3:
            raise CalibrationError('crosstalk: expected rows that add up to 1, found '
                                   f'{np.round(self.crosstalk.sum(axis=1), 4).tolist()}')
        if not np.linalg.cond(self.crosstalk) < 100:
            raise CalibrationError('crosstalk: the three lights cannot be told apart')

    @classmethod
    def ideal(cls, size, focal_length=()):
        """Return what is known of a linear camera without faults that sees white as white."""
        return cls(size, focal_length, np.zeros(3), 1.0, 0.0, np.ones(3), np.eye(3),
                   np.ones((2, 2, 3)), np.zeros(2))

    def light(self):
        """Return what each number of a channel means, float64 (3, 256), share of full scale."""
        values = np.arange(FULL_SCALE + 1) - self.dark_level[:, None]
        return linear(values / (FULL_SCALE - self.dark_level[:, None]), self.gamma, self.offset)

    def gains(self):
        """Return the factor of each pixel that evens out white, float64 (H, W, 3)."""
        width, height = self.size
        rows, columns = self.gain_field.shape[:2]
        x, y = np.meshgrid(np.linspace(0, columns - 1, width), np.linspace(0, rows - 1, height))
        logarithms = np.log(self.gain_field).astype(np.float32)
        field = cv2.remap(logarithms, x.astype(np.float32), y.astype(np.float32),
                          cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.exp(-field.reshape(height, width, 3)) / self.white

    def corner_shift(self):
        """Return the aberration of red and blue in the corner of the image, float64 (2,), px."""
        return self.aberration * 0.5 * math.hypot(*self.size)


@dataclass(frozen=True, eq=False)
class ColorCalibration:
    """The colors of both cameras; the file of `color_stereo calibrate color`."""

    left: CameraColor
    right: CameraColor

    def __post_init__(self):
        """Refuse cameras of different sizes."""
        if self.left.size != self.right.size:
            raise CalibrationError(f'left.size = {self.left.size} px, right.size = '
                                   f'{self.right.size} px: expected equal ones')

    @classmethod
    def read(cls, path):
        """
        Read a file that `write` has written.

        Raises
        ------
        CalibrationError
            If it cannot be read or is no color calibration; names file, field and value.

        """
        try:
            content = load_yaml(path)
            if not isinstance(content, dict) or 'color_calibration' not in content:
                raise CalibrationError('is no color calibration; `color_stereo calibrate color` '
                                       'makes one')
            if content['color_calibration'] != _VERSION:
                raise CalibrationError(f'color_calibration = {content["color_calibration"]!r}, '
                                       f'expected {_VERSION}')
            return cls(*(_camera(side, content.get(side)) for side in ('left', 'right')))
        except (UnreadableError, CalibrationError) as error:
            raise CalibrationError(f'{path}: {error}') from error

    def write(self, path, **options):
        """Write a YAML file, whole or not at all; options are those of `files.atomic`."""
        write_text(path, self.text(), **options)

    def text(self):
        """Return the content of the file."""
        content = {'color_calibration': _VERSION}
        for side in ('left', 'right'):
            camera = getattr(self, side)
            content[side] = {spec.name: _plain(getattr(camera, spec.name))
                             for spec in fields(camera)}
        return yaml_text(content)

    def check(self, calibration):
        """
        Refuse cameras other than those that were measured.

        Parameters
        ----------
        calibration : StereoCalibration
            Of the two cameras.

        Raises
        ------
        CalibrationError
            Names camera, value and expected value.

        """
        for side in ('left', 'right'):
            own, camera = getattr(self, side), getattr(calibration, side)
            size = camera.width, camera.height
            if own.size != size:
                raise CalibrationError(
                    f'the color calibration is of a {side} camera of {own.size[0]} x '
                    f'{own.size[1]} px, but this one has {size[0]} x {size[1]} px')
            focal = camera.K[0, 0], camera.K[1, 1]
            if own.focal_length and min(focal) > 0 and np.abs(
                    np.divide(focal, own.focal_length) - 1).max() > _FOCAL_TOLERANCE:
                raise CalibrationError(
                    f'the color calibration is of a {side} camera with a focal length of '
                    f'{own.focal_length[0]:.1f} px, but this one has {focal[0]:.1f} px')

    def scales(self):
        """
        Return which DN white light has in corrected images above `PEDESTAL`, float64 (3,).

        Both cameras get the same values: the geometric mean of their own, made smaller until no
        color of a camera that is not overexposed exceeds `CEILING`.

        """
        target = np.sqrt(self.left.white * self.right.white)
        room = min((camera.white * camera.gain_field.min(axis=(0, 1))
                    * np.minimum(np.diag(camera.crosstalk), 1) / target).min()
                   for camera in (self.left, self.right))
        return min(1.0, room) * target * (CEILING - PEDESTAL)

    @property
    def right_to_left(self):
        """Return the map from linear colors of the right camera to the left one's, (3, 3)."""
        left, right = (np.diag(camera.white) @ camera.crosstalk
                       for camera in (self.left, self.right))
        return left @ np.linalg.inv(right)


def check_color(settings, calibration=None):
    """
    Return the ColorCalibration that color.calibration names, None without a file.

    Parameters
    ----------
    settings : Settings
        Of the core.
    calibration : StereoCalibration, optional
        The cameras, if they are known.

    Raises
    ------
    CalibrationError
        If the file cannot be read, or is of other cameras.

    """
    path = settings.color.calibration
    if not path:
        return None
    measured = ColorCalibration.read(path)
    if calibration is not None:
        try:
            measured.check(calibration)
        except CalibrationError as error:
            raise CalibrationError(f'{path}: {error}') from error
    return measured


class ColorCorrection:
    """
    Corrects raw pairs: the same light gives the same color in both cameras.

    Parameters
    ----------
    calibration : ColorCalibration
    saturation_level : int
        A channel of a raw image at or above this is overexposed, DN.

    """

    def __init__(self, calibration, saturation_level=SATURATION_LEVEL):
        """Build tables, gains and maps."""
        scales = calibration.scales()
        self._saturation = saturation_level
        self._cameras = [_Prepared(camera, scales)
                         for camera in (calibration.left, calibration.right)]

    def apply(self, left, right):
        """
        Return both images corrected.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.

        Returns
        -------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            New arrays. Linear light: `PEDESTAL` DN without light, at most `CEILING`, `SATURATED`
            where a channel is overexposed.

        """
        return tuple(camera.corrected(image, self._saturation)
                     for camera, image in zip(self._cameras, (left, right)))


class _Prepared:
    """What the correction of one camera needs, in the types of the kernel."""

    def __init__(self, camera, scales):
        self.light = camera.light().astype(np.float32)
        self.gain = camera.gains().astype(np.float32)
        self.matrix = (scales[:, None] * np.linalg.inv(camera.crosstalk)).astype(np.float32)
        self._zooms = [None, None]
        if np.abs(camera.corner_shift()).max() >= _LEAST_SHIFT:
            self._zooms = [zoomed(camera.size, zoom) for zoom in camera.aberration]

    def corrected(self, image, saturation):
        out = np.empty_like(image)
        correct_colors(self._in_register(image), self.light, self.gain, self.matrix,
                       saturation, np.float32(PEDESTAL), np.float32(CEILING),
                       np.uint8(SATURATED), out)
        return out

    def _in_register(self, image):
        """Return the image with red and blue as large as green."""
        if self._zooms[0] is None:
            return image
        image = image.copy()
        for channel, maps in zip((0, 2), self._zooms):
            image[..., channel] = cv2.remap(image[..., channel], *maps, cv2.INTER_LINEAR,
                                            borderMode=cv2.BORDER_REPLICATE)
        return image


def zoomed(size, zoom):
    """Return the maps of cv2.remap that read a channel which is magnified by 1 + zoom."""
    width, height = size
    x, y = (np.arange(count) - 0.5 * (count - 1) for count in (width, height))
    x, y = np.meshgrid((1 + zoom) * x + 0.5 * (width - 1), (1 + zoom) * y + 0.5 * (height - 1))
    return cv2.convertMaps(x.astype(np.float32), y.astype(np.float32), cv2.CV_16SC2)


def linear(level, gamma, offset):
    """
    Return f of a level: the light that a response gives it.

    Parameters
    ----------
    level : numpy.ndarray
        Share of full scale above the dark level; noise below zero stays below zero.
    gamma, offset : float
        Of the curve of the camera.

    Returns
    -------
    light : numpy.ndarray, float64
        0 at 0, 1 at 1.

    """
    size = np.abs(level)
    start, end = offset ** gamma, (1 + offset) ** gamma
    return np.sign(level) * ((size + offset) ** gamma - start) / (end - start)


def _checked(name, value, shape):
    """Return a value as a float or a float64 array of this shape, or raise CalibrationError."""
    low, high = _RANGES[name]
    try:
        array = np.array(value, np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.ndim != len(shape) or any(
            wanted not in (None, found) for wanted, found in zip(shape, array.shape)):
        expected = ' x '.join('n' if each is None else str(each) for each in shape) or 'one'
        raise CalibrationError(f'{name}: expected {expected} numbers')
    if array.size == 0 or not ((array >= low) & (array <= high)).all():
        raise CalibrationError(f'{name} = {np.round(array, 4).tolist() if array.size < 10 else ""}'
                               f': expected numbers in {low} .. {high}')
    array.setflags(write=False)
    return array if shape else float(array)


def _camera(side, values):
    """Return the CameraColor that a mapping of a file holds."""
    if not isinstance(values, dict):
        raise CalibrationError(f'{side}: expected the values of a camera')
    names = [spec.name for spec in fields(CameraColor)]
    missing = [name for name in names if name not in values]
    if missing:
        raise CalibrationError(f'{side}: {missing[0]} is missing')
    try:
        return CameraColor(**{name: values[name] for name in names})
    except (CalibrationError, TypeError, ValueError) as error:
        raise CalibrationError(f'{side}.{error}') from error


def _plain(value):
    """Return a value as YAML writes it shortly."""
    if isinstance(value, tuple):
        return list(value)
    rounded = np.round(value, _DECIMALS)
    return rounded.tolist() if isinstance(value, np.ndarray) else float(rounded)
