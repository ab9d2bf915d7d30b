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
"""From raw image pairs to pairs whose epipolar lines are the image rows."""

import cv2
import numpy as np

from .geometry import RectifiedPair
from .lenses import LENSES
from ...errors import ImageError

FAR_OUTSIDE = -1e4  # px, fits the 16-bit maps
ROUNDING = 1 / 32   # px, the resolution of the maps


class Rectifier:
    """
    Rectifies the pairs of one calibrated rig with maps that are built once.

    Parameters
    ----------
    calibration : StereoCalibration
    rectified_input : bool
        The images arrive rectified: only P of the calibration is used, nothing is resampled.

    Raises
    ------
    CalibrationError
        If raw images are to be rectified and K, D, R or a lens model do not allow it.

    """

    def __init__(self, calibration, rectified_input=False):
        """Build the maps."""
        self.geometry = calibration.geometry
        self.rectified_input = rectified_input
        shape = (self.geometry.height, self.geometry.width)
        if rectified_input:
            self._inside = (np.ones(shape, bool),) * 2
        else:
            calibration.check_raw()
            cameras = calibration.left, calibration.right
            coordinates = [raw_coordinates(camera) for camera in cameras]
            # Fixed-point maps resolve 1/32 px and are several times faster than float ones.
            self._maps = [cv2.convertMaps(xy[0], xy[1], cv2.CV_16SC2) for xy in coordinates]
            self._inside = [inside_image(*xy, camera.width, camera.height)
                            for xy, camera in zip(coordinates, cameras)]

    def rectify(self, left, right):
        """
        Rectify one pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images (rectified ones with rectified_input).

        Returns
        -------
        pair : RectifiedPair

        Raises
        ------
        ImageError
            If an image is no array, or its type or size is wrong.

        """
        left, right = self.checked(left, right)
        return RectifiedPair(self._resampled(left, 0), self._resampled(right, 1), *self._inside,
                             self.geometry)

    def rectify_left(self, image):
        """Return a checked raw left image, uint8 (H, W, 3), rectified."""
        return self._resampled(image, 0)

    def left_patches(self, image, pixels, half):
        """
        Return patches of the rectified left image, without making all of it.

        Parameters
        ----------
        image : numpy.ndarray, uint8, shape (H, W, 3)
            Checked raw image.
        pixels : numpy.ndarray, int, shape (N, 2)
            Column and row of the centers, at least half from the border.
        half : int
            Half width of the patches, px.

        Returns
        -------
        patches : numpy.ndarray, uint8, shape (N (2 half + 1), 2 half + 1, 3)
            One below the other.

        """
        around = np.arange(-half, half + 1)
        rows = pixels[:, 1, None, None] + around[:, None]
        columns = pixels[:, 0, None, None] + around
        shape = rows.shape[0] * around.size, around.size
        if self.rectified_input:
            return image[rows, columns].reshape(*shape, 3)
        places, between = self._maps[0]
        at = (rows * places.shape[1] + columns).reshape(shape)
        # column and row are read as one number
        first = np.take(places.reshape(-1).view(np.int32), at).view(np.int16)
        return cv2.remap(image, first.reshape(*shape, 2), np.take(between, at),
                         cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)

    def checked(self, left, right):
        """Return both images as contiguous RGB arrays, or raise ImageError; gray has no color."""
        pair = (checked_image('left', left, self.geometry),
                checked_image('right', right, self.geometry))
        return tuple(colored(image, bits_of(pair)) for image in pair)

    def _resampled(self, image, side):
        if self.rectified_input:
            return image
        return cv2.remap(image, *self._maps[side], cv2.INTER_LINEAR,
                         borderMode=cv2.BORDER_CONSTANT)


def checked_image(name, image, geometry):
    """Return the image as a contiguous array, or raise ImageError."""
    if not isinstance(image, np.ndarray):
        raise ImageError(f'{name} image is a {type(image).__name__}, expected a numpy array')
    gray = image.shape == (geometry.height, geometry.width)
    allowed = (np.uint8, np.uint16) if gray else (np.uint8,)
    if image.dtype not in allowed:
        raise ImageError(f'{name} image has dtype {image.dtype}, expected uint8'
                         + (' or uint16' if gray else ''))
    expected = (geometry.height, geometry.width, 3)
    if not gray and image.shape != expected:
        raise ImageError(f'{name} image has shape {image.shape}, expected {expected} '
                         f'(rows, columns, RGB) or {expected[:2]} (gray) as calibrated')
    return np.ascontiguousarray(image)


def bits_of(images):
    """Return how many bits the brightest pixel of some images needs, at least 8."""
    return max(8, 8, *(int(image.max(initial=0)).bit_length()
                       for image in images if image.dtype == np.uint16))


def colored(image, bits):
    """
    Return an image as uint8 (H, W, 3), without color if it has none.

    bits: of the values of uint16 images, the highest 8 of which are kept. A pair shares them, so
    that its brightness stays comparable.

    """
    if image.dtype == np.uint16:
        image = (image >> np.uint16(bits - 8)).astype(np.uint8)
    return image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)


def raw_coordinates(camera):
    """
    Return where each rectified pixel lies in the raw image.

    Parameters
    ----------
    camera : CameraModel
        One camera of the pair.

    Returns
    -------
    x, y : numpy.ndarray, float32, shape (H, W)
        Raw pixel coordinates; FAR_OUTSIDE where the ray lies behind the raw camera.

    """
    x, y = LENSES[camera.distortion_model].rectifying_map(camera)
    behind = _depth_along_raw_axis(camera) <= 0
    x[behind] = FAR_OUTSIDE
    y[behind] = FAR_OUTSIDE
    return x, y


def _depth_along_raw_axis(camera):
    """Return Z in the raw camera of each rectified pixel's ray (Z = 1 in the rectified one)."""
    ray_x = (np.arange(camera.width) - camera.P[0, 2]) / camera.P[0, 0]
    ray_y = (np.arange(camera.height) - camera.P[1, 2]) / camera.P[1, 1]
    axis = camera.R[:, 2]  # third row of R^T
    return axis[0] * ray_x + axis[1] * ray_y[:, None] + axis[2]


def inside_image(x, y, width, height):
    """
    Return where raw coordinates hit an image of width x height, bool, shape of x.

    Far outside the field of view a distortion polynomial turns back and mirrors parts of the
    image; there the map from rectified to raw pixels reverses its orientation.

    """
    (x_row, x_column), (y_row, y_column) = np.gradient(x), np.gradient(y)
    upright = x_column * y_row - x_row * y_column > 0
    return (upright & (x >= -ROUNDING) & (x <= width - 1 + ROUNDING)
            & (y >= -ROUNDING) & (y <= height - 1 + ROUNDING))
