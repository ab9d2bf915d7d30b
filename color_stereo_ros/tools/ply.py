# SPDX-License-Identifier: Apache-2.0
"""Colored point clouds as PLY files, which MeshLab, CloudCompare, Open3D and Blender read."""

import numpy as np

from .files import write_bytes

VERTEX = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'),
                   ('red', 'u1'), ('green', 'u1'), ('blue', 'u1')])


def write_ply(path, points, colors):
    """
    Write the known points of an organized cloud.

    Parameters
    ----------
    path : str or Path
    points : numpy.ndarray, float32, shape (H, W, 3)
        m; points with a NaN are left out.
    colors : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    Returns
    -------
    count : int
        Number of points written.

    """
    known = np.isfinite(points).all(axis=2)
    vertices = np.empty(np.count_nonzero(known), VERTEX)
    for index, name in enumerate(('x', 'y', 'z')):
        vertices[name] = points[known, index]
    for index, name in enumerate(('red', 'green', 'blue')):
        vertices[name] = colors[known, index]
    header = ['ply', 'format binary_little_endian 1.0', f'element vertex {vertices.size}']
    header += [f'property {"float" if VERTEX[name] == "<f4" else "uchar"} {name}'
               for name in VERTEX.names]
    header = '\n'.join([*header, 'end_header', ''])
    write_bytes(path, header.encode('ascii') + vertices.tobytes())
    return vertices.size
