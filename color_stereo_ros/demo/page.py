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
"""
The pages of `color_stereo demo` and `color_stereo process`.

Pictures and points are embedded, so that the file can be sent by mail and needs no network.

"""

from base64 import b64encode
from dataclasses import dataclass
from html import escape
from importlib.resources import files
import json
from math import ceil, sqrt
import re
from string import Template

import cv2
import numpy as np

from .plots import error_plot, shaded, surface_plot
from ..core.account import status_shares
from ..core.false_color import (
    automatic_limits, false_color, STATUS_COLORS, status_picture, views_picture)
from ..core.legends import with_scale_bar, with_views_legend
from ..core.results import RangeResult
from ..core.settings import Settings
from ..core.status import Status
from ..core.surface.third.fusion import PROJECTOR
from ..evaluation.metrics import accuracy, false_share, Truth

DEFAULT_METHOD = Settings().matching.method
VIEWER_STEP = 2   # px: every second pixel of every second row goes into the 3-D viewer
VIEWER_PIXELS = 150_000  # of a larger image fewer go, so that the page stays small
PREVIEW_WIDTH = 560
OVERVIEW_HEIGHT = 320


@dataclass(frozen=True, eq=False)
class Measurement:
    """The outputs of `range_node` for one sample, and the truth."""

    name: str
    method: str
    left: np.ndarray
    """uint8 (H, W, 3), the raw left image, RGB."""
    right: np.ndarray
    """uint8 (H, W, 3), the raw right image, RGB."""
    pattern: np.ndarray
    """uint8 (H, W, 3), what `pattern_node` published, RGB."""
    range_image: np.ndarray
    """uint8 (H, W', 3), the published one with a scale bar, RGB."""
    status_picture: np.ndarray
    """uint8 (H, W', 3), as published, with its legend, RGB."""
    result: RangeResult
    points: np.ndarray
    """float32 (H, W, 3), m, as published in `points`."""
    truth: Truth
    seconds: float
    """From the start of the node to its first range image."""

    @property
    def figures(self):
        """Return the figures of color_stereo_ros.evaluation.metrics."""
        return {**accuracy(self.result, self.truth),
                'false_share': false_share(self.result, self.truth)}

    @property
    def error(self):
        """Return measured minus true depth in mm, NaN where there is nothing to compare."""
        error = 1e3 * (self.result.depth - self.truth.depth)
        return np.where(self.truth.visible, error, np.nan)


INTRODUCTION = """<p>A projector throws a color pattern, two color cameras see it, and one pair of
images gives depth. Everything below went through real ROS 2 topics: <code>pattern_node</code> and
<code>range_node</code> ran as processes of their own, a recording was played to them, and what
they published was collected and compared with the truth.</p>
<p>A pixel is <em>visible</em> if both cameras see its place of the scene and the projector lights
it. Only there can a range be right.</p>"""
AGAIN = """<h2>Do it again</h2>
<p><code>make demo</code> makes this page. By hand, with ROS 2 or in <code>.venv</code>:</p>
<pre><code>{}</code></pre>"""
PAIR_INTRODUCTION = """<p>A projector throws a color pattern, two color cameras see it, and one
pair of images gives depth. This page shows the pair and what was measured from it. The files
beside it hold the numbers.</p>"""

ROWS = (
    ('method', 'the default is surface; paper is the method of Knoll and Sasse',
     lambda item, _: item.method),
    ('visible pixels with a range', 'visible: both cameras see this place of the scene, and the '
     'projector lights it',
     lambda _, found: f'{100 * found["density"]:.1f} %'),
    ('visible pixels right within 1 %', 'their depth is off by less than 1 % of the true depth',
     lambda _, found: f'{100 * found["correct"]:.1f} %'),
    ('depth error, mean', 'of the visible pixels with a range, in % of the true depth',
     lambda _, found: f'{found["mean_percent"]:.3f} %'),
    ('depth error, median', 'half of these pixels have a smaller error',
     lambda _, found: f'{found["median_percent"]:.3f} %'),
    ('disparity error, median', 'disparity: column of a point in the left image minus its column '
     'in the right one; the depth follows from it',
     lambda _, found: f'{found["median_px"]:.3f} px'),
    ('wrong by more than 1 px', 'share of the visible pixels with a range whose disparity is '
     'off by more than 1 px', lambda _, found: f'{100 * found["bad_1"]:.2f} %'),
    ('ranges where only one camera sees', 'share of all ranges; nothing can be measured there, '
     'so they are false', lambda _, found: f'{100 * found["false_share"]:.2f} %'),
    ('node start to first range image', 'with the time in which kernels are compiled, if they '
     'were not', lambda item, _: f'{item.seconds:.1f} s'),
)
"""Title, explanation, and what gives the cell of a measurement."""


