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
"""The report of a color calibration as a page with pictures."""

from html import escape

from matplotlib.figure import Figure
import numpy as np

from .color import CHANNELS
from ..core.color_calibration import linear
from ..pages.html import CSS, figure, note, section, table
from ..pages.plots import as_image, as_svg, styled

SIDES = 'left', 'right'
INKS = '#d1495b', '#0b7a5b', '#2f6db5'
"""Of red, green and blue."""
PERCENT = 100


def color_page(findings, summary, title):
    """
    Return a color calibration as a page, HTML that needs no other file.

    Parameters
    ----------
    findings : ColorFindings
        What the calibration of the colors has found.
    summary : str
        The figures as text.
    title : str
        What was measured, for people.

    """
    calibration = findings.calibration
    body = [
        section('summary', 'Figures', f'<pre>{escape(summary)}</pre>'),
        section('gain', 'What it gains', figure(gain_plot(findings.before, findings.after),
                'difference of the mean colors of both cameras, before and after') + note(
            'Shares of the brightness, root mean square over the channels. What is left belongs '
            'to the core, which evens out each pair by itself.')),
        section('response', 'Response', figure(
            response_plot(calibration), 'linear light over the level of the image') + note(
            'A straight line is a linear camera. The dashed line is one.')),
        section('field', 'Gain over the image', ''.join(figure(
            field_plot(getattr(calibration, side)), f'{side} camera: red, green, blue, % of the '
            'mean of the channels') for side in SIDES) + note(
            'Only differences of the channels: brightness over the image is mostly the light of '
            'the projector on the card.')),
        section('crosstalk', 'Crosstalk', ''.join(
            crosstalk_table(side, getattr(calibration, side).crosstalk) for side in SIDES)
            + note('Share of each light in each channel. Without crosstalk there is 100 % on '
                   'the diagonal.'))]
    return ('<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Color calibration'
            f'</title><style>{CSS}</style></head><body><header><div><h1>Color calibration</h1>'
            f'<p>{escape(title)}</p></div></header><main>{"".join(body)}</main></body></html>\n')


def crosstalk_table(side, crosstalk):
    """Return the crosstalk of a camera, float64 (3, 3), as a table."""
    rows = [((channel, *(f'{PERCENT * share:.1f} %' for share in shares)), False)
            for channel, shares in zip(CHANNELS, crosstalk)]
    return table((f'{side}: channel', *(f'{name} light' for name in CHANNELS)), rows)


@styled
def gain_plot(before, after):
    """Return the differences of the cameras before and after as bars, SVG."""
    drawing = Figure((6.4, 3.0))
    axes, places = drawing.subplots(), np.arange(len(before))
    for offset, values, label, ink in ((-0.2, before, 'before', '#c9ced6'),
                                       (0.2, after, 'after', '#0b7a5b')):
        axes.bar(places + offset, [PERCENT * values[name] for name in before], 0.4, label=label,
                 color=ink)
    axes.set_xticks(places, list(before))
    axes.set_ylabel('difference, %')
    axes.legend()
    return as_svg(drawing)


@styled
def response_plot(calibration):
    """Return the response curves of both cameras, SVG."""
    drawing = Figure((6.4, 3.6))
    axes, level = drawing.subplots(), np.linspace(0, 1, 101)
    axes.plot(level, level, '--', color='#c9ced6')
    for side, ink in zip(SIDES, ('#2f6db5', '#d98324')):
        camera = getattr(calibration, side)
        axes.plot(level, linear(level, camera.gamma, camera.offset), color=ink,
                  label=f'{side}: gamma {camera.gamma:.2f}, offset {camera.offset:.3f}')
    axes.set_xlabel('level above dark, share of full scale')
    axes.set_ylabel('light, share of full scale')
    axes.legend()
    return as_svg(drawing)


@styled
def field_plot(camera):
    """Return the gain fields of the channels of a CameraColor, a picture."""
    drawing = Figure((8.4, 2.6))
    values = PERCENT * (camera.gain_field - 1)
    limit = max(float(np.abs(values).max()), 0.1)
    all_axes = drawing.subplots(1, 3)
    for axes, name, ink, field in zip(all_axes, CHANNELS, INKS, np.moveaxis(values, -1, 0)):
        shown = axes.imshow(field, cmap='RdBu_r', vmin=-limit, vmax=limit,
                            interpolation='bilinear', aspect=camera.size[1] / camera.size[0]
                            * field.shape[1] / field.shape[0])
        axes.set_title(name, color=ink)
        axes.set_axis_off()
    drawing.colorbar(shown, ax=all_axes.tolist(), shrink=0.9, label='%')
    return as_image(drawing)
