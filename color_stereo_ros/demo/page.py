# SPDX-License-Identifier: Apache-2.0
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

from ..core.account import status_shares
from ..core.false_color import false_color
from ..core.results import RangeResult
from ..core.status import Status
from ..evaluation.metrics import Truth, accuracy, false_share
from .plots import error_plot, shaded, surface_plot

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
    """uint8 (H, W', 3), RGB."""
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


INTRODUCTION = '''<p>A projector throws a color pattern, two color cameras see it, and one pair of
images gives depth. Everything below went through real ROS 2 topics: <code>pattern_node</code> and
<code>range_node</code> ran as processes of their own, a recording was played to them, and what
they published was collected and compared with the truth.</p>'''
AGAIN = '''<h2>Do it again</h2>
<p><code>make demo</code> makes this page. By hand, with ROS 2 or in <code>.venv</code>:</p>
<pre><code>{}</code></pre>'''
PAIR_INTRODUCTION = '''<p>A projector throws a color pattern, two color cameras see it, and one
pair of images gives depth. This page shows the pair and what was measured from it. The files
beside it hold the numbers.</p>'''

ROWS = (
    ('method', lambda item, _: item.method),
    ('visible pixels with a range', lambda _, found: f'{100 * found["density"]:.1f} %'),
    ('visible pixels right within 1 %', lambda _, found: f'{100 * found["correct"]:.1f} %'),
    ('depth error, mean', lambda _, found: f'{found["mean_percent"]:.3f} %'),
    ('depth error, median', lambda _, found: f'{found["median_percent"]:.3f} %'),
    ('disparity error, median', lambda _, found: f'{found["median_px"]:.3f} px'),
    ('wrong by more than 1 px', lambda _, found: f'{100 * found["bad_1"]:.2f} %'),
    ('ranges where only one camera sees', lambda _, found: f'{100 * found["false_share"]:.2f} %'),
    ('node start to first range image', lambda item, _: f'{item.seconds:.1f} s'),
)


def make_page(measurements, made, commands):
    """
    Return the page as HTML.

    Parameters
    ----------
    measurements : sequence of Measurement
    made : str
        One sentence on when and where.
    commands : str
        Lines that a user can type.

    """
    return _html(INTRODUCTION, made, summary_table(measurements),
                 '\n'.join(_section(item) for item in measurements),
                 AGAIN.format(escape(commands)))


def make_pair_page(names, left, right, result, range_image):
    """
    Return the page about one pair without truth as HTML.

    Parameters
    ----------
    names : (str, str)
        What the two images are called.
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        The raw images, RGB.
    result : RangeResult
    range_image : numpy.ndarray, uint8, shape (H, W', 3)
        RGB.

    """
    figures = [_figure('', picture, caption) for picture, caption in (
        (left, 'Left camera, raw: what goes in'), (right, 'Right camera, raw'),
        (range_image, RANGE_CAPTION), (depth_preview(result.depth), DEPTH_CAPTION))]
    near, far = surface_limits(result.depth)
    share = 100 * np.isfinite(result.depth).mean()
    return _html(PAIR_INTRODUCTION, ' and '.join(names), '', _grid(
        f'{share:.1f} % of the pixels have a range', result.status,
        [_viewer('pair', result.points(), result.image, near, far), *figures]), '')


def _html(introduction, made, summary, sections, ending):
    """Return a page; all arguments but `made` are HTML."""
    template = files(__package__).joinpath('demo_page.html').read_text(encoding='utf-8')
    return Template(template).substitute(introduction=introduction, made=escape(made),
                                         summary=summary, sections=sections, ending=ending)


def summary_table(measurements):
    """Return the table of figures, one column for each measurement."""
    found = [item.figures for item in measurements]
    head = ''.join(f'<th>{escape(item.name)}</th>' for item in measurements)
    lines = [f'<table><thead><tr><th></th>{head}</tr></thead>']
    for title, cell in ROWS:
        cells = ''.join(f'<td>{escape(_cell(cell, item, figures))}</td>'
                        for item, figures in zip(measurements, found))
        lines.append(f'<tr><td>{title}</td>{cells}</tr>')
    return '\n'.join([*lines, '</table>'])


def one_line(item):
    """Return the most important figures of a measurement as a sentence."""
    titles = ('visible pixels with a range', 'visible pixels right within 1 %',
              'depth error, mean')
    cells = dict(ROWS)
    return ', '.join(f'{title} {_cell(cells[title], item, item.figures)}' for title in titles)


def overview(item):
    """Return the raw left image, the range image and the surface side by side, RGB."""
    near, far = surface_limits(item.result.depth)
    surface = cv2.imdecode(np.frombuffer(surface_plot(item.points, near, far), np.uint8),
                           cv2.IMREAD_COLOR)[..., ::-1]
    pictures = [_of_height(image, OVERVIEW_HEIGHT)
                for image in (item.left, item.range_image, surface)]
    return np.concatenate(pictures, axis=1)


