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
"""The plots of the report, each a self-contained piece of HTML."""

from matplotlib.figure import Figure
import numpy as np

from .experiments import SWEEPS, TABLE_31, TABLE_32
from ..core.false_color import STATUS_COLORS
from ..pages.plots import as_image, as_svg, plain_numbers, styled

COLORS = {'surface': '#0b7a5b', 'paper': '#c8553d', 'bm': '#8a94a6', 'sgbm': '#3d6cb4',
          '3way': '#7a5ab0'}
LABELS = {'surface': 'surface', 'paper': "paper's method", 'bm': 'StereoBM',
          'sgbm': 'StereoSGBM', '3way': 'SGBM 3WAY'}
CHANNELS = ('#d1495b', '#2f9e44', '#2f6fde')


def color_of(method):
    """Return the color of a method; a future one gets black."""
    return COLORS.get(method, '#222222')


def label_of(method):
    """Return the name of a method for people."""
    return LABELS.get(method, method)


@styled
def distance_plot(records, methods):
    """Plot the mean error over the distance beside the paper's table 3.1."""
    figure = Figure((7.2, 3.4))
    axes = figure.subplots()
    axes.plot(list(TABLE_31), [100 * error / z for z, error in TABLE_31.items()], 's--',
              color='#222222', label='the paper, table 3.1 (printed)', ms=5)
    for label, color, style, chosen in series(records, methods):
        axes.plot([r['abscissa'] for r in chosen],
                  [r['figures']['mean_percent'] for r in chosen], style, color=color, label=label)
    axes.set(yscale='log', xlabel='distance, mm', ylabel='mean error, % of the distance')
    plain_numbers(axes.yaxis)
    axes.legend(loc='center left', bbox_to_anchor=(1.01, 0.5))
    return as_svg(figure)


@styled
def material_plot(records, methods, materials):
    """Plot the mean error for every material beside the paper's table 3.2."""
    figure = Figure((7.2, 3.6))
    axes = figure.subplots()
    places = np.arange(len(materials))
    axes.plot([TABLE_32[name] / 3.5 for name in materials], places, 's', color='#222222',
              label='the paper, table 3.2 (printed)', ms=6)
    for label, color, style, chosen in series(records, methods):
        values = {r['abscissa']: r['figures']['mean_percent'] for r in chosen}
        axes.plot([values.get(name) for name in materials], places, 'o', color=color,
                  label=label, ms=6, mfc=color if style == 'o-' else 'none')
    axes.set(xscale='log', xlabel='mean error, % of the distance',
             yticks=places, yticklabels=[name.replace('_', ' ') for name in materials])
    axes.invert_yaxis()
    plain_numbers(axes.xaxis)
    axes.legend(loc='center left', bbox_to_anchor=(1.01, 0.5))
    return as_svg(figure)


def series(records, methods):
    """
    Yield (label, color, line style, records) of every line of a plot over the abscissa.

    The paper's method appears with the paper's pattern and with ours, the others with ours.

    """
    for method in methods:
        for pattern, style in (('sweep', 'o:'), (None, 'o-')):
            own = pattern == 'sweep'
            if own and method != 'paper':
                continue
            chosen = [r for r in records if r['method'] == method and not r['values']
                      and (r['pattern'] == 'sweep') == own]
            if chosen:
                label = label_of(method) + (', one sweep' if own else '')
                yield label, color_of(method), style, chosen


@styled
def profile_plot(profile):
    """Plot the three channels along one image line (the paper's fig. 3.1)."""
    figure = Figure((8.6, 5.4))
    for axes, (title, rows) in zip(figure.subplots(len(profile), 1, sharex=True),
                                   profile.items()):
        for channel, color in enumerate(CHANNELS):
            axes.plot(rows[:, channel], color=color, lw=1.1)
        axes.set(title=title, ylabel='DN', xlim=(0, len(rows)), ylim=(0, None))
    axes.set_xlabel('column of the rectified left image')
    figure.subplots_adjust(hspace=0.35)
    return as_svg(figure)


