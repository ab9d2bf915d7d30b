# SPDX-License-Identifier: Apache-2.0
"""Colored points as PLY or PCD files, whole or not at all."""

from pathlib import Path

import numpy as np

from ..errors import RecordingError
from .atomic import write_bytes

_PLY = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'),
                 ('red', 'u1'), ('green', 'u1'), ('blue', 'u1')])
_PCD = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('rgb', '<u4')])


def save_cloud(path, points, colors):
    """
    Write the known points of an organized cloud, binary, little endian.

    Parameters
    ----------
    path : str or pathlib.Path
        Ends in .ply or .pcd. An existing file is replaced as a whole.
    points : numpy.ndarray, float32, shape (H, W, 3)
        m; NaN = unknown.
    colors : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    Returns
    -------
    count : int
        Points written.

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
    content = encoders[path.suffix](points[known], colors[known])
    try:
        write_bytes(path, content, make_folders=False, durable=True)
    except OSError as error:
        raise RecordingError(f'{path} cannot be written: {error.strerror or error}') from error
    return int(np.count_nonzero(known))


def _ply_bytes(points, colors):
    vertices = np.empty(len(points), _PLY)
    for index, name in enumerate(_PLY.names):
        vertices[name] = points[:, index] if index < 3 else colors[:, index - 3]
    kinds = ['float'] * 3 + ['uchar'] * 3
    header = ['ply', 'format binary_little_endian 1.0', f'element vertex {len(points)}',
              *(f'property {kind} {name}' for kind, name in zip(kinds, _PLY.names)),
              'end_header', '']
    return '\n'.join(header).encode('ascii') + vertices.tobytes()


def _pcd_bytes(points, colors):
    vertices = np.empty(len(points), _PCD)
    for index, name in enumerate('xyz'):
        vertices[name] = points[:, index]
    red, green, blue = colors.T.astype(np.uint32)
    vertices['rgb'] = red << 16 | green << 8 | blue
    header = ['# .PCD v0.7 - Point Cloud Data file format', 'VERSION 0.7', 'FIELDS x y z rgb',
              'SIZE 4 4 4 4', 'TYPE F F F U', 'COUNT 1 1 1 1', f'WIDTH {len(points)}', 'HEIGHT 1',
              'VIEWPOINT 0 0 0 1 0 0 0', f'POINTS {len(points)}', 'DATA binary', '']
    return '\n'.join(header).encode('ascii') + vertices.tobytes()