def make_page(measurements, made, commands):
    """
    Return the page as HTML.

    Parameters
    ----------
    measurements : sequence of Measurement
        Of the samples.
    made : str
        One sentence on when and where.
    commands : str
        Lines that a user can type.

    """
    limits = page_limits(measurements)
    return _html(INTRODUCTION, made, summary_table(measurements), _told(limits),
                 '\n'.join(_section(item, limits) for item in measurements),
                 AGAIN.format(escape(commands)))


def make_pair_page(names, left, right, result, limits):
    """
    Return the page about one pair without truth as HTML.

    Parameters
    ----------
    names : (str, str)
        What the two images are called.
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        The raw images, RGB.
    result : RangeResult
        Of the pair.
    limits : (float, float)
        Depth of the first and of the last color in meters.

    """
    picture = with_scale_bar(false_color(result.depth, *limits), *limits)
    figures = [_figure('', image, caption) for image, caption in (
        (left, 'Left camera, raw: what goes in'), (right, 'Right camera, raw'),
        (_png(picture), f'Depth: {_told(limits)}'),
        (_png(status_picture(result.status)), 'Why a pixel has no range'),
        (_png(with_views_legend(views_picture(result.views))), _about_views(result)))]
    share = 100 * np.isfinite(result.depth).mean()
    return _html(PAIR_INTRODUCTION, ' and '.join(names), '', _told(limits), _grid(
        f'{share:.1f} % of the pixels have a range', '', result.status,
        [_viewer('pair', result.points(), result.image, limits), *figures]), '')


def _about_views(result):
    """Return the caption of the picture of the views."""
    text = 'Who saw a pixel beside the left camera'
    return text if result.projector is None else f'{text}: {result.projector.sentence()}'


def _html(introduction, made, summary, colors, sections, ending):
    """Return a page; all arguments but `made` and `colors` are HTML."""
    template = files(__package__).joinpath('demo_page.html').read_text(encoding='utf-8')
    return Template(template).substitute(
        introduction=introduction, made=escape(made), summary=summary, colors=escape(colors),
        sections=sections, ending=ending)


def summary_table(measurements):
    """Return the table of figures, one column for each measurement."""
    found = [item.figures for item in measurements]
    head = ''.join(f'<th>{escape(item.name)}</th>' for item in measurements)
    lines = [f'<table><thead><tr><th></th>{head}</tr></thead>']
    for title, explanation, cell in ROWS:
        cells = ''.join(f'<td>{escape(_cell(cell, item, figures))}</td>'
                        for item, figures in zip(measurements, found))
        lines.append(f'<tr><td>{title}</td>{cells}</tr>\n<tr class="why">'
                     f'<td colspan="{1 + len(found)}">{explanation}</td></tr>')
    return '\n'.join([*lines, '</table>'])


def one_line(item):
    """Return the most important figures of a measurement as a sentence."""
    titles = ('visible pixels with a range', 'visible pixels right within 1 %',
              'depth error, mean')
    cells = {title: cell for title, _, cell in ROWS}
    return ', '.join(f'{title} {_cell(cells[title], item, item.figures)}' for title in titles)


def overview(item, limits):
    """Return the raw left image, the range image and the surface side by side, RGB."""
    surface = cv2.imdecode(np.frombuffer(surface_plot(item.points, *limits), np.uint8),
                           cv2.IMREAD_COLOR)[..., ::-1]
    pictures = [_of_height(item.left, OVERVIEW_HEIGHT),
                with_scale_bar(_of_height(false_color(item.result.depth, *limits),
                                          OVERVIEW_HEIGHT), *limits),
                _of_height(surface, OVERVIEW_HEIGHT)]
    return np.concatenate(pictures, axis=1)


def _of_height(image, height):
    width = round(image.shape[1] * height / image.shape[0])
    return cv2.resize(np.ascontiguousarray(image), (width, height), interpolation=cv2.INTER_AREA)


def _cell(cell, item, figures):
    try:
        return cell(item, figures)
    except TypeError:
        return '-'  # no pixel to take the figure from


def page_limits(measurements):
    """Return the depths of the page's first and last color, m: nearly all depths are between."""
    found = [limits for limits in (automatic_limits(item.result.depth) for item in measurements)
             if limits is not None]
    if not found:
        return 0.0, 1.0
    near, far = zip(*found)
    return min(near), max(far)


def depth_preview(depth):
    """Return a depth image in false colors between its own limits, with a scale bar, RGB."""
    limits = automatic_limits(depth) or (0.0, 1.0)
    return with_scale_bar(false_color(depth, *limits), *limits)


def status_legend(status):
    """Return the color, share and meaning of each status that occurs, as HTML."""
    shares = status_shares(status)
    return '<ul class="key">' + ''.join(
        f'<li><span style="background: rgb{STATUS_COLORS[code]}"></span>'
        f'{100 * shares[code.label]:.1f} % {code.label}: {escape(code.meaning)}</li>'
        for code in sorted(Status, key=lambda code: -shares[code.label])
        if shares[code.label] >= 0.001) + '</ul>'


