# SPDX-License-Identifier: Apache-2.0
"""Surface normals of a result: planes of the disparity around every pixel."""

import numpy as np

from .normal_kernels import fit_slopes, read_planes, write_normals

REACH, STRIDE = 6, 3
"""Nodes to either side that a fit looks at, and every how many; chosen by simulated scenes."""
GATE = 0.5
"""Disparity by which a node may miss the plane of another, px; chosen likewise."""
RIDGE = 0.5
"""Weight of the mean slopes of the planes, nodes^2; chosen."""
ROUGH_GATE = 1.0
"""The gate where no planes are known, px; chosen."""


def normals_of(disparity, geometry, planar):
    """
    Return the unit normals of the surface.

    The slopes of the disparity at a pixel are those of its node of 2 x 2 pixels, averaged by
    least squares with the nodes around whose planes go on into it.

    Parameters
    ----------
    disparity : numpy.ndarray, float32, shape (H, W)
        px, NaN = unknown.
    geometry : RectifiedGeometry
    planar : bool
        The pixels of a node lie on a fitted plane, as those of the surface method do. False: the
        slopes are first taken from the disparities around.

    Returns
    -------
    normals : numpy.ndarray, float32, shape (H, W, 3)
        Rectified left camera, from the surface towards the camera's side; NaN = unknown.

    """
    height, width = disparity.shape
    normals = np.full((height, width, 3), np.nan, np.float32)
    if min(height, width) < 2:
        return normals
    f4 = np.float32
    rows, columns = height // 2, width // 2
    d, a, b = np.empty((3, rows + 2 * REACH, columns + 2 * REACH), f4)
    slopes = np.empty((2, rows, columns), f4)
    read_planes(disparity, REACH, d, a, b)
    if not planar:
        a[:], b[:] = 0, 0
        fit_slopes(d, a, b, REACH, STRIDE, f4(ROUGH_GATE), f4(0), *slopes)
        inner = slice(REACH, REACH + rows), slice(REACH, REACH + columns)
        a[inner], b[inner] = slopes
    fit_slopes(d, a, b, REACH, STRIDE, f4(GATE), f4(RIDGE), *slopes)
    write_normals(disparity, *slopes, f4(geometry.principal_offset), f4(geometry.focal_x),
                  f4(geometry.focal_y), f4(geometry.center_x_left), f4(geometry.center_y),
                  normals)
    return normals
