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
"""The projector as the camera that it is to others: the CameraInfo of the pattern image."""

import numpy as np

from .contents import CameraInfo, Header

TOPIC = 'projector/camera_info'
FRAME = 'projector_optical_frame'
PERIOD = 1.0
"""s between two messages: the geometry gets a little better with every pair."""


class ProjectorNews:
    """Tells when the projector of a pair is worth a message: where it is new, not too often."""

    def __init__(self):
        self._model, self._last = None, float('-inf')

    def model(self, track, now):
        """
        Return the ProjectorModel to be told, None if nothing is.

        Parameters
        ----------
        track : Track or None
            Of the latest pair.
        now : float
            s.

        """
        if track is None or not track.usable or track.model is self._model:
            return None
        if now - self._last < PERIOD:
            return None
        self._model, self._last = track.model, now
        return self._model


def projector_info(model, stamp):
    """
    Return a ProjectorModel as a CameraInfo.

    As with the right camera of a stereo pair, P refers to the rectified left camera:

        (u, v, 1) ~ P (X, Y, Z, 1)                   a pixel of the rectified projector
        raw pixel = K distort(R^T K_P^-1 (u, v, 1))  the pixel of the pattern; K_P = K

    R turns coordinates of the projector into the axes of the rectified left camera.

    Parameters
    ----------
    model : ProjectorModel
        Geometry of the projector.
    stamp : Time
        Of the pair that showed it.

    Returns
    -------
    content : CameraInfo

    """
    width, height = model.size
    shift = model.camera_matrix @ model.rotation.T @ model.translation
    return CameraInfo(Header(stamp, FRAME), height, width, 'plumb_bob',
                      np.array([model.distortion, 0.0, 0.0, 0.0, 0.0]),
                      model.camera_matrix.ravel(), model.rotation.T.ravel(),
                      np.column_stack([model.camera_matrix, shift]).ravel())