def _of_height(image, height):
    width = round(image.shape[1] * height / image.shape[0])
    return cv2.resize(np.ascontiguousarray(image), (width, height), interpolation=cv2.INTER_AREA)


def _cell(cell, item, figures):
    try:
        return cell(item, figures)
    except TypeError:
        return '-'  # no pixel to take the figure from


def surface_limits(depth):
    """Return the depths between which nearly all of a depth image lies, m."""
    known = depth[np.isfinite(depth)]
    if not known.size:
        return 0.0, 1.0
    low, high = np.percentile(known, (0.5, 99.5))
    return float(low), float(max(high, low * 1.001))


def depth_preview(depth):
    """Return a depth image as gray levels, uint8 (H, W): near bright, unknown black."""
    near, far = surface_limits(depth)
    gray = 255 - 200 * (np.clip(depth, near, far) - near) / (far - near)
    return np.nan_to_num(gray, nan=0.0).astype(np.uint8)


def reasons(status):
    """Return the share of pixels of each status as one line for people."""
    shares = status_shares(status)
    del shares[Status.VALID.label]
    return ', '.join(f'{100 * share:.1f} % {name}' for name, share in
                     sorted(shares.items(), key=lambda item: -item[1]) if share >= 0.001)


RANGE_CAPTION = '<code>range_image</code>: near = purple, far = orange, black = unknown'
DEPTH_CAPTION = '<code>depth/image</code>: near = bright'


def _section(item):
    near, far = surface_limits(item.result.depth)
    limit = max(3 * 10 * item.figures['median_percent'] * float(np.nanmedian(item.truth.depth))
                if item.figures['median_percent'] else 1.0, 0.2)
    figures = [_figure(*each) for each in (
        ('', item.left, 'Left camera, raw: what goes in'),
        ('', item.right, 'Right camera, raw'),
        ('', item.pattern, 'What <code>pattern_node</code> tells the projector to show'),
        ('', item.range_image, RANGE_CAPTION),
        ('', depth_preview(item.result.depth), DEPTH_CAPTION),
        ('plot', error_plot(item.error, limit), 'Against the truth, where both cameras see'),
        ('plot', surface_plot(item.points, near, far), 'The surface (fig. 3.2 of the paper)'))]
    viewer = _viewer(item.name, item.points, item.result.image, near, far)
    return _grid(item.name, item.result.status, [*figures[:3], viewer, *figures[3:]])


def _grid(title, status, figures):
    """Return a section: a title, why pixels have no range, and figures."""
    return (f'<h2>{escape(title)}</h2><p class="soft">Pixels without a range: '
            f'{reasons(status)}.</p>\n<div class="grid">' + '\n'.join(figures) + '</div>')


def _figure(kind, picture, caption):
    """Return a picture, PNG bytes or an image, with its caption as HTML."""
    png = picture if isinstance(picture, bytes) else _encoded(picture)
    return (f'<figure class="{kind}"><img alt="{_plain(caption)}" src="data:image/png;base64,'
            f'{b64encode(png).decode()}"><figcaption>{caption}</figcaption></figure>')


def _plain(caption):
    """Return a caption without its tags, for screen readers."""
    return re.sub('<[^>]*>', '', caption)


def _encoded(image):
    """Return an image as PNG bytes, made smaller if it is wider than the page shows it."""
    height, width = image.shape[:2]
    if width > PREVIEW_WIDTH:
        size = (PREVIEW_WIDTH, round(height * PREVIEW_WIDTH / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode('.png', image[..., ::-1] if image.ndim == 3 else image)[1].tobytes()


def _viewer(name, points, image, near, far):
    """Return a canvas with the points (H, W, 3), to be turned with the mouse."""
    height, width = points.shape[:2]
    every = max(VIEWER_STEP, ceil(sqrt(height * width / VIEWER_PIXELS)))
    step = (slice(None, None, every), slice(None, None, every))
    points = points[step]
    known = np.isfinite(points).all(axis=2)
    xyz = points[known]
    center = np.median(xyz, axis=0) if xyz.size else np.zeros(3)
    radius = np.percentile(np.abs(xyz - center), 99.9) if xyz.size else 1.0
    scaled = np.clip((xyz - center) / radius, -1, 1) * 32767
    colors = shaded(points, false_color(points[..., 2], near, far, scale_bar=False))
    data = {'xyz': scaled.astype('<i2'), 'depth': colors[known],
            'camera': image[step][known]}
    text = json.dumps({name: b64encode(np.ascontiguousarray(values).tobytes()).decode()
                       for name, values in data.items()})
    return ('<figure><canvas width="520" height="520" role="img" '
            'aria-label="The measured points in three dimensions" '
            f'data-cloud="cloud-{escape(name)}">'
            f'</canvas><figcaption><code>points</code>, {len(xyz)} of them: drag to turn, wheel '
            'to zoom. <button type="button">Other colors</button></figcaption>'
            f'<script type="application/json" id="cloud-{escape(name)}">{text}</script>'
            '</figure>')