@styled
def surface_plot(surfaces, truth_limits):
    """Plot depth maps in three dimensions (the paper's fig. 3.2)."""
    figure = Figure((4.4 * len(surfaces), 4.2))
    near, far = truth_limits
    for index, (method, depth) in enumerate(surfaces.items()):
        axes = figure.add_subplot(1, len(surfaces), index + 1, projection='3d')
        step = 6
        rows, columns = np.indices(depth.shape)[:, ::step, ::step]
        values = 1e3 * depth[::step, ::step]
        values = np.where((values > 1e3 * near) & (values < 1e3 * far), values, np.nan)
        values[_beside_steps(values)] = np.nan
        axes.plot_surface(columns, rows, values, color=color_of(method), lw=0.15,
                          edgecolor='#ffffff', rstride=1, cstride=1, antialiased=True)
        axes.set(title=label_of(method), zlim=(1e3 * far, 1e3 * near), xlabel='column, px',
                 ylabel='row, px', zlabel='Z, mm')
        axes.view_init(38, -65)
        axes.set_box_aspect((1, 1, 0.55))
    return as_image(figure)


def _beside_steps(values, step=12.0):
    """Return where the next value in the row or column differs by more than a step, mm."""
    rough = np.zeros(values.shape, bool)
    with np.errstate(invalid='ignore'):
        rough[:, :-1] |= np.abs(np.diff(values, axis=1)) > step
        rough[:-1] |= np.abs(np.diff(values, axis=0)) > step
    return rough


@styled
def trust_plot(records, methods):
    """Plot what confidence is worth: error over density, and the share that is right over it."""
    figure = Figure((9.6, 3.4))
    left, middle, right = figure.subplots(1, 3)
    for method in methods:
        chosen = [r['figures'] for r in own_pattern(records, method)]
        curves = [f['curve'] for f in chosen if f['curve']]
        if curves:
            density, bad, median = (np.mean([c[key] for c in curves], axis=0)
                                    for key in ('density', 'bad_1', 'median_px'))
            left.plot(density, 100 * bad, '-', color=color_of(method), label=label_of(method))
            middle.plot(density, median, '-', color=color_of(method))
        elif chosen:
            density, bad, median = (np.mean([f[key] or 0 for f in chosen])
                                    for key in ('density', 'bad_1', 'median_px'))
            left.plot(density, 100 * bad, 'o', color=color_of(method), label=label_of(method))
            middle.plot(density, median, 'o', color=color_of(method))
        _plot_reliability(right, [f['reliability'] for f in chosen if f['reliability']], method)
    right.plot([0, 1], [0, 1], color='#9aa1ad', lw=1, ls='--', zorder=0)
    left.set(title='wrong by more than 1 px', xlabel='density', ylabel='% of the kept ranges')
    middle.set(title='median error', xlabel='density', ylabel='px', yscale='log')
    right.set(title='confidence', xlabel='confidence', ylabel='share within 1 px',
              xlim=(0, 1.02), ylim=(0, 1.02))
    plain_numbers(middle.yaxis)
    left.legend(loc='upper left')
    figure.subplots_adjust(wspace=0.38)
    return as_svg(figure)


def _plot_reliability(axes, curves, method):
    """Plot the share that is right in bins of the confidence, all scenes together."""
    if not curves:
        return
    confidence, right, weight = (np.concatenate([c[key] for c in curves])
                                 for key in ('confidence', 'right', 'pixels'))
    index = np.minimum((confidence * 10).astype(int), 9)
    total = np.bincount(index, weight, 10)
    used = total > 0.002 * total.sum()
    axes.plot((np.bincount(index, weight * confidence, 10)[used] / total[used]),
              (np.bincount(index, weight * right, 10)[used] / total[used]), 'o-',
              color=color_of(method), ms=4)


