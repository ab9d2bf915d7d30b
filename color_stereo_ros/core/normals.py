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
"""Surface normals of a result: planes of the disparity around every pixel."""

import numpy as np

from .normal_kernels import fit_slopes, read_planes, write_normals

PLANES, ROUGH = (4, 1, 2, 1), (6, 3, 3, 0)
"""
Where a fit looks, with fitted planes and without: nodes to either side, steps down and along,
shift of every other row. Chosen: wider fits flatten spheres (50 mm at .38 m: 1.45 degrees instead
of .9), narrower ones are noisier on planes (`python -m color_stereo_ros.evaluation.normals`).
"""
GATE, BEND = 0.15, 1e-4
"""
Disparity by which a node may miss the plane of another, px, and what is added for each squared
node between them, as a share of the disparity above that of infinity: so surfaces bend. Chosen:
half of BEND flattens spheres, twice of it rounds creases.
"""
RIDGE = 0.5
"""Weight of the mean slopes of the planes, nodes^2; chosen."""
ROUGH_GATE, ROUGH_SECOND = 1.0, 0.5
"""The gates of both fits where no planes are known, px; chosen."""


def normals_of(disparity, geometry, planar):
    """
    Return the unit normals of the surface.

    The slopes of the disparity at a node of 2 x 2 pixels are averaged by least squares with the
    nodes around whose planes go on into it. Between the nodes they change evenly.

    Parameters
    ----------
    disparity : numpy.ndarray, float32, shape (H, W)
        px, NaN = unknown.
    geometry : RectifiedGeometry
        Of the rectified pair.
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
    lattice, offset = PLANES if planar else ROUGH, f4(geometry.principal_offset)
    gate, bend = (f4(GATE), f4(BEND)) if planar else (f4(ROUGH_SECOND), f4(0))
    reach = lattice[0]
    d, a, b = np.empty((3, rows + 2 * reach, columns + 2 * reach), f4)
    slopes = np.empty((2, rows, columns), f4)
    read_planes(disparity, reach, d, a, b)
    if not planar:
        a[:], b[:] = 0, 0
        fit_slopes(d, a, b, *lattice, f4(ROUGH_GATE), f4(0), offset, f4(0), *slopes)
        inner = slice(reach, reach + rows), slice(reach, reach + columns)
        a[inner], b[inner] = slopes
    fit_slopes(d, a, b, *lattice, gate, bend, offset, f4(RIDGE), *slopes)
    write_normals(disparity, *slopes, offset, f4(geometry.focal_x),
                  f4(geometry.focal_y), f4(geometry.center_x_left), f4(geometry.center_y),
                  normals)
    return normals
