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
"""The part of a result that is published: a box cut out, every second or fourth pixel."""

from dataclasses import replace

import numpy as np

from .cloud import single
from .cloud_kernels import find_outside
from ..core.status import Status
from ..core.triangulation import rays


def trimmed(result, context):
    """
    Return the result that the outputs show.

    What stays is that of the whole result, bit for bit. Outside of `output.region` a pixel is
    unknown, and its status OUT_OF_RANGE. With `output.decimation` N the pixels 0, N, 2 N .. of
    rows and columns stay. Disparities and the camera are then in the larger pixels:

        u' = u / N,   fx' = fx / N,   cx' = cx / N,   d' = d / N

    Pixel 0 keeps its center, so that no half pixel is lost or gained. Depth and points stay.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    context : Context
        What the outputs of a pair share.

    Returns
    -------
    result : RangeResult
        The same object where there is nothing to cut.

    """
    settings = context.settings.output
    if settings.box is not None:
        result = cropped(result, settings.box, context.points_rotation)
    return result if settings.decimation == 1 else decimated(result, settings.decimation)


def cropped(result, box, rotation=None):
    """
    Return a result whose points outside a box are unknown.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    box : sequence
        Smallest and largest x, y and z, m; both belong to the box.
    rotation : numpy.ndarray, shape (3, 3), optional
        From the rectified left camera to the frame of the box.

    Returns
    -------
    result : RangeResult

    """
    outside = np.empty(result.depth.shape, bool)
    find_outside(result.depth, *rays(result.geometry),
                 single(np.eye(3) if rotation is None else rotation), np.array(box, np.float32),
                 outside)

    def unknown(values, nothing):
        return np.where(outside, values.dtype.type(nothing), values)

    def normals():
        found = result.normals().copy()
        found[outside] = np.nan
        return found

    return replace(
        result, depth=unknown(result.depth, np.nan),
        disparity=unknown(result.disparity, np.nan),
        disparity_std=unknown(result.disparity_std, np.nan),
        confidence=unknown(result.confidence, 0), views=unknown(result.views, 0),
        status=unknown(result.status, Status.OUT_OF_RANGE),
        image_source=lambda: result.image, normals_source=normals)


def decimated(result, step):
    """
    Return a result of the pixels 0, step, 2 step .. of rows and columns.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    step : int
        A power of two, so that quotients are exact.

    Returns
    -------
    result : RangeResult

    """
    def kept(values):
        return np.ascontiguousarray(values[::step, ::step])

    geometry = result.geometry
    lengths = ('focal_x', 'focal_y', 'center_x_left', 'center_x_right', 'center_y')
    height, width = result.depth[::step, ::step].shape
    share = np.float32(1 / step)
    return replace(
        result, depth=kept(result.depth), disparity=kept(result.disparity) * share,
        disparity_std=kept(result.disparity_std) * share, confidence=kept(result.confidence),
        views=kept(result.views), status=kept(result.status),
        image_source=lambda: kept(result.image), normals_source=lambda: kept(result.normals()),
        geometry=replace(geometry, width=width, height=height, **{
            name: getattr(geometry, name) / step for name in lengths}),
        disparity_limits=tuple(limit / step for limit in result.disparity_limits))
