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
"""Colored points as PLY or PCD files, whole or not at all."""

from pathlib import Path

import numpy as np

from .atomic import write_bytes
from ..errors import RecordingError

_IN_PLY = {'normal_x': 'nx', 'normal_y': 'ny', 'normal_z': 'nz'}
"""Fields that PLY files name otherwise than PCD files."""


def save_cloud(path, points, colors, fields=None, *, organized=False, durable=True):
    """
    Write an organized cloud or its known points, binary, little endian.

    Parameters
    ----------
    path : str or pathlib.Path
        Ends in .ply or .pcd. An existing file is replaced as a whole.
    points : numpy.ndarray, float32, shape (H, W, 3)
        m; NaN = unknown.
    colors : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.
    fields : dict of str to numpy.ndarray, float32, shape (H, W), optional
        More fields of each point. A PLY file calls normal_x, normal_y, normal_z nx, ny, nz.
    organized : bool
        True: all H x W points row by row, unknown ones are NaN. False: the known points.
    durable : bool
        Wait until the disk holds the file.

    Returns
    -------
    count : int
        Known points written.

    Raises
    ------
    RecordingError
        If the suffix is another one, or the file cannot be written; names path and reason.

    """
    path = Path(path)
    encoders = {'.ply': _ply_bytes, '.pcd': _pcd_bytes}
    if path.suffix not in encoders:
        raise RecordingError(f'{path} ends in {path.suffix!r}, expected .ply or .pcd')
    known = np.isfinite(points).all(axis=2)
    chosen = np.ones_like(known) if organized else known
    shape = known.shape if organized else (1, int(np.count_nonzero(known)))
    content = encoders[path.suffix](points[chosen], colors[chosen], {
        name: values[chosen] for name, values in (fields or {}).items()}, shape, organized)
    try:
        write_bytes(path, content, make_folders=False, durable=durable)
    except OSError as error:
        raise RecordingError(f'{path} cannot be written: {error.strerror or error}') from error
    return int(np.count_nonzero(known))


def _ply_bytes(points, colors, fields, shape, organized):
    named = {_IN_PLY.get(name, name): values for name, values in fields.items()}
    normals = {name: values for name, values in named.items() if name in _IN_PLY.values()}
    columns = {**dict(zip('xyz', points.T)), **normals,
               **dict(zip(('red', 'green', 'blue'), colors.T)),
               **{name: values for name, values in named.items() if name not in normals}}
    kinds = {name: 'uchar' if values.dtype == np.uint8 else 'float'
             for name, values in columns.items()}
    grid = [f'obj_info num_cols {shape[1]}', f'obj_info num_rows {shape[0]}'] * organized
    header = ['ply', 'format binary_little_endian 1.0', *grid, f'element vertex {len(points)}',
              *(f'property {kind} {name}' for name, kind in kinds.items()), 'end_header', '']
    return '\n'.join(header).encode('ascii') + _records(columns)


def _pcd_bytes(points, colors, fields, shape, _):
    red, green, blue = colors.T.astype(np.uint32)
    columns = {**dict(zip('xyz', points.T)), 'rgb': red << 16 | green << 8 | blue, **fields}
    kinds = ['U' if values.dtype == np.uint32 else 'F' for values in columns.values()]
    header = ['# .PCD v0.7 - Point Cloud Data file format', 'VERSION 0.7',
              f'FIELDS {" ".join(columns)}', f'SIZE{" 4" * len(columns)}',
              f'TYPE {" ".join(kinds)}', f'COUNT{" 1" * len(columns)}', f'WIDTH {shape[1]}',
              f'HEIGHT {shape[0]}', 'VIEWPOINT 0 0 0 1 0 0 0', f'POINTS {len(points)}',
              'DATA binary', '']
    return '\n'.join(header).encode('ascii') + _records(columns)


def _records(columns):
    """Return columns of numbers as the bytes of one record a point, little endian."""
    records = np.empty(len(columns['x']), [(name, values.dtype.newbyteorder('<'))
                                           for name, values in columns.items()])
    for name, values in columns.items():
        records[name] = values
    return records.tobytes()