def _told(limits):
    """Return the meaning of the colors of depth as text."""
    return 'near = yellow ({:.3f} m), far = violet ({:.3f} m), unknown = black'.format(*limits)


def _section(item, limits):
    picture = with_scale_bar(false_color(item.result.depth, *limits), *limits)
    limit = max(3 * 10 * item.figures['median_percent'] * float(np.nanmedian(item.truth.depth))
                if item.figures['median_percent'] else 1.0, 0.2)
    views = [('', _png(with_views_legend(views_picture(item.result.views))),
              'Who saw a pixel beside the left camera (<code>views/image</code>)')]
    figures = [_figure(*each) for each in (
        ('', item.left, 'Left camera, raw: what goes in'),
        ('', item.right, 'Right camera, raw'),
        ('', item.pattern, 'What <code>pattern_node</code> tells the projector to show'),
        ('', _png(picture), f'Depth (<code>depth/image</code>, <code>range_image</code>): '
                            f'{_told(limits)}'),
        ('', _png(status_picture(item.result.status)), 'Why a pixel has no range '
         '(<code>status/image</code>, <code>status_picture</code>)'),
        *(views if projected(item.result) else ()),
        ('plot', error_plot(item.error, limit), 'Measured minus true depth of the visible pixels '
         'with a range. Dark: nothing to compare'),
        ('plot', surface_plot(item.points, *limits), 'The surface in the colors of the depth '
                                                     '(fig. 3.2 of the paper)'))]
    viewer = _viewer(item.name, item.points, item.result.image, limits)
    method = escape(item.method) + (', the default' if item.method == DEFAULT_METHOD else '')
    return _grid(item.name, f'Method: {method}.', item.result.status,
                 [*figures[:3], viewer, *figures[3:]])


def projected(result):
    """Return whether the projector was a view of some pixel."""
    return result.views is not None and bool((result.views & PROJECTOR).any())


def _grid(title, text, status, figures):
    """Return a section: a title, a line, figures, and the legend of the status."""
    line = f'<p class="soft">{text}</p>\n' if text else ''
    return (f'<h2>{escape(title)}</h2>{line}<div class="grid">' + '\n'.join(figures)
            + '</div>\n<p>The colors of the status, and how many of all pixels have it:</p>'
            + status_legend(status))


def _figure(kind, picture, caption):
    """Return a picture, PNG bytes or an image, with its caption as HTML."""
    png = picture if isinstance(picture, bytes) else _encoded(picture)
    return (f'<figure class="{kind}"><img alt="{_plain(caption)}" src="data:image/png;base64,'
            f'{b64encode(png).decode()}"><figcaption>{caption}</figcaption></figure>')


def _plain(caption):
    """Return a caption without its tags, for screen readers."""
    return re.sub('<[^>]*>', '', caption)


def _encoded(image):
    """Return a photograph as PNG bytes, made smaller if it is wider than the page shows it."""
    height, width = image.shape[:2]
    if width > PREVIEW_WIDTH:
        size = (PREVIEW_WIDTH, round(height * PREVIEW_WIDTH / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return _png(image)


def _png(image):
    """Return an RGB image as PNG bytes."""
    return cv2.imencode('.png', image[..., ::-1])[1].tobytes()


def _viewer(name, points, image, limits):
    """Return a canvas with the points (H, W, 3), to be turned with a mouse or a finger."""
    height, width = points.shape[:2]
    every = max(VIEWER_STEP, ceil(sqrt(height * width / VIEWER_PIXELS)))
    step = (slice(None, None, every), slice(None, None, every))
    points = points[step]
    known = np.isfinite(points).all(axis=2)
    xyz = points[known]
    center = np.median(xyz, axis=0) if xyz.size else np.zeros(3)
    radius = np.percentile(np.abs(xyz - center), 99.9) if xyz.size else 1.0
    scaled = np.clip((xyz - center) / radius, -1, 1) * 32767
    colors = shaded(points, false_color(points[..., 2], *limits))
    data = {'xyz': scaled.astype('<i2'), 'depth': colors[known],
            'camera': image[step][known]}
    text = json.dumps({name: b64encode(np.ascontiguousarray(values).tobytes()).decode()
                       for name, values in data.items()})
    return ('<figure><canvas width="520" height="520" role="img" '
            'aria-label="The measured points in three dimensions" '
            f'data-cloud="cloud-{escape(name)}">'
            f'</canvas><figcaption><code>points</code>, {len(xyz)} of them in the colors of '
            'the depth: drag to turn, wheel to zoom. '
            '<button type="button">Other colors</button></figcaption>'
            f'<script type="application/json" id="cloud-{escape(name)}">{text}</script>'
            '</figure>')
