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
"""One style for all plots, and what makes self-contained pieces of HTML of plots and pictures."""

import base64
import io

import cv2
import matplotlib
from matplotlib.ticker import FuncFormatter

STYLE = {'font.size': 9.5, 'axes.spines.top': False, 'axes.spines.right': False,
         'axes.grid': True, 'grid.color': '#e6e8ec', 'grid.linewidth': 0.8,
         'axes.edgecolor': '#9aa1ad', 'axes.labelcolor': '#3b4252', 'axes.axisbelow': True,
         'xtick.color': '#5b6472', 'ytick.color': '#5b6472', 'svg.fonttype': 'none',
         'svg.hashsalt': 'color_stereo', 'font.family': 'sans-serif', 'legend.frameon': False,
         'axes.titlesize': 10.5, 'axes.titleweight': 'bold', 'axes.titlelocation': 'left'}


def as_svg(figure):
    """Return a matplotlib figure as inline SVG."""
    stream = io.StringIO()
    figure.savefig(stream, format='svg', bbox_inches='tight', metadata={'Date': None})
    text = stream.getvalue()
    return text[text.index('<svg'):]


def as_image(figure):
    """Return a matplotlib figure as an embedded PNG; for plots with very many elements."""
    stream = io.BytesIO()
    figure.savefig(stream, format='png', dpi=130, bbox_inches='tight')
    return _embedded(stream.getvalue())


def picture(array):
    """Return an image, uint8 (H, W, 3) RGB, as an embedded PNG."""
    return _embedded(cv2.imencode('.png', cv2.cvtColor(array, cv2.COLOR_RGB2BGR))[1].tobytes())


def photograph(array):
    """Return an image, uint8 (H, W, 3) RGB, as an embedded JPEG: smaller, for colored noise."""
    encoded = cv2.imencode('.jpg', cv2.cvtColor(array, cv2.COLOR_RGB2BGR),
                           [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
    return _embedded(encoded.tobytes(), 'jpeg')


def _embedded(data, kind='png'):
    return f'<img alt="" src="data:image/{kind};base64,{base64.b64encode(data).decode()}">'


def styled(function):
    """Decorate a plot: it uses the style of the report, the caller keeps its own."""
    def plot(*arguments, **options):
        with matplotlib.rc_context(STYLE):
            return function(*arguments, **options)
    plot.__doc__ = function.__doc__
    plot.__name__ = function.__name__
    return plot


def plain_numbers(axis):
    """Label a logarithmic axis with 0.01, 0.1, 1, 10 instead of powers."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axis.set_minor_formatter(FuncFormatter(
        lambda value, _: f'{value:g}' if f'{value:e}'[0] in '25' else ''))
