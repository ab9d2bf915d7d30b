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
"""The points of a result as the content of a sensor_msgs/PointCloud2."""

import numpy as np

from .cloud_kernels import fill_points, join_fields, turn_vectors
from .contents import new_memory, PointCloud2, PointField
from ..core.results import NORMALS
from ..core.triangulation import rays

POINT_STEP = 16
"""Bytes of a point without optional fields: x, y, z (float32, m) and rgb (0x00RRGGBB)."""

_NAMES = 'x', 'y', 'z', 'rgb'


def cloud(result, header, *, compact=False, rotation=None, memory=new_memory, fields=()):
    """
    Return the points of a result.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    header : Header
        Stamp and frame of the message.
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
    if compact:
        _pick(_filled(_new_records(result, names), result, rotation, fields), known, view)
    else:
        _filled(view, result, rotation, fields)
    return PointCloud2(header, rows, columns, _described(names), False, step, step * columns,
                       data, compact)


def _described(names):
    """Return the PointField of every name; each has 4 bytes."""
    return tuple(PointField(name, 4 * place) for place, name in enumerate(names))


def _new_records(result, names):
    return np.empty((*result.depth.shape, len(names)), np.float32)


def _pick(records, known, view):
    """Write the known records, float32 (H, W, n), into the one row of a message."""
    if records.itemsize * records.shape[2] == POINT_STEP:
        # complex128 has the 16 bytes of a point: they are picked as one
        records, view = records.view(np.complex128), view.view(np.complex128)
    view[0] = records[known]


def _filled(records, result, rotation, fields):
    """Write all fields into float32 (H, W, 4 + number of optional ones); return them."""
    if not fields:
        _fill(records, result, rotation)
        return records
    first = _new_records(result, _NAMES)
    _fill(first, result, rotation)
    join_fields(first, _optional(result, rotation, fields), records)
    return records


def _optional(result, rotation, fields):
    """Return the values of optional fields, float32 (number, H, W)."""
    values = np.empty((len(fields), *result.depth.shape), np.float32)
    turned = None
    for name, out in zip(fields, values):
        if name not in NORMALS:
            out[:] = getattr(result, name)
            continue
        if turned is None:
            turned = _turned(result.normals(), rotation)
        out[:] = turned[..., NORMALS.index(name)]
    return values


def _fill(records, result, rotation):
    """Write x, y, z and the bits of the color into float32 (H, W, 4)."""
    fill_points(result.depth, result.image, *rays(result.geometry), records)
    if rotation is not None:
        turn_vectors(records, single(rotation))


def _turned(vectors, rotation):
    """Return float32 (H, W, 3) in another frame."""
    if rotation is None:
        return vectors
    turned = vectors.copy()
    turn_vectors(turned, single(rotation))
    return turned


def single(rotation):
    """Return a rotation as kernels take it, float32 (3, 3) by rows."""
    return np.asarray(rotation, np.float32, order='C')
