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
"""A calibrated stereo pair: read, checked and written as ROS camera_info."""

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from . import checks
from .common_view import with_common_view, with_equal_centers
from .geometry import RectifiedGeometry
from .lenses import coefficients_of, LENSES
from ..arrays import Doubles, Size
from ...errors import CalibrationError
from ...files.atomic import write_text
from ...files.camera_info import camera_info_text, read_camera_info, WINDOW
from ...files.yaml import UnreadableError


@dataclass(frozen=True, eq=False)
class CameraModel:
    """
    One camera of a stereo pair: the content of its camera_info.

    Raises
    ------
    CalibrationError
        When built with a size or a P that no rectified camera has, or a field of a wrong length;
        names field and value. K, D, R and the lens model are judged by `check_raw`.

    """

    name: str
    """'left' or 'right'; error messages begin with it."""
    width: int
    """Columns of the raw image, px."""
    height: int
    """Rows of the raw image, px."""
    distortion_model: str
    """A name in `lenses.LENSES`: plumb_bob, rational_polynomial or equidistant."""
    D: Doubles
    """float64 (n,), distortion coefficients in OpenCV's order; empty = no distortion."""
    K: Doubles
    """float64 (3, 3), raw camera matrix, px."""
    R: Doubles
    """float64 (3, 3), rotates physical camera coordinates into rectified ones."""
    P: Doubles
    """
    float64 (3, 4), projection of the rectified camera.

    P[0, 3] of the right camera less that of the left one is -focal_x * baseline.
    """
    source: str = ''
    """The file from which the camera was read, for error messages; empty = no file."""

    def __post_init__(self) -> None:
        """Convert to float64 arrays of the right shapes; refuse an impossible size or P."""
        for field, shape in (('D', (-1,)), ('K', (3, 3)), ('R', (3, 3)), ('P', (3, 4))):
            self._keep(field, checks.matrix(f'{self.name} {field}', getattr(self, field), shape))
        for field in 'KP':
            self._keep(field, checks.without_dust(getattr(self, field)))
        model = self.distortion_model
        if isinstance(model, str) and model in LENSES and np.isfinite(self.D).all():
            self._keep('D', coefficients_of(LENSES[model], self.D))
        for field in 'DKRP':
            getattr(self, field).setflags(write=False)
        checks.check_size(self)
        checks.check_projection(self)
        for field in ('width', 'height'):
            self._keep(field, int(getattr(self, field)))

    def _keep(self, field, value):
        object.__setattr__(self, field, value)

    def check_raw(self) -> None:
        """
        Refuse K, D, R or a lens model from which no raw image can be rectified.

        Drivers of rectified images leave them empty. Such a camera serves rectified images.

        Raises
        ------
        CalibrationError
            Names file, field and value.

        """
        try:
            checks.check_raw(self)
        except CalibrationError as error:
            place = f'{self.source}: ' if self.source else ''
            advice = ('; images that are rectified already need P alone: say so by '
                      'input.rectified or --rectified' if checks.says_no_raw_camera(self) else '')
            raise CalibrationError(f'{place}{error}{advice}') from error


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

    def __post_init__(self) -> None:
        """Refuse cameras that do not belong together."""
        checks.check_same_size(self.left, self.right)
        checks.check_baseline(self.left, self.right)
        checks.check_shared_projection(self.left, self.right)

    @cached_property
    def geometry(self) -> RectifiedGeometry:
        """Return the RectifiedGeometry of the pair."""
        left, right = self.left.P, self.right.P
        return RectifiedGeometry(
            width=self.left.width, height=self.left.height,
            focal_x=float(left[0, 0]), focal_y=float(left[1, 1]),
            center_x_left=float(left[0, 2]), center_x_right=float(right[0, 2]),
            center_y=float(left[1, 2]), baseline=float((left[0, 3] - right[0, 3]) / right[0, 0]))

    def check_raw(self) -> None:
        """
        Refuse a pair whose raw images cannot be rectified; see `CameraModel.check_raw`.

        Raises
        ------
        CalibrationError

        """
        self.left.check_raw()
        self.right.check_raw()

    @property
    def right_from_left(self) -> tuple[Doubles, Doubles]:
        """
        Return rotation (3, 3) and translation (3,), m, of the physical cameras.

        X_right = R X_left + t.

        """
        self.check_raw()
        # Rectified frames differ by the baseline only: R_r X_right = R_l X_left - (B, 0, 0)
        rotation = self.right.R.T @ self.left.R
        return rotation, -self.right.R.T @ np.array([self.geometry.baseline, 0.0, 0.0])

    @classmethod
    def from_yaml(cls, left: str | PathLike[str], right: str | PathLike[str]) -> Self:
        """
        Read two ROS camera_info YAML files, or what `files.camera_info` reads besides.

        Parameters
        ----------
        left, right : path-like
            The files of both cameras.

        Returns
        -------
        calibration : StereoCalibration

        Raises
        ------
        CalibrationError
            If a file cannot be read, is no calibration, or holds an impossible size or P. K, D
            and R are judged when raw images are to be rectified: see `check_raw`.

        """
        return cls(_camera_from_yaml('left', left), _camera_from_yaml('right', right))

    @classmethod
    def from_camera_info(cls, left: Any, right: Any) -> Self:
        """
        Take two sensor_msgs/CameraInfo messages, or anything with the same fields.

        Parameters
        ----------
        left, right : object
            With fields width, height, distortion_model, d, k, r and p; binning_x, binning_y and
            roi are looked at where they are there.

        Returns
        -------
        calibration : StereoCalibration

        Raises
        ------
        CalibrationError
            If size or P are impossible, or the image is binned or a part of the calibrated one.
            K, D and R are judged when raw images are to be rectified: see `check_raw`.

        """
        for name, info in (('left', left), ('right', right)):
            checks.check_whole_image(name, info)
        return cls(_camera_from_info('left', left), _camera_from_info('right', right))

    @classmethod
    def from_arrays(cls, size: Size, K_left: ArrayLike, D_left: ArrayLike | None,
                    K_right: ArrayLike, D_right: ArrayLike | None, R: ArrayLike, t: ArrayLike,
                    distortion_model: str | None = None) -> Self:
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
            Rotation of X_right = R X_left + t.
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
            outside the raw images where that is possible. Where equal cx cost nothing of this,
            both P get the mean of the two.

        Raises
        ------
        CalibrationError
            If a value is impossible, or the cameras see nothing in common.

        """
        distortion = [() if D is None else np.ravel(D) for D in (D_left, D_right)]
        if distortion_model is None:
            longest = max(len(D) for D in distortion)
            distortion_model = 'rational_polynomial' if longest > 5 else 'plumb_bob'
        # The raw cameras are checked before OpenCV sees them; R and P follow.
        raw = [CameraModel(name, *checks.checked_size(size), distortion_model, D, K, np.eye(3),
                           np.eye(3, 4))
               for name, D, K in zip(('left', 'right'), distortion, (K_left, K_right))]
        for camera in raw:
            camera.check_raw()
        rotation, translation = checks.checked_motion(R, t)
        views = LENSES[distortion_model].rectified_views(*raw, rotation, translation)
        views = with_common_view(*raw, rotation, translation, views)
        rectified = with_equal_centers(*raw, rotation, translation, views)
        return cls(*(CameraModel(camera.name, camera.width, camera.height, distortion_model,
                                 camera.D, camera.K, R_rect, P)
                     for camera, (R_rect, P) in zip(raw, rectified)))

    def to_yaml(self, left_path: str | PathLike[str], right_path: str | PathLike[str]) -> None:
        """
        Write two ROS camera_info YAML files; an existing file is replaced as a whole.

        Parameters
        ----------
        left_path, right_path : path-like
            The files of both cameras.

        Raises
        ------
        CalibrationError
            If a file cannot be written.

        """
        _camera_to_yaml(self.left, left_path)
        _camera_to_yaml(self.right, right_path)


def _camera_from_info(name, info):
    """Return the CameraModel of one CameraInfo."""
    return CameraModel(name, info.width, info.height, info.distortion_model,
                       info.d, info.k, info.r, info.p)


def _camera_from_yaml(name, path):
    """Return the CameraModel of one camera_info file."""
    try:
        fields = read_camera_info(path)
    except UnreadableError as error:
        raise CalibrationError(f'{name} calibration {path} {error}') from error
    try:
        window = {field: fields.pop(field) for field in WINDOW if field in fields}
        if isinstance(window.get('roi'), dict):
            window['roi'] = SimpleNamespace(**window['roi'])
        camera = CameraModel(name, **fields, source=str(path))
        checks.check_whole_image(name, SimpleNamespace(
            width=camera.width, height=camera.height, **window))
        return camera
    except CalibrationError as error:
        raise CalibrationError(f'{path}: {error}') from error


def _camera_to_yaml(camera, path):
    """Write one camera_info file."""
    text = camera_info_text(camera.name, {
        'width': camera.width, 'height': camera.height,
        'distortion_model': camera.distortion_model,
        **{field: getattr(camera, field).ravel().tolist() for field in 'DKRP'}})
    try:
        write_text(path, text, make_folders=False)
    except OSError as error:
        raise CalibrationError(f'{camera.name} calibration {path} cannot be written: '
                               f'{error}') from error
