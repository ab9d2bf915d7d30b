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
"""The page of the stress test: curves over the severity, one self-contained HTML file."""

from html import escape

from matplotlib.figure import Figure
import numpy as np

from .runs import averages, verdict
from ..opencv_matchers import METHODS as OPENCV
from ..plots import color_of, label_of
from ..report import formatted
from ...files.atomic import write_text
from ...pages.html import CSS, figure, note, section, table
from ...pages.plots import as_svg, plain_numbers, styled

COLUMNS = (
    ('density', 'density', '{:.3f}', 1, 'share of the visible pixels that have a range'),
    ('right', 'right', '{:.3f}', 1, 'share of the visible pixels whose range is right within 1 px '
     'of the true correspondence in the pair as given'),
    ('wrong', 'wrong', '{:.2f}', 100, 'the others, % of the visible pixels with a range'),
    ('median', 'median_px', '{:.3f}', 1, 'median error of these, px'),
    ('false', 'false', '{:.2f}', 100, 'ranges where at most one camera sees a lit surface, % of '
     'all ranges'),
    ('false-wr', 'false_wrong', '{:.2f}', 100, 'those of them that are off by more than 1 px, '
     '% of all ranges'),
    ('cover', 'cover', '{:.3f}', 1, 'share of the lit pixels of the left camera that are right, '
     'whether the right camera sees them or not'),
    ('depth', 'depth_percent', '{:.3f}', 1, 'mean depth error, % of the true depth'),
    ('hi', 'hi', '{:.2f}', 100, 'wrong ones among the ranges of confidence above .9, %'),
    ('sure', 'sure', '{:.3f}', 1, 'share of the right ranges with confidence above .9'),
    ('z68', 'z68', '{:.2f}', 1, '68 % of abs(error / disparity_std) lie below it; 1 is honest'),
    ('all sure', 'sure_pixels', '{:.3f}', 1, 'share of all pixels with a range of confidence '
     'above .9, right or not'))
"""Title, key of `metrics.words`, format, factor and meaning."""

CURVES = (('right', 'right', 1, 'linear'), ('wrong', 'wrong, %', 100, 'linear'),
          ('median_px', 'median, px', 1, 'log'), ('hi', 'hi, %', 100, 'linear'),
          ('z68', 'z68', 1, 'log'))

GROUPS = {'none': 'As calibrated', 'geometry': 'Geometry', 'optics': 'Optics',
          'electronics': 'Cameras and files', 'color': 'Color', 'light': 'Light',
          'surface': 'Surfaces', 'mono': 'Mono cameras', 'pattern': 'Patterns',
          'together': 'Several at once', 'refusal': 'Pairs without an answer',
          'sequence': 'Sequences'}

