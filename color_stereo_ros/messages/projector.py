# SPDX-License-Identifier: Apache-2.0
"""The projector as the camera that it is to others: the CameraInfo of the pattern image."""

import numpy as np

from .contents import CameraInfo, Header

TOPIC = 'projector/camera_info'
FRAME = 'projector_optical_frame'


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
