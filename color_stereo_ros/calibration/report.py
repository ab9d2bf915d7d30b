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
"""The report about a calibration: one self-contained HTML page."""

from html import escape

import numpy as np

from . import report_plots as plots
from .views import SIDES
from .. import __version__
from ..pages.html import CSS, figure, note, section, table

HTML = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>color_stereo: calibration</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>{css}
section img, section svg {{ max-width: 100%; height: auto; width: auto; }}</style></head>
<body><header><div><h1>How well this pair is calibrated</h1><p>{lead}</p>
<nav><a href="#summary">Summary</a><a href="#depth">Depth</a><a href="#rows">Rows</a>
<a href="#residuals">Residuals</a><a href="#coverage">Coverage</a><a href="#views">Views</a>
<a href="#parameters">Parameters</a></nav></div></header><main>{body}</main></body></html>
"""
SHARES = 0.7, 1.0, 1.4, 2.0   # of the working distance: depths of the maps
GRID = 33, 25                 # points of a map
CURVE = np.linspace(0.5, 2.5, 41)  # of the working distance
MATCHING = 0.05               # px, disparity of a pixel on the simulated rig


def report_page(geometry):
    """
    Return the page about a Geometry as HTML text.

    Parameters
    ----------
    geometry : Geometry
        The calibration and how exact it is.

    Returns
    -------
    html : str

    """
    used, dropped = len(geometry.adjustment.views), len(geometry.dropped)
    lead = (f'{geometry.board.describe()}; {geometry.size[0]} x {geometry.size[1]} px; '
            f'{used} views used, {dropped} not.')
    body = [_summary(geometry), _depth(geometry), _rows(geometry), _residuals(geometry),
            _coverage(geometry), _views(geometry), _parameters(geometry)]
    return HTML.format(css=CSS, lead=escape(lead), body='\n'.join(body))


def _summary(geometry):
    tiles = [
        (f'{1e3 * geometry.depth_std():.3f} mm',
         f'standard deviation of the depth at {1e3 * geometry.distance:.0f} mm, by the '
         'calibration alone'),
        (f'{geometry.rows_std():.4f} px', 'standard deviation of the rows'),
        (f'{geometry.adjustment.rms:.3f} px', 'residual of the corners, rms'),
        (f'{1e3 * geometry.calibration.geometry.baseline:.2f} mm',
         f'baseline, +- {1e3 * geometry.baseline_std:.3f} mm'),
        (f'{1e3 * np.abs(geometry.adjustment.bend).max():.3f} mm',
         f'bend of the board, +- {1e3 * geometry.adjustment.bend_std.max():.3f} mm')]
    if geometry.agreement is not None:
        tiles.append((f'{geometry.agreement.ratio:.2f}', 'difference of calibrations from halves '
                      'of the views, over what is expected; 1 is honest'))
    shown = ''.join(f'<div class="tile"><b>{value}</b><span>{text}</span></div>'
                    for value, text in tiles)
    return section('summary', 'Summary', f'<div class="tiles">{shown}</div>' + ''.join(
        note(escape(line)) for line in geometry.summary()[1:2]))


def _depth(geometry):
    rectified = geometry.calibration.geometry
    axes = [np.linspace(0, extent - 1, count) for extent, count in
            zip((rectified.width, rectified.height), GRID)]
    x, y = np.meshgrid(*axes)
    depths = [share * geometry.distance for share in SHARES]
    maps = [np.where(_is_seen_right(rectified, x, Z), 1e3 * geometry.covariance.depth_std(
        geometry.calibration, x, y, np.full(x.shape, Z)), np.nan) for Z in depths]
    curve = CURVE * geometry.distance
    middle = (np.full(curve.shape, rectified.width / 2), np.full(curve.shape,
                                                                 rectified.height / 2))
    along = 1e3 * geometry.covariance.depth_std(geometry.calibration, *middle, curve)
    matching = 1e3 * curve**2 / rectified.focal_baseline * MATCHING
    return section('depth', 'Depth: how far it may be off', ''.join((
        note('Standard deviation of the depth by the calibration alone, mm, over the rectified '
             'left image. It shifts and bends the whole range image; it is no noise.'),
        figure(plots.depth_map_plot(geometry.size, depths, maps),
               'Maps of the standard deviation of the depth at four depths'),
        figure(plots.depth_curve_plot(curve, along, MATCHING, matching),
               'Standard deviation of the depth over the depth'))))


def _is_seen_right(rectified, x, Z):
    """Return which columns of the left image the right camera sees at a depth, bool."""
    right = x - rectified.focal_baseline / Z - rectified.principal_offset
    return (right >= 0) & (right <= rectified.width - 1)


def _rows(geometry):
    places, errors = geometry.rows()
    return section('rows', 'Rows', ''.join((
        note('Row errors of the corners after rectification: noise of both corners, and what is '
             'wrong with the calibration. A pattern over the image means that the lens model '
             'does not fit.'),
        figure(plots.rows_plot(geometry.size, places, errors, geometry.rows_std()),
               'Row errors of the corners over the image and as a histogram'))))


def _corners(geometry):
    """Return places and residuals of the kept corners by camera."""
    adjustment = geometry.adjustment
    kept = {side: adjustment.kept[side] for side in SIDES}
    return ({side: adjustment.corners[side].pixels[kept[side]] for side in SIDES},
            {side: adjustment.residuals[side][kept[side]] for side in SIDES})


def _residuals(geometry):
    pixels, residuals = _corners(geometry)
    return section('residuals', 'Residuals', ''.join((
        note('Measured minus predicted places of the corners. Arrows that turn together mean '
             'that the lens model does not fit, or that the board is not flat.'),
        figure(plots.residual_plot(geometry.size, pixels, residuals),
               'Residuals as arrows over both images'),
        figure(plots.residual_histogram(residuals), 'Histogram of the residuals'))))


def _coverage(geometry):
    pixels, _ = _corners(geometry)
    return section('coverage', 'Coverage', note(
        'Corners of all used views. Where there are none, the lens is extrapolated.') + figure(
            plots.coverage_plot(geometry.size, pixels), 'Places of the corners in both images'))


def _views(geometry):
    adjustment, rms = geometry.adjustment, geometry.view_rms()
    middle = geometry.board.corners.mean(axis=0)
    rows = []
    for index, view in enumerate(adjustment.views):
        place = adjustment.rotations[index] @ middle + adjustment.translations[index]
        tilt = np.degrees(np.arccos(np.clip(
            abs(adjustment.rotations[index][:, 2] @ place) / np.linalg.norm(place), 0, 1)))
        counts = [len(getattr(view, side).ids) if view.seen(side) else 0 for side in SIDES]
        rows.append(([escape(view.name), *map(str, counts), f'{rms[index]:.3f}',
                      f'{1e3 * place[2]:.0f}', f'{tilt:.0f}', 'used'], False))
    rows += [([escape(name), '', '', '', '', '', escape(reason)], True)
             for name, reason in geometry.dropped.items()]
    names = [view.name for view in adjustment.views]
    return section('views', 'Views', figure(
        plots.view_plot(names, rms), 'Residual of each view') + table(
            ['view', 'corners left', 'right', 'rms, px', 'distance, mm', 'tilt, degrees',
             'verdict'], rows))


def _parameters(geometry):
    parameters = geometry.adjustment.parameters
    rows = [([escape(name), f'{value:.7g}', f'{std:.2g}'], False) for name, value, std in
            zip(parameters.names, parameters.vector, geometry.covariance.std)]
    hashes = ', '.join(f'{side} {value[:12]}' for side, value
                       in geometry.covariance.hashes.items())
    return section('parameters', 'Parameters', table(
        ['parameter', 'value', 'standard deviation'], rows) + note(
            'px, rad, m. The covariance of all parameters is in stereo_covariance.yaml, tied to '
            f'the camera_infos by a hash of their values ({hashes}). color_stereo_ros '
            f'{__version__}.'))
