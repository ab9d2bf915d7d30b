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
"""From nodes to pixels: the planes are evaluated and triangulated at every pixel."""

import numpy as np

from .grid_kernels import F4
from .pixel_kernels import expand
from ..results import Measurement


def measured_pixels(planes, verdict, geometry, limits, least_odds, beyond=None, lines=None):
    """
    Return the measurement at every pixel.

    Parameters
    ----------
    planes : PlaneField
        The planes of the nodes so far.
    verdict : Verdict
        What is believed of each node.
    geometry : RectifiedGeometry
        Of the rectified pair.
    limits : numpy.ndarray, float32, shape (2,)
        Smallest and largest disparity, px.
    least_odds : numpy.float32
        Pixels with lower log-odds of being right get no range.
    beyond : numpy.ndarray, bool, framed, optional
        Nodes whose place may lie outside the right image; default: none.
    lines : numpy.ndarray, int64, shape (N,), optional
        Rows of pixels that are asked for: all others hold anything. Default: all.

    Returns
    -------
    measurement : Measurement

    """
    shape = geometry.height, geometry.width
    disparity, depth, std, confidence = np.empty((4, *shape), F4)
    status = np.empty(shape, np.uint8)
    rows, columns = planes.grid.nodes
    if beyond is None:
        beyond = np.zeros(planes.grid.shape, bool)
    if lines is None:
        lines = np.arange(geometry.height)
    expand(planes.d, planes.a, planes.b, verdict.std, verdict.log_odds, verdict.reason, beyond,
           rows, columns, lines, limits, F4(geometry.focal_baseline),
           F4(geometry.principal_offset), least_odds, disparity, depth, std, confidence, status)
    return Measurement(disparity=disparity, disparity_std=std, confidence=confidence,
                       status=status, depth=depth)
