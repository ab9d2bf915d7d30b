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
The pictures of docs/surface_method.md and docs/third_view.md: what each step writes for one pair.

`python -m color_stereo_ros.evaluation.method_pictures docs/steps` needs the extras [sim,tools].

"""

import argparse
from copy import deepcopy
from pathlib import Path

import cv2
import matplotlib
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
import numpy as np

from .renders import default_pattern, Renders
from ..core import ColorStereo, PatternSettings, Settings, Status
from ..core.compiled import Arena
from ..core.surface.choosing import UnknownPattern
from ..core.surface.planes import PlaneField
from ..core.surface.trust_kernels import EVIDENCE
from ..pages.plots import STYLE

SCENE = 'solids'
REPEATING = PatternSettings(type='sine', cycles=16)
PANEL = 2.9  # inches, width of one picture
RESOLUTION = 78  # pixels per inch
SHADES = 16  # per channel: keeps the files below 150 kB
VALUES, ERRORS = 'viridis', 'magma'  # perceptually uniform
CHANGES = 'coolwarm'
REJECTED = ListedColormap(['#e6e8ec', '#c8553d'])
TILES = ListedColormap(['#440154', '#21918c', '#fde725'])
REASONS = ListedColormap(['#f2f2f2', '#3b4252', '#20262f', '#ffd23f', '#7a5ab0', '#3d6cb4',
                          '#c8553d', '#8fb339', '#e58fb1'])
VIEWS = ListedColormap(['#000000', '#56b4e9', '#e69f00', '#d7d7d7'])
ROOTS = ('root of cost', 'root of misfit', 'root of std, px^0.5', 'root of apart, px^0.5',
         'root of imbalance')


class Recorder:
    """A stopwatch that keeps a copy of what each step has written."""

    def __init__(self):
        """Keep nothing yet."""
        self.written = {}

    def lap(self, stage, written=None):
        """Keep a copy of what a stage wrote; the next one may overwrite it."""
        self.written[stage] = deepcopy(written)


def recorded(scene):
    """
    Measure a pair step by step.

    Parameters
    ----------
    scene : color_stereo_ros.evaluation.datasets.Scene
        A pair with its truth.

    Returns
    -------
    steps : dict
        Name of a stage to what it wrote, as `SurfaceMethod.measure` tells its clock; and 'seeds',
        the disparities of the nodes before the first fit, px.
    method : SurfaceMethod
        With the evidence of this pair.

    """
    stereo = ColorStereo(scene.calibration, Settings().updated(scene.settings))
    method, recorder = stereo._method, Recorder()
    if isinstance(method, UnknownPattern):
        method = method.suiting(scene.left, scene.right, None)
    method.measure(scene.left, scene.right, recorder)
    field = PlaneField(method.planes.grid, 0.0, True, Arena())
    seeds = field.seed(recorder.written['coarse']).d[field.grid.inner]
    return {**recorder.written, 'seeds': seeds}, method


def draw(panels):
    """
    Draw panels side by side, each with its own scale.

    Parameters
    ----------
    panels : list of (str, numpy.ndarray, str, dict)
        Title, array (H, W), label of the scale with its unit ('' = none), options of imshow.

    Returns
    -------
    figure : matplotlib.figure.Figure

    """
    figure = Figure(figsize=(PANEL * len(panels), PANEL * 1.02), layout='constrained')
    places = figure.subplots(1, len(panels), squeeze=False)[0]
    for place, (title, values, label, options) in zip(places, panels):
        options = dict(options)
        place.set_title(title, fontsize=9)
        ticks = options.pop('ticks', None)
        shown = place.imshow(values, **{'cmap': VALUES, **options})
        place.set_axis_off()
        if label:
            bar = figure.colorbar(shown, ax=place, orientation='horizontal', fraction=.06,
                                  pad=.02, ticks=ticks)
            bar.set_label(label, fontsize=8)
            bar.ax.tick_params(labelsize=7)
    return figure


def codes_panel(title, codes, label, colors):
    """Return a panel of whole numbers from 0 on, each with its color."""
    limits = np.arange(colors.N + 1) - 0.5
    return title, codes, label, {'cmap': colors, 'norm': BoundaryNorm(limits, colors.N),
                                 'ticks': range(colors.N), 'interpolation': 'nearest'}


def reasons_panel(title, codes):
    """Return the panel of status codes."""
    return codes_panel(title, codes, 'status code', REASONS)


def limits_of(values, low=2, high=98):
    """Return the options of a scale from one percentile to another."""
    known = values[np.isfinite(values)]
    least, most = np.percentile(known, (low, high)) if known.size else (0, 1)
    return {'vmin': least, 'vmax': most}


def views_picture(steps, inner):
    """Return what nodes of the left view see: brightness, chromaticity, standard deviation."""
    view = steps['colors'].left
    lit = view.variance[inner] < 1
    std = np.where(lit, np.sqrt(view.variance[inner]), np.nan)
    return draw([
        ('brightness s', view.s[inner], 'DN', {'cmap': 'gray', **limits_of(view.s[inner])}),
        ('chromaticity u', view.u[inner], 'u', {'vmin': -1, 'vmax': 2}),
        ('chromaticity v', view.v[inner], 'v', {'vmin': -1.7, 'vmax': 1.7}),
        ('standard deviation', std, 'of u and of v', {'cmap': ERRORS, **limits_of(std)})])


def coarse_picture(steps):
    """Return the coarse disparities and the planes that they seed."""
    seeds = steps['coarse']
    unit = 2 * seeds.factor
    coarse = seeds.disparity * unit
    rejected = np.isnan(coarse).astype(np.uint8)
    scale = limits_of(steps['expand'].disparity)
    planes = steps['seeds']
    return draw([
        (f'one node per {unit} x {unit} px', coarse, 'coarse disparity, px', scale),
        ('planes of the half grid', planes, 'disparity of the seeds, px', scale),
        codes_panel('left-right consistency', rejected, '1 = rejected', REJECTED)])


def misfit_picture(steps, inner):
    """
    Return the misfit of the seeds and after the rounds.

    The last one is what the trust reads: in smooth tiles that of the planes before the last fit.

    """
    options = {'cmap': ERRORS, 'vmin': 0, 'vmax': 12}
    label = 'misfit (noise: 2 on average)'
    scale = steps['compare 1'].scale  # the first round assumes 1
    return draw([
        ('seeds', steps['fit 1'].misfit[inner] / scale, label, options),
        ('after the first round', steps['propagate 1'].misfit[inner] / scale, label, options),
        ('after the second round', steps['polish 2'].misfit[inner], label, options)])


def planes_picture(steps, inner, method):
    """Return the disparities after each round, and which tiles are smooth."""
    first, last = steps['fit 1'], steps['polish 2']
    scale = limits_of(steps['expand'].disparity)
    tuning = method.tuning.planes
    smooth = np.zeros(last.d.shape, np.uint8)
    for radius in (tuning.radius, tuning.wide_radius):
        for y, x in last.tiles[last.smooth(last.tiles, steps['colors'], radius,
                                           tuning.smooth_steps[-1])]:
            smooth[y:y + method.tuning.grid.tile_rows, x:x + method.tuning.grid.tile_columns] += 1
    nodes = 2 * np.array([tuning.radius, tuning.wide_radius]) + 1
    return draw([
        ('disparity after the first fit', first.d[inner], 'px', scale),
        ('after the second fit', last.d[inner], 'px', scale),
        ('slope a after the second fit', last.a[inner], 'px per node',
         {'vmin': -1, 'vmax': 1, 'ticks': (-1, -.5, 0, .5, 1)}),
        codes_panel('windows of the tiles', smooth[inner],
                    '0 = gate; no gate: 1 = {0} x {0}, 2 = {1} x {1}'.format(*nodes), TILES)])


def pair_picture(steps, inner):
    """Return the colors of matched nodes before and after the map, and the misfit they leave."""
    views, planes, pair = (steps[name] for name in ('colors', 'propagate 1', 'compare 1'))
    left, right = views.left, views.right
    rows, columns = np.nonzero((planes.misfit[inner] < 4) & np.isfinite(planes.d[inner]))
    rows, columns = rows[::97], columns[::97]
    at = rows + inner[0].start, columns + inner[1].start
    place = np.clip(np.rint(2 * columns - planes.d[at]).astype(int), 0, right.u.shape[1] - 1)
    seen = np.stack([right.u[at[0], place], right.v[at[0], place],
                     np.ones(len(rows), np.float32)])
    mapped = pair.matrix @ seen
    figure = Figure(figsize=(3 * PANEL, PANEL), layout='constrained')
    for axes, name, own, before, after in zip(
            figure.subplots(1, 3), 'uv', (left.u[at], left.v[at]), seen, mapped):
        axes.plot(before, own - before, '.', ms=2.5, color='#c8553d', label='as seen')
        axes.plot(before, own - after, '.', ms=2.5, color='#0b7a5b', label='after the matrix')
        axes.set(xlabel=f'{name} of the right view', ylabel=f'left {name} - right {name}',
                 ylim=(-.6, .6))
        axes.legend(fontsize=7, markerscale=3)
    axes = figure.axes[2]
    known = planes.misfit[inner] / pair.scale
    axes.hist(known[known < 12], bins=60, color='#0b7a5b', density=True, label='measured')
    values = np.linspace(0, 12, 100)
    axes.plot(values, 0.5 * np.exp(-0.5 * values), color='#222222', label='chi-square, 2 degrees')
    axes.set(xlabel=f'misfit / scale, scale = {pair.scale:.2f}', ylabel='density')
    axes.legend(fontsize=7)
    return figure


def neighbors_picture(steps, inner):
    """Return which nodes took the plane of a neighbor, and at what cost."""
    before, after = steps['fit 1'].d[inner], steps['propagate 1'].d[inner]
    change = np.where(before == after, np.nan, after - before)
    cost, scale = steps['propagate 1'].cost[inner], limits_of(steps['expand'].disparity)
    return draw([
        ('before', before, 'disparity, px', scale),
        ('after', after, 'disparity, px', scale),
        ('change (white = none)', change, 'px', {'cmap': CHANGES, 'vmin': -4, 'vmax': 4}),
        ('cost of the best shifted window', cost, 'misfit', {'cmap': ERRORS, 'vmin': 0,
                                                             'vmax': 12})])


def evidence_picture(method):
    """Return the five kinds of evidence."""
    return draw([(name, values, label, {'cmap': ERRORS, **limits_of(values, 2, 95)})
                 for name, values, label in zip(EVIDENCE, method.trust.evidence, ROOTS)])


def trust_picture(steps, inner, method):
    """Return log-odds, standard deviation and reasons of the nodes."""
    verdict = steps['judge']
    doubted = verdict.log_odds[inner] < method.trust.least_odds
    return draw([
        ('log-odds', verdict.log_odds[inner], 'ln(p / (1 - p))', {'vmin': -6, 'vmax': 14}),
        ('standard deviation', verdict.std[inner], 'px', {'cmap': ERRORS, 'vmin': 0,
                                                          'vmax': 0.3}),
        reasons_panel('reason of nodes without range',
                      np.where(doubted, verdict.reason[inner], Status.VALID))])


def repetitions_picture(steps, inner):
    """Return the share of clear nodes, the bounded log-odds and the pixels that remain."""
    verdict, found = steps['judge'], steps['expand']
    return draw([
        ('share of clear nodes', steps['coarse'].clear_share, '1', {'vmin': 0, 'vmax': 1}),
        ('log-odds', verdict.log_odds[inner], 'ln(p / (1 - p))', {'vmin': -6, 'vmax': 14}),
        ('confidence', found.confidence, '1', {'vmin': 0, 'vmax': 1}),
        reasons_panel('status', found.status)])


def pixels_picture(steps):
    """Return what every pixel gets."""
    found = steps['expand']
    return draw([
        ('disparity', found.disparity, 'px', limits_of(found.disparity)),
        ('disparity_std', found.disparity_std, 'px', {'cmap': ERRORS, 'vmin': 0, 'vmax': 0.3}),
        ('confidence', found.confidence, '1', {'vmin': 0, 'vmax': 1}),
        reasons_panel('status', found.status)])


def third_view_picture(scene):
    """Return the depth of two and of three views, and who saw a pixel."""
    measured = []
    for choice in ('off', 'automatic'):
        settings = Settings().updated({**scene.settings, 'matching.third_view': choice})
        measured.append(ColorStereo(scene.calibration, settings).process(scene.left, scene.right))
    two, three = measured
    scale = limits_of(two.disparity)
    return draw([
        ('left image, rectified', three.image, '', {}),
        ('two views', two.disparity, 'disparity, px', scale),
        ('three views', three.disparity, 'disparity, px', scale),
        codes_panel('who saw a pixel', three.views, '1 right camera, 2 projector, 3 both',
                    VIEWS)])


def pictures(renders):
    """
    Return the pictures by name.

    Parameters
    ----------
    renders : Renders
        Renders the pair, or finds it where it is stored.

    Returns
    -------
    figures : dict of str to matplotlib.figure.Figure

    """
    steps, method = recorded(renders.pair(SCENE, default_pattern()))
    repeating, _ = recorded(renders.pair(SCENE, REPEATING))
    inner = steps['colors'].grid.inner
    return {
        '1_views': views_picture(steps, inner),
        '2_coarse': coarse_picture(steps),
        '3_misfit': misfit_picture(steps, inner),
        '4_planes': planes_picture(steps, inner, method),
        '5_pair': pair_picture(steps, inner),
        '6_neighbors': neighbors_picture(steps, inner),
        '7_evidence': evidence_picture(method),
        '8_trust': trust_picture(steps, inner, method),
        '9_repetitions': repetitions_picture(repeating, repeating['colors'].grid.inner),
        '10_pixels': pixels_picture(steps),
        '11_third_view': third_view_picture(renders.pair(SCENE, default_pattern()))}


def save(figure, path):
    """Write a figure as a PNG of few colors."""
    figure.savefig(path, dpi=RESOLUTION)
    image = cv2.imread(str(path)) // (256 // SHADES) * (255 // (SHADES - 1))
    cv2.imwrite(str(path), image, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def main():
    """Make the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('output', type=Path, help='folder that gets the pictures')
    parser.add_argument('--renders', type=Path, default='evaluation_output/renders',
                        help='folder that keeps rendered pairs (default %(default)s)')
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    with matplotlib.rc_context({**STYLE, 'axes.grid': False}):
        for name, figure in pictures(Renders(arguments.renders)).items():
            save(figure, arguments.output / f'{name}.png')


if __name__ == '__main__':
    main()
