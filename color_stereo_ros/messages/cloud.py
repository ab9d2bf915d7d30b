# SPDX-License-Identifier: Apache-2.0
"""The points of a result as the content of a sensor_msgs/PointCloud2."""

import cv2
import numpy as np

from ..core.results import NORMALS
from ..core.triangulation import rays
from .cloud_kernels import fill_points
from .contents import new_memory, PointCloud2, PointField

POINT_STEP = 16
"""Bytes of a point without optional fields: x, y, z (float32, m) and rgb (0x00RRGGBB)."""

_NAMES = 'x', 'y', 'z', 'rgb'


def cloud(result, header, *, compact=False, rotation=None, memory=new_memory, fields=()):
    """
    Return the points of a result.

    Parameters
    ----------
    result : RangeResult
    header : Header
    compact : bool
        False: organized H x W, NaN = unknown. True: one row of the known points only.
    rotation : numpy.ndarray, shape (3, 3), optional
        Turns points and normals from the rectified left camera into another frame.
    memory : callable
        Called with a size, returns that many bytes to write into.
    fields : sequence of str
        More fields of each point, of `core.results.POINT_FIELDS`, float32, behind the others.

    Returns
    -------
    content : PointCloud2
        Fields x y z rgb; rgb as rviz and PCL read it, the bytes B, G, R, 0.

    """
    names = *_NAMES, *fields
    known = np.isfinite(result.depth) if compact else None
    rows, columns = (1, int(np.count_nonzero(known))) if compact else result.depth.shape
    step = 4 * len(names)
    data = memory(rows * columns * step)
    view = np.frombuffer(data, np.float32).reshape(rows, columns, len(names))
    if compact or fields:
        _write(_all_points(result, rotation), view[..., :4], known)
    else:
        _fill(view, result, rotation)
    for place, values in enumerate(_optional(result, rotation, fields), 4):
        view[..., place] = values if known is None else values[known]
    return PointCloud2(header, rows, columns, _described(names), False, step, step * columns,
                       data, compact)


def _described(names):
    """Return the PointField of every name; each has 4 bytes."""
    return tuple(PointField(name, 4 * place) for place, name in enumerate(names))


def _all_points(result, rotation):
    """Return x, y, z and the bits of the color of every pixel, float32 (H, W, 4)."""
    records = np.empty((*result.depth.shape, 4), np.float32)
    _fill(records, result, rotation)
    return records


def _write(records, view, known):
    """Write all records, or the known ones, into a part of each point of the message."""
    if known is None:
        view[:] = records
    elif view.strides[-2] == POINT_STEP:
        # complex128 has the 16 bytes of a point: they are picked as one
        view.view(np.complex128)[0, :, 0] = records.view(np.complex128)[..., 0][known]
    else:
        view[0] = records[known]


def _optional(result, rotation, fields):
    """Yield the values of optional fields, float32 (H, W)."""
    turned = None
    for name in fields:
        if name not in NORMALS:
            yield getattr(result, name)
            continue
        if turned is None:
            turned = _turned(result.normals(), rotation)
        yield turned[..., NORMALS.index(name)]


def _fill(records, result, rotation):
    """Write x, y, z and the bits of the color into float32 (H, W, 4)."""
    fill_points(result.depth, result.image, *rays(result.geometry), records)
    if rotation is not None:
        records[..., :3] = _turned(np.ascontiguousarray(records[..., :3]), rotation)


def _turned(vectors, rotation):
    """Return float32 (H, W, 3) in another frame."""
    return vectors if rotation is None else cv2.transform(vectors, rotation.astype(np.float32))