HTML = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>color_stereo: stress test</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>{css}
figure svg {{ max-width: 100%; }}</style></head>
<body><header><div><h1>Rigs as people have them</h1>
<p>One disturbance at a time on the simulated rig, with exact truth, beside OpenCV's matchers on
the same pairs.</p></div></header><main>{body}</main></body></html>
"""


def cells_of(figures):
    """Return the figures of a case as texts, '-' where there is none."""
    return ['-' if figures.get(key) is None else form.format(factor * figures[key])
            for _, key, form, factor, _ in COLUMNS]


def write_page(path, cases, by_case, methods, facts):
    """
    Write the page.

    Parameters
    ----------
    path : pathlib.Path
        Of the HTML file; it appears only when it is complete.
    cases : list of Case
        The disturbances that were tried.
    by_case : dict of Case to list of dict
        Records of `StressTest.run`.
    methods : sequence of str
        The first one is judged, the others stand beside it.
    facts : dict
        Name to value, printed at the end of the page.

    """
    parts = [_summary(cases, by_case, methods)]
    for group, title in GROUPS.items():
        names = list(dict.fromkeys(c.name for c in cases if c.disturbance.group == group))
        if names and group != 'none':
            parts.append(section(group, title, ''.join(
                _curve(name, cases, by_case, methods) for name in names)))
    rows = [([escape(str(name)), escape(str(value))], False) for name, value in facts.items()]
    parts.append(section('made', 'How this page was made', table(['', ''], rows)))
    write_text(path, HTML.format(css=CSS, body='\n'.join(parts)))


def _summary(cases, by_case, methods):
    rivals = methods[1:]
    rows = []
    for case in cases:
        ours = averages(by_case[case], methods[0])
        others = [formatted(averages(by_case[case], rival).get('right'), '{:.3f}')
                  for rival in rivals]
        rows.append(([escape(case.title), *cells_of(ours), *others], False))
    heads = ['case', *(title for title, *_ in COLUMNS), *(f'right, {label_of(m)}' for m in rivals)]
    legend = '; '.join(f'{title}: {meaning}' for title, _, _, _, meaning in COLUMNS)
    return section('summary', 'Summary', _verdict(cases, by_case, methods)
                   + table(heads, rows) + note(f'Means over the scenes. {legend}.'))


def _verdict(cases, by_case, methods):
    return ''.join(note(escape(sentence)) for sentence in sentences(cases, by_case, methods))


def sentences(cases, by_case, methods):
    """Return what the run says of the first method, as sentences."""
    told = []
    for rival in methods[1:2]:
        found = verdict(cases, by_case, methods[0], rival)
        told += [f'{found["cases"]} cases with truth: {methods[0]} has more right ranges than '
                 f'{rival} in {found["ahead"]}, fewer in {found["behind"]}.',
                 _named('Behind by more than 1 point in', found['far_behind']),
                 _named('Above 1 % wrong at confidence > .9 in', found['untrue']),
                 _named('z68 outside .7 .. 1.4 in', found['dishonest'])]
    return told


def _named(text, names):
    return f'{text} {len(names)}' + (f': {", ".join(names)}.' if names else '.')


def _curve(name, cases, by_case, methods):
    own = [case for case in cases if case.name == name]
    entry = own[0].disturbance
    unit = f' ({entry.unit})' if entry.unit else ''
    return (f'<h3>{escape(name)}: {escape(entry.title)}{escape(unit)}</h3>'
            + figure(curve_plot(own, cases[0], by_case, methods),
                     f'Figures of each method over {entry.title}'))


@styled
def curve_plot(own, calm, by_case, methods):
    """Plot the figures of every method over the levels of one disturbance."""
    points, labels = _points(own, calm, by_case)
    drawing = Figure((12.5, 2.2))
    for axes, (key, title, factor, scale) in zip(drawing.subplots(1, len(CURVES)), CURVES):
        for method in methods:
            if key == 'hi' and method in OPENCV:
                continue  # no confidence
            values = [averages(records, method, pair).get(key) for records, pair in points]
            values = [np.nan if value is None else factor * value for value in values]
            if not np.all(np.isnan(values)):
                axes.plot(range(len(values)), values, 'o-', color=color_of(method), ms=4,
                          label=label_of(method))
        axes.set(title=title, xticks=range(len(labels)))
        axes.set_xticklabels(labels, fontsize=7)
        if scale == 'log' and axes.lines and np.nanmin(
                [np.nanmin(line.get_ydata()) for line in axes.lines]) > 0:
            axes.set_yscale('log')
            plain_numbers(axes.yaxis)
    drawing.axes[0].set_ylim(0, 1.02)
    drawing.axes[0].legend(loc='lower left', fontsize=8)
    drawing.subplots_adjust(wspace=0.32)
    return as_svg(drawing)


def _points(own, calm, by_case):
    """Return (records, pair) of each point of a curve, and the labels of the points."""
    if own[0].disturbance.per_pair:
        records = by_case[own[-1]]
        numbers = sorted({record['pair'] for record in records})
        return [(records, number) for number in numbers], [f'{n}' for n in numbers]
    return ([(by_case[calm], None), *((by_case[case], None) for case in own)],
            ['none', *(f'{case.level:g}' for case in own)])
