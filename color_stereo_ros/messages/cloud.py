# SPDX-License-Identifier: Apache-2.0
"""The points of a result as the content of a sensor_msgs/PointCloud2."""

import cv2
import numpy as np

from ..core.triangulation import rays
from .cloud_kernels import fill_points
from .contents import new_memory, PointCloud2, PointField

POINT_STEP = 16
"""Bytes of a point: x, y, z (float32, m) and rgb (0x00RRGGBB)."""

FIELDS = tuple(PointField(name, 4 * index) for index, name in enumerate(('x', 'y', 'z', 'rgb')))


def cloud(result, header, *, compact=False, rotation=None, memory=new_memory):
    """
    Return the points of a result.

    Parameters
    ----------
    result : RangeResult
    header : Header
    compact : bool
        False: organized H x W, NaN = unknown. True: one row of the known points only.
    rotation : numpy.ndarray, shape (3, 3), optional
        Turns the points from the rectified left camera into another frame.
    memory : callable
        Called with a size, returns that many bytes to write into.

    Returns
    -------
    content : PointCloud2
        Fields x y z rgb; rgb as rviz and PCL read it, the bytes B, G, R, 0.

    """
    known = np.isfinite(result.depth) if compact else None
    rows, columns = (1, int(np.count_nonzero(known))) if compact else result.depth.shape
    data = memory(rows * columns * POINT_STEP)
    view = np.frombuffer(data, np.float32).reshape(rows, columns, 4)
    if compact:
        records = np.empty((*result.depth.shape, 4), np.float32)
        _fill(records, result, rotation)
        # complex128 has the 16 bytes of a point: they are picked as one
        view.view(np.complex128)[0, :, 0] = records.view(np.complex128)[..., 0][known]
    else:
        _fill(view, result, rotation)
    return PointCloud2(header, rows, columns, FIELDS, False, POINT_STEP, POINT_STEP * columns,
                       data, compact)


def _fill(records, result, rotation):
    """Write x, y, z and the bits of the color into float32 (H, W, 4)."""
    fill_points(result.depth, result.image, *rays(result.geometry), records)
    if rotation is not None:
        points = np.ascontiguousarray(records[..., :3])
        records[..., :3] = cv2.transform(points, rotation.astype(np.float32))
