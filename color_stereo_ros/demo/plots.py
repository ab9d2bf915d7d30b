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
"""Plots of range images, as PNG bytes."""

from io import BytesIO

import numpy as np

from ..core.false_color import false_color

GRID = 3             # px between the corners of a facet of the surface plot
LARGEST_JUMP = 0.02  # share of the depth: a facet that spans more is a depth edge, not a surface
LIGHT = np.array((-0.4, -0.5, -0.77))  # direction towards the light, camera axes
AMBIENT = 0.35       # brightness of a facet that no light meets


def surface_plot(points, near, far):
    """
    Draw the measured surface in three dimensions (paper, fig. 3.2).

    Parameters
    ----------
    points : numpy.ndarray, float32, shape (H, W, 3)
        m, camera axes (x right, y down, z forward); NaN = unknown.
    near, far : float
        m; limits of the colors.

    Returns
    -------
    png : bytes

    """
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection
    quads = _facets(points[::GRID, ::GRID])
    figure = Figure(figsize=(8.0, 6.4), dpi=110)
    axes = figure.add_subplot(projection='3d', computed_zorder=False)
    # matplotlib's vertical axis is its third one: x right, z away from the viewer, -y up.
    corners = 1e3 * quads[..., (0, 2, 1)] * (1, 1, -1)
    colors = _facet_colors(quads, near, far)
    axes.add_collection3d(Poly3DCollection(corners, facecolors=colors, edgecolors=colors,
                                           linewidths=0.3))
    spans = []
    for index, limits in enumerate((axes.set_xlim, axes.set_ylim, axes.set_zlim)):
        low, high = np.percentile(corners[..., index], (0.2, 99.8)) if len(quads) else (0, 1)
        limits(low, high)
        spans.append(high - low)
    axes.set_box_aspect(spans)
    axes.locator_params(nbins=5)
    axes.set_xlabel('x, mm')
    axes.set_ylabel('depth, mm')
    axes.set_zlabel('height, mm')
    axes.view_init(elev=20, azim=-58)
    return _png(figure)


def _facets(points):
    """Return the corners of all facets without unknown corners and depth edges, (N, 4, 3)."""
    quads = np.stack((points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]), axis=2)
    quads = quads.reshape(-1, 4, 3)
    depth = quads[..., 2]
    quads = quads[np.isfinite(depth).all(axis=1)]
    depth = quads[..., 2]
    return quads[np.ptp(depth, axis=1) < LARGEST_JUMP * depth.mean(axis=1)].astype(np.float64)


def _facet_colors(quads, near, far):
    """Return the false colors of the facets, shaded by a distant light, float (N, 3)."""
    depth = quads[..., 2].mean(axis=1).astype(np.float32)
    colors = false_color(depth[None], near, far)[0] / 255.0
    shade = _shade(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    return np.clip(colors * shade[:, None], 0, 1)


def _shade(along_row, along_column):
    """Return the brightness 0..1 of surface patches that two tangents (..., 3) span."""
    normals = np.cross(along_column, along_row)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    return AMBIENT + (1 - AMBIENT) * np.clip(normals @ LIGHT, 0, 1)


def shaded(points, colors):
    """
    Shade the colors of an organized cloud by a distant light, so that shapes can be seen.

    Parameters
    ----------
    points : numpy.ndarray, float32, shape (H, W, 3)
        m; NaN = unknown. Points at the edge of the known keep their colors.
    colors : numpy.ndarray, uint8, shape (H, W, 3)
        Of the points, RGB.

    Returns
    -------
    colors : numpy.ndarray, uint8, shape (H, W, 3)

    """
    shade = _shade(np.gradient(points, axis=1), np.gradient(points, axis=0))
    return np.rint(colors * np.nan_to_num(shade, nan=1.0)[..., None]).astype(np.uint8)


def error_plot(error, limit):
    """
    Draw how far the measured depth is from the truth.

    Parameters
    ----------
    error : numpy.ndarray, float, shape (H, W)
        mm, measured minus true; NaN = nothing to compare.
    limit : float
        mm; errors beyond it get the color of the limit.

    Returns
    -------
    png : bytes

    """
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    figure = Figure(figsize=(6.2, 5.2), dpi=110)
    axes = figure.add_subplot()
    picture = axes.imshow(error, cmap=colormaps['RdBu'].with_extremes(bad='0.15'),
                          vmin=-limit, vmax=limit, interpolation='nearest')
    axes.set_axis_off()
    figure.colorbar(picture, ax=axes, shrink=0.9, extend='both',
                    label='measured minus true depth, mm')
    return _png(figure)


def _png(figure):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    stream = BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(stream, format='png', bbox_inches='tight', facecolor='white')
    return stream.getvalue()
