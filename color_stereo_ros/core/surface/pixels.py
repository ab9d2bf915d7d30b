# SPDX-License-Identifier: Apache-2.0
"""From nodes to pixels: the planes are evaluated and triangulated at every pixel."""

import numpy as np

from ..results import Measurement
from .grid_kernels import F4
from .pixel_kernels import expand
from .trust import log_odds


def measured_pixels(planes, verdict, geometry, limits, min_confidence):
    """
    Return the measurement at every pixel.

    Parameters
    ----------
    planes : PlaneField
    verdict : Verdict
    geometry : RectifiedGeometry
    limits : numpy.ndarray, float32, shape (2,)
        Smallest and largest disparity, px.
    min_confidence : float
        Pixels that are less probably right get no range, 0..1.

    Returns
    -------
    measurement : Measurement

    """
    shape = geometry.height, geometry.width
    disparity, depth, std, confidence = np.empty((4, *shape), F4)
    status = np.empty(shape, np.uint8)
    expand(*planes, verdict.std, verdict.log_odds, verdict.reason, *planes.grid.nodes, limits,
           F4(geometry.focal_baseline), F4(geometry.principal_offset), log_odds(min_confidence),
           disparity, depth, std, confidence, status)
    return Measurement(disparity=disparity, disparity_std=std, confidence=confidence,
                       status=status, depth=depth)
