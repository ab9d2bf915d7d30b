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
"""The report of a check as a page with pictures."""

from html import escape

from matplotlib.figure import Figure
import numpy as np

from .check_text import TERMS
from .checking import FAIR, GOOD, NOTE, POOR
from ..core.false_color import status_picture
from ..core.legends import with_status_legend
from ..pages.html import CSS, figure, note, panel, section, table
from ..pages.plots import as_image, photograph, picture, styled

KEYS = {GOOD: '#0b7a5b', FAIR: '#d98324', POOR: '#d1495b', NOTE: '#c9ced6'}


def check_page(found, left, right, result, title):
    """
    Return a Check as a page, HTML that needs no other file.

    Parameters
    ----------
    found : Check
        What the check has found.
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        The last raw pair, RGB.
    result : RangeResult
        Of this pair.
    title : str
        What was checked, for people.

    """
    rows = [((f'<span class="key" style="background:{KEYS[finding.level]}"></span>'
              f'{escape(finding.name)}', finding.level, escape(finding.text),
              escape(finding.advice) if finding.level in (FAIR, POOR) else ''), False)
            for finding in found.findings]
    body = [section('verdict', 'Verdict', f'<p>{escape(found.verdict())}</p>'
                    + table(('', 'level', 'measured', 'what to change'), rows) + note(TERMS))]
    if found.residual_mm is not None:
        body.append(section('plane', 'Distance from the best plane', figure(
            map_plot(found.residual_mm, 'mm, + = towards the camera', True),
            'measured minus plane over the image') + note(
                'Even noise is what the light allows. A bowl, a saddle or steps are a wrong '
                'calibration or a board that is not flat.')))
    if found.noise_mm is not None:
        body.append(section('noise', 'Noise from pair to pair', figure(
            map_plot(found.noise_mm, 'standard deviation, mm', False),
            'standard deviation of the depth over the image')))
    body.append(section('views', 'What the cameras see', '<div class="gallery">' + ''.join((
        panel('left camera', photograph(left)), panel('right camera', photograph(right)),
        panel('why a pixel has no range',
              picture(with_status_legend(status_picture(result.status)))))) + '</div>'))
    return (f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Check of a sensor'
            f'</title><style>{CSS}</style></head><body><header><div><h1>Check of a sensor</h1>'
            f'<p>{escape(title)}</p></div></header><main>{"".join(body)}</main></body></html>\n')


@styled
def map_plot(image, label, signed):
    """Return a picture of values over the image, with a bar of colors."""
    known = np.abs(image[np.isfinite(image)])
    limit = max(float(np.percentile(known, 99)) if known.size else 1.0, 1e-6)
    drawing = Figure((7.2, 4.6))
    axes = drawing.subplots()
    shown = axes.imshow(image, cmap='RdBu_r' if signed else 'viridis',
                        vmin=-limit if signed else 0, vmax=limit, interpolation='nearest')
    axes.set_axis_off()
    drawing.colorbar(shown, ax=axes, shrink=0.9, label=label)
    return as_image(drawing)
