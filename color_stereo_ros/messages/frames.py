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
"""The names of the physical and the rectified left camera, and the rotation between them."""

from dataclasses import dataclass

import cv2
import numpy as np

from .contents import (Header, Quaternion, TFMessage, Transform, TransformStamped, Vector3)
from ..core.cameras.checks import check_rotation
from ..errors import CalibrationError

TOPIC = '/tf_static'
ENDING, MARK = '_optical_frame', '_rectified'
SAME = 0.1
"""Degrees up to which both cameras have the same name."""


@dataclass(frozen=True, eq=False)
class Frames:
    """The physical left camera, the rectified one, and the rotation between them."""

    physical: str
    """frame_id of the left image."""
    rectified: str
    """frame_id of what is measured; the same where the cameras hardly differ."""
    rotation: np.ndarray
    """float64 (3, 3), from the rectified to the physical left camera."""

    def __eq__(self, other):
        """Return whether names and rotation are the same."""
        return (isinstance(other, Frames) and self.names == other.names
                and np.array_equal(self.rotation, other.rotation))

    @property
    def names(self):
        """Return both names, that of the physical camera first."""
        return self.physical, self.rectified

    @property
    def differ(self):
        """Return whether there is a transform to publish: two names, none of them empty."""
        return all(self.names) and self.physical != self.rectified

    @property
    def quaternion(self):
        """Return the rotation as x, y, z, w, float64 (4,), w >= 0."""
        turned = cv2.Rodrigues(self.rotation)[0].ravel()
        angle = np.linalg.norm(turned)
        axis = turned / angle if angle else turned
        return np.append(np.sin(angle / 2) * axis, np.cos(angle / 2))

    def transform(self, time_ns):
        """
        Return the static transform from the physical to the rectified camera.

        It holds X_physical = rotation X_rectified; the optical centers are the same.

        Parameters
        ----------
        time_ns : int
            Its stamp.

        Returns
        -------
        content : TFMessage

        """
        rotation = Quaternion(*map(float, self.quaternion))
        return TFMessage((TransformStamped(
            Header.at(time_ns, self.physical), self.rectified, Transform(Vector3(), rotation)),))

    @property
    def command(self):
        """Return the command that publishes the same transform."""
        numbers = (f'--q{name} {value:.9g}' for name, value in zip('xyzw', self.quaternion))
        return ('ros2 run tf2_ros static_transform_publisher --x 0 --y 0 --z 0 '
                f'{" ".join(numbers)} --frame-id {self.physical} '
                f'--child-frame-id {self.rectified}')


def rectified_name(frame_id):
    """
    Return the name that the rectified camera gets, for example `left_rectified_optical_frame`.

    Parameters
    ----------
    frame_id : str
        Of the physical camera; an empty one stays empty.

    """
    if frame_id.endswith(ENDING):
        return frame_id.removesuffix(ENDING) + MARK + ENDING
    return frame_id and frame_id + MARK


def frames_of(frame_id, calibration, settings):
    """
    Return the frames of a pair.

    Parameters
    ----------
    frame_id : str
        Of the left image.
    calibration : StereoCalibration
        Of the two cameras.
    settings : OutputSettings
        `frame_id` is the name of the rectified camera; empty = made from that of the image where
        R turns the camera by more than SAME.

    Returns
    -------
    frames : Frames

    """
    R = calibration.left.R
    try:
        check_rotation('R', R)
    except CalibrationError:  # a driver of rectified images may leave it empty
        R = np.eye(3)
    angle = np.degrees(np.linalg.norm(cv2.Rodrigues(R.copy())[0]))
    name = settings.frame_id or (rectified_name(frame_id) if angle > SAME else frame_id)
    return Frames(frame_id, name, R.T)
