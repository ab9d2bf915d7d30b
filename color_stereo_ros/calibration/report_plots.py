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
"""The plots of the report about a calibration, each a self-contained piece of HTML."""

from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
import numpy as np

from .views import SIDES
from ..core.constants import ROBUST_STD
from ..pages.plots import as_image, as_svg, plain_numbers, styled

COLORS = dict(zip(SIDES, ('#1f4e8c', '#c8553d')))
ARROW = 0.06       # of the image's width: the longest arrow of a residual
LONGEST = 99.0     # percentile of the residuals that gets an arrow of that length
BINS = 41


@styled
def residual_plot(size, pixels, residuals):
    """
    Plot the residuals over both images, much enlarged.

    Parameters
    ----------
    size : (int, int)
        Width and height, px.
    pixels, residuals : dict by 'left' and 'right'
        float64 (n, 2), px: places of the corners, and measured minus predicted place.

    Returns
    -------
    html : str

    """
    figure = Figure((10.4, 4.1))
    longest = max(np.percentile(np.linalg.norm(np.concatenate(list(residuals.values())), axis=1),
                                LONGEST), 1e-9)
    factor = ARROW * size[0] / longest
    for axes, side in zip(figure.subplots(1, 2), SIDES):
        _image_axes(axes, size, f'{side}, x {factor:.0f}')
        axes.quiver(*pixels[side].T, *(factor * residuals[side]).T, angles='xy',
                    scale_units='xy', scale=1, width=0.0016, color=COLORS[side])
    return as_image(figure)


@styled
def residual_histogram(residuals):
    """Plot how often residuals of each size occur, both coordinates; as `residual_plot`."""
    figure = Figure((6.4, 2.7))
    axes = figure.subplots()
    every = np.concatenate([each.ravel() for each in residuals.values()])
    reach = 4 * max(ROBUST_STD * np.median(np.abs(every)), 1e-9)
    for side in SIDES:
        axes.hist(residuals[side].ravel(), np.linspace(-reach, reach, BINS), histtype='step',
                  color=COLORS[side], lw=1.6, label=side)
    axes.set(xlabel='measured minus predicted place, px', ylabel='coordinates')
    axes.legend()
    return as_svg(figure)


@styled
def coverage_plot(size, pixels):
    """Plot where corners were seen in both images; arguments as `residual_plot`."""
    figure = Figure((10.4, 4.1))
    for axes, side in zip(figure.subplots(1, 2), SIDES):
        _image_axes(axes, size, f'{side}, {len(pixels[side])} corners')
        axes.plot(*pixels[side].T, '.', ms=2.2, color=COLORS[side], alpha=0.55)
    return as_image(figure)


@styled
def depth_map_plot(size, depths, maps):
    """
    Plot the standard deviation of the depth over the image at some depths.

    Parameters
    ----------
    size : (int, int)
        Of the rectified image, px.
    depths : sequence of float
        m.
    maps : sequence of numpy.ndarray, float64, shape (R, C)
        mm, over a grid that spans the image; NaN where a camera does not see the place.

    Returns
    -------
    html : str

    """
    columns = 2
    figure = Figure((10.4, 3.4 * -(-len(depths) // columns)), layout='constrained')
    known = np.concatenate([each[np.isfinite(each)] for each in maps])
    # one scale for all maps; the corners of the image may be a hundred times worse
    colors = LogNorm(*np.percentile(known, (0, 100))) if known.size else None
    for axes, depth, values in zip(figure.subplots(-(-len(depths) // columns), columns).flat,
                                   depths, maps):
        _image_axes(axes, size, f'Z = {1e3 * depth:.0f} mm')
        shown = axes.imshow(values, extent=(-0.5, size[0] - 0.5, size[1] - 0.5, -0.5),
                            cmap='viridis', norm=colors)
        bar = figure.colorbar(shown, ax=axes, shrink=0.8, label='mm')
        plain_numbers(bar.ax.yaxis)
    return as_image(figure)


@styled
def depth_curve_plot(depths, calibration, sigma_px, matching):
    """
    Plot the standard deviation of the depth over the depth, on the axis.

    Parameters
    ----------
    depths, calibration, matching : numpy.ndarray, float64, shape (n,)
        m; mm from the calibration; mm from disparities of `sigma_px`.
    sigma_px : float
        Standard deviation of a corner, px.

    Returns
    -------
    html : str

    """
    figure = Figure((6.4, 2.9))
    axes = figure.subplots()
    axes.plot(1e3 * depths, calibration, color='#0b7a5b', lw=2, label='by the calibration')
    axes.plot(1e3 * depths, matching, '--', color='#8a94a6',
              label=f'by matching, {sigma_px:g} px, each pixel')
    axes.set(xlabel='Z, mm', ylabel='standard deviation, mm', ylim=(0, None))
    axes.legend()
    return as_svg(figure)


@styled
def rows_plot(size, places, rows, sigma):
    """
    Plot row errors of the rectified corners over the image, and beside what is expected.

    Parameters
    ----------
    size : (int, int)
        Of the rectified image, px.
    places : numpy.ndarray, float64, shape (n, 2)
        Rectified left pixels.
    rows : numpy.ndarray, float64, shape (n,)
        y_left - y_right, px.
    sigma : float
        px, of the calibration alone, in the middle of the image.

    Returns
    -------
    html : str

    """
    figure = Figure((10.4, 3.6))
    image, histogram = figure.subplots(1, 2)
    reach = max(np.percentile(np.abs(rows), 98), 1e-6)
    _image_axes(image, size, 'row error of the corners')
    shown = image.scatter(*places.T, c=rows, s=7, cmap='coolwarm', vmin=-reach, vmax=reach)
    figure.colorbar(shown, ax=image, shrink=0.72, format='%.2g', label='px')
    histogram.hist(rows, np.linspace(-2 * reach, 2 * reach, BINS), color='#8a94a6')
    for place in (-sigma, sigma):
        histogram.axvline(place, color='#0b7a5b', lw=1.4,
                          label='1 sigma of the calibration' if place > 0 else None)
    histogram.set(xlabel='row error, px', ylabel='corners')
    histogram.legend()
    return as_svg(figure)


@styled
def view_plot(names, rms):
    """
    Plot the residual of each used view.

    Parameters
    ----------
    names : sequence of str
        Of the views.
    rms : numpy.ndarray, float64, shape (n,)
        px.

    Returns
    -------
    html : str

    """
    figure = Figure((10.4, 2.6))
    axes = figure.subplots()
    axes.bar(range(len(names)), rms, color='#0b7a5b', width=0.7)
    axes.set(ylabel='rms residual, px', xlim=(-0.6, len(names) - 0.4))
    axes.set_xticks(range(len(names)), names, rotation=70, ha='right', fontsize=7)
    return as_svg(figure)


def _image_axes(axes, size, title):
    """Let axes show an image: y downwards, equal scales, its frame."""
    axes.set(xlim=(-0.5, size[0] - 0.5), ylim=(size[1] - 0.5, -0.5), title=title, aspect='equal')
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(True)