def own_pattern(records, method):
    """Return the records in which a method works with the pattern it is meant for."""
    sweep = method == 'paper'
    return [r for r in records if r['method'] == method and not r['values']
            and (r['pattern'] == 'sweep') == sweep]


@styled
def locking_plot(records, methods):
    """Plot the mean error over the fractional disparity, averaged over scenes."""
    figure = Figure((7.2, 3.0))
    axes = figure.subplots()
    for method in methods:
        curves = [r['figures']['locking'] for r in records
                  if r['method'] == method and not r['values'] and r['pattern'] != 'sweep'
                  and r['figures']['locking']]
        if curves:
            fraction = [*curves[0]['fraction'], 1.0 + curves[0]['fraction'][0]]
            mean = np.mean([np.subtract(c['mean_px'], np.mean(c['mean_px'])) for c in curves],
                           axis=0)
            axes.plot(fraction, [*mean, mean[0]], color=color_of(method), label=label_of(method))
    axes.axhline(0, color='#9aa1ad', lw=1)
    axes.set(xlabel='fractional part of the true disparity, px', ylabel='mean error, px',
             xlim=(0, 1.03))
    axes.legend(loc='center left', bbox_to_anchor=(1.01, 0.5))
    return as_svg(figure)


@styled
def sweep_plot(name, records, methods):
    """Plot density, share wrong and median error over the abscissa of a sweep."""
    _, unit, _ = SWEEPS[name]
    figure = Figure((9.6, 2.5))
    shown = (('density', 'density', 'linear', 1), ('bad_1', 'wrong by more than 1 px, %',
                                                   'linear', 100),
             ('median_px', 'median error, px', 'log', 1))
    for axes, (key, title, scale, factor) in zip(figure.subplots(1, 3), shown):
        for label, color, style, chosen in _sweep_lines(name, records, methods):
            values = [r['figures'][key] for r in chosen]
            axes.plot([r['abscissa'] for r in chosen],
                      [np.nan if v is None else factor * v for v in values], style, color=color,
                      label=label, ms=4)
        axes.set(title=title, xlabel=unit, yscale=scale)
        if scale == 'log':
            plain_numbers(axes.yaxis)
        if name in ('noise', 'albedo', 'cycles'):
            axes.set_xscale('log', base=2)
            ticks = sorted({r['abscissa'] for r in records})
            axes.set_xticks(ticks, [f'{tick:g}' for tick in ticks])
    axes.legend(loc='center left', bbox_to_anchor=(1.02, 0.5))
    figure.subplots_adjust(wspace=0.3)
    return as_svg(figure)


def _sweep_lines(name, records, methods):
    if name != 'cycles':
        return series(records, methods)
    return [(label_of(method), color_of(method), 'o-',
             [r for r in records if r['method'] == method]) for method in methods]


@styled
def status_plot(records, methods):
    """Plot why visible pixels have no range, averaged over scenes."""
    figure = Figure((8.6, 0.5 + 0.42 * len(methods)))
    axes = figure.subplots()
    for place, method in enumerate(methods):
        chosen = own_pattern(records, method)
        left = 0.0
        for status, color in STATUS_COLORS.items():
            share = np.mean([r['figures']['status'][status.name]['visible'] for r in chosen]
                            or [0.0])
            axes.barh(place, 100 * share, left=left, color=np.divide(color, 255), height=0.62,
                      edgecolor='#9aa1ad', linewidth=0.5,
                      label=status.label if place == 0 else None)
            left += 100 * share
    axes.set(yticks=range(len(methods)), yticklabels=[label_of(m) for m in methods],
             xlabel='% of the visible pixels', xlim=(0, 100))
    axes.invert_yaxis()
    axes.legend(loc='center left', bbox_to_anchor=(1.01, 0.5), ncols=1, fontsize=8)
    return as_svg(figure)
