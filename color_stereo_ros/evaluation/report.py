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
"""The report: one self-contained HTML page for people, and the numbers as JSON."""

from html import escape
import platform

import cv2
import numpy as np

from . import plots
from .experiments import ERROR_COLORS, SWEEP_SCENE, SWEEPS, TABLE_31, TABLE_32
from .numbers import figure_of
from .opencv_matchers import METHODS as OPENCV
from .plots import label_of
from .. import __version__
from ..core.false_color import false_color
from ..files.atomic import write_text
from ..pages import plots as pictures
from ..pages.html import CSS, figure, note, panel, section, table

COLUMNS = (
    ('density', 'density', '{:.3f}'), ('correct 1 %', 'correct', '{:.3f}'),
    ('mean error %', 'mean_percent', '{:.3f}'),
    ('median %', 'median_percent', '{:.3f}'), ('p95 %', 'p95_percent', '{:.2f}'),
    ('median px', 'median_px', '{:.3f}'),
    ('bad 0.5', 'bad_05', '{:.3f}'), ('bad 1', 'bad_1', '{:.3f}'),
    ('bad 2', 'bad_2', '{:.3f}'), ('false', 'false_share', '{:.3f}'),
    ('plane fit mm', 'planes.rms_mm', '{:.3f}'),
    ('plane fit px', 'planes.rms_px', '{:.3f}'),
    ('locking px', 'locking.peak_to_peak_px', '{:.3f}'),
    ('error / limit', 'noise_limit.best.error_over_limit', '{:.2f}'),
    ('/ limit 9 x 9', 'noise_limit.common.error_over_limit', '{:.2f}'),
    ('z std', 'z_scores.robust_std', '{:.2f}'),
    ('conf. error', 'reliability.calibration_error', '{:.3f}'),
    ('ms', 'milliseconds', '{:.1f}'))


def average(records, key):
    """Return the mean of a figure over records, None where no record has it."""
    values = [figure_of(r['figures'], key) for r in records]
    values = [value for value in values if value is not None]
    return float(np.mean(values)) if values else None


def write_report(path, laboratory, records, facts):
    """
    Write the page.

    Parameters
    ----------
    path : pathlib.Path
        Of the HTML file; it appears only when it is complete.
    laboratory : color_stereo_ros.evaluation.experiments.Laboratory
        After its tasks have run: it holds the pictures.
    records : list of dict
        One for each run.
    facts : dict
        Name to value, printed at the end of the page.

    """
    page = Page(laboratory, records)
    sections = [page.summary(), page.table_31(), page.table_32(), page.channels(), page.ridge(),
                page.paper_object(), page.complex_scenes(), page.trust(), page.sweeps(),
                page.colophon(facts)]
    write_text(path, HTML.format(css=CSS, body='\n'.join(filter(None, sections))))


HTML = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>color_stereo: evaluation</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>{css}</style></head>
<body><header><div><h1>What the colors measure</h1>
<p>One pair of color images, one range image: the experiments of the paper's section 3 on a
simulated rig with exact truth, every method on the same pairs.</p>
<nav><a href="#summary">Summary</a><a href="#t31">Distances</a><a href="#t32">Materials</a>
<a href="#channels">Channels</a><a href="#ridge">Ridge</a><a href="#object">Object</a>
<a href="#complex">Complex scenes</a><a href="#trust">Trust</a><a href="#sweeps">Sweeps</a></nav>
</div></header><main>{body}</main></body></html>
"""


KINDER = (
    'The simulated rig is kinder than reality: its calibration is exact, its projector stands '
    'still and has no lens distortion and no chromatic aberration, the two cameras are of one '
    'type and take their images at the same instant, the office light is steady, and the response '
    'of the cameras is linear. It is as hard in noise (6 % of the signal at every pixel of a '
    'Bayer mosaic), in bounced light, in gloss, and in weak blue.')


class Page:
    """
    Makes the sections of the page.

    Parameters
    ----------
    laboratory : color_stereo_ros.evaluation.experiments.Laboratory
    records : list of dict

    """

    def __init__(self, laboratory, records):
        self.lab = laboratory
        self.records = records
        self.methods = laboratory.methods

    def of(self, experiment, **wanted):
        """Return the records of an experiment with the wanted entries."""
        return [r for r in self.records if r['experiment'] == experiment
                and all(r[key] == value for key, value in wanted.items())]

    def contenders(self, experiment):
        """Return (label, records, whether this is the pattern the method is meant for)."""
        rows = []
        for method in self.methods:
            for sweep in (True, False):
                chosen = [r for r in self.of(experiment, method=method, values={})
                          if (r['pattern'] == 'sweep') == sweep]
                if chosen:
                    pattern = 'one sweep' if sweep else "package's pattern"
                    rows.append((label_of(method), pattern, chosen,
                                 sweep == (method == 'paper')))
        return rows

    def summary(self):
        """Return the first section: every method, every pattern, averages."""
        heads = ['method', 'pattern', 'white target: mean error', 'materials: mean error',
                 'materials: density', 'complex: density', 'wrong > 1 px', 'median px',
                 'false ranges', 'locking px', 'error / limit', '/ limit 9 x 9', 'ms']
        rows = []
        for method in self.methods:
            for sweep in (False, True):
                row = self._summary_row(method, sweep)
                if row:
                    rows.append(row)
        own = 'surface' if 'surface' in self.methods else self.methods[0]
        return section('summary', 'Summary', ''.join((
            self._tiles(own), table(heads, rows),
            note('Averages over the scenes of each group. Density: share of the pixels seen by '
                 'both cameras and lit that have a range; everything else is taken over those. '
                 'False ranges lie where at most one camera sees a lit surface. Error / limit: '
                 'robust standard deviation of the error over the Cramer-Rao bound of the '
                 "cameras' noise, white targets, over the window that the method uses, and over a "
                 'window of 9 x 9 pixels for all. Highlighted: the pattern that a method is meant '
                 'for. Times on this machine, all its threads.'))))

    def _summary_row(self, method, sweep):
        white, material, mixed, slopes = (
            [r for r in self.of(name, method=method, values={})
             if (r['pattern'] == 'sweep') == sweep]
            for name in ('table_3_1', 'table_3_2', 'complex', 'sweep_slope'))
        if not white + material + mixed:
            return None
        cells = [label_of(method), 'one sweep' if sweep else "package's"]
        for records, key, form in (
                (white, 'mean_percent', '{:.4f} %'), (material, 'mean_percent', '{:.4f} %'),
                (material, 'density', '{:.3f}'), (mixed, 'density', '{:.3f}'),
                (mixed, 'bad_1', '{:.4f}'), (mixed, 'median_px', '{:.4f}'),
                (mixed, 'false_share', '{:.4f}'),
                (mixed + slopes, 'locking.peak_to_peak_px', '{:.3f}'),
                (white, 'noise_limit.best.error_over_limit', '{:.2f}'),
                (white, 'noise_limit.common.error_over_limit', '{:.2f}'),
                (mixed or white, 'milliseconds', '{:.0f}')):
            cells.append(formatted(average(records, key), form))
        return cells, sweep == (method == 'paper')

    def _tiles(self, method):
        white, material, mixed = (
            [r for r in self.of(name, method=method, values={}) if r['pattern'] != 'sweep']
            for name in ('table_3_1', 'table_3_2', 'complex'))
        tiles = ((white, 'mean_percent', '{:.3f} %', 'mean error, white target'),
                 (material, 'mean_percent', '{:.3f} %', 'mean error, materials at 350 mm'),
                 (mixed, 'density', '{:.1%}', 'of the visible pixels of complex scenes'),
                 (mixed, 'bad_1', '{:.2%}', 'of them wrong by more than 1 px'),
                 (mixed, 'median_px', '{:.3f} px', 'median error there'),
                 (mixed, 'false_share', '{:.2%}', 'false ranges'))
        return note(f"{label_of(method)}, with the package's own pattern:") + (
            '<div class="tiles">' + ''.join(
                f'<div class="tile"><b>{formatted(average(records, key), form)}</b>'
                f'<span>{text}</span></div>' for records, key, form, text in tiles) + '</div>')

    def table_31(self):
        """Return the section of the paper's table 3.1."""
        records = self.of('table_3_1')
        if not records:
            return ''
        distances = sorted({r['abscissa'] for r in records})
        body = self._paper_table(
            'Z, mm', distances, records, lambda z: f'{z:.0f}', TABLE_31.get)
        plain = [r for r in records if not r['values']]
        return section('t31', 'Table 3.1: distance of a white reflector', ''.join((
            note('Mean absolute error in mm; below it in % of the distance, and the density. The '
                 "printed figures are the paper's. &lsquo;As printed&rsquo; repeats its reading: "
                 'one sweep, a window of nine pixels of one row, whole pixels.'), body,
            figure(plots.distance_plot(plain, self.methods),
                   'Mean error of each method over the distance of the reflector'))))

    def table_32(self):
        """Return the section of the paper's table 3.2."""
        records = self.of('table_3_2')
        if not records:
            return ''
        materials = [name for name in TABLE_32 if any(r['abscissa'] == name for r in records)]
        body = self._paper_table(
            'material', materials, records, lambda name: name.replace('_', ' '), TABLE_32.get)
        plain = [r for r in records if not r['values']]
        return section('t32', 'Table 3.2: different reflectors at 350 mm', ''.join((
            body, figure(plots.material_plot(plain, self.methods, materials),
                         'Mean error of each method for each material'))))

    def _paper_table(self, title, abscissae, records, name, printed):
        """Return the table of mean errors beside the paper's own figures."""
        columns = [('as printed, one sweep', [r for r in records if r['values']])]
        columns += [(f'{label_of(method)}, one sweep', [
            r for r in records if r['method'] == method and not r['values']
            and r['pattern'] == 'sweep']) for method in self.methods if method == 'paper']
        columns += [(f"{label_of(method)}, package's pattern", [
            r for r in records if r['method'] == method and not r['values']
            and r['pattern'] != 'sweep']) for method in self.methods]
        columns = [(label, chosen) for label, chosen in columns if chosen]
        rows = []
        for abscissa in abscissae:
            cells = [name(abscissa), formatted(printed(abscissa), '{:.2f} mm')]
            cells += [mean_cell([r for r in chosen if r['abscissa'] == abscissa])
                      for _, chosen in columns]
            rows.append((cells, False))
        average_cells = ['<b>mean</b>', '']
        average_cells += [f'<b>{mean_cell(chosen)}</b>' for _, chosen in columns]
        rows.append((average_cells, False))
        return table([title, 'the paper, printed', *(label for label, _ in columns)], rows)

    def channels(self):
        """Return the section of the paper's figure 3.1."""
        if not self.lab.profile:
            return ''
        return section('channels', 'Fig. 3.1: the three channels along one image line', (
            note("The camera sees the white reflector under one sweep; blue is the chip's weak "
                 'channel. Scaling equalizes the channels and their slowly varying amplitude, '
                 'smoothing removes the rest.')
            + figure(plots.profile_plot(self.lab.profile),
                     'Red, green and blue along one image line, before and after correction')))

    def ridge(self):
        """Return the section of the paper's figure 3.2."""
        if not self.lab.surfaces:
            return ''
        chosen = {m: z for m, z in self.lab.surfaces.items() if m in ('paper', 'surface')}
        chosen = chosen or dict(list(self.lab.surfaces.items())[:2])
        rows = [([label_of(r['method']),
                  formatted(figure_of(r['figures'], 'mean_mm'), '{:.3f} mm'),
                  formatted(r['figures']['p95_m'] and 1e3 * r['figures']['p95_m'], '{:.3f} mm'),
                  formatted(figure_of(r['figures'], 'planes.rms_mm'), '{:.3f} mm')], False)
                for r in self.of('complex', scene='prism', values={})
                if (r['pattern'] == 'sweep') == (r['method'] == 'paper')]
        return section('ridge', 'Fig. 3.2: a ridge in three dimensions', ''.join((
            note('The paper reports a largest error of about 2 mm over the evaluated area. Each '
                 'method under the pattern it is meant for.'),
            '<div class="ridge">', figure(plots.surface_plot(chosen, (0.33, 0.47)),
                                          'The ridge as each method measures it'), '</div>',
            table(['method', 'mean error', '95th percentile', 'about its planes'], rows))))

    def paper_object(self):
        """Return the section of the paper's figures 3.3 to 3.5."""
        key = (SWEEP_SCENE, 'sweep')
        if key not in self.lab.pictures:
            return ''
        kept = self.lab.pictures[key]
        ours = next((pictures for (scene, pattern), pictures in self.lab.pictures.items()
                     if scene == SWEEP_SCENE and pattern != 'sweep'), {})
        panels = [('Fig. 3.3: the object', pictures.photograph(self.lab.objects[SWEEP_SCENE])),
                  ('Fig. 3.4: as one camera sees it', pictures.photograph(kept['left image']))]
        if 'paper' in kept:
            panels.append(("Fig. 3.5: range map of the paper's method",
                           pictures.picture(kept['paper'])))
        if 'left image' in ours:
            panels.append(("under the package's pattern", pictures.photograph(ours['left image'])))
        if 'surface' in ours:
            panels.append(('its range map', pictures.picture(ours['surface'])))
        panels.append(('truth, where both cameras see it', pictures.picture(kept['truth'])))
        return section('object', 'Figs. 3.3 to 3.5: a complex object', (
            note(f'Range maps: {color_bar(*kept["limits"])}, black has no range. The paper got a '
                 'range that was right for 71 % of the pixels, a deviating one for 10 %, none for '
                 '19 %.')
            + f'<div class="gallery">{"".join(panel(*p) for p in panels)}</div>'))

    def complex_scenes(self):
        """Return the section of the complex scenes."""
        records = self.of('complex', values={})
        if not records:
            return ''
        scenes = list(dict.fromkeys(r['scene'] for r in records))
        rows = [([label, pattern, *(formatted(average(chosen, key), form)
                                    for _, key, form in COLUMNS)], own)
                for label, pattern, chosen, own in self.contenders('complex')]
        parts = [table(['method', 'pattern', *(title for title, _, _ in COLUMNS)], rows),
                 '<h3>Why a visible pixel has no range</h3>',
                 figure(plots.status_plot(records, self.methods),
                        'Share of the visible pixels by reason, for each method'),
                 error_legend()]
        parts += [self._scene(name) for name in scenes]
        return section('complex', f'{len(scenes)} complex scenes', ''.join(parts))

    def _scene(self, name):
        rows = [([label_of(r['method']), 'one sweep' if r['pattern'] == 'sweep' else "package's",
                  *(formatted(figure_of(r['figures'], key), form) for _, key, form in COLUMNS)],
                 (r['pattern'] == 'sweep') == (r['method'] == 'paper'))
                for r in self.of('complex', scene=name, values={})]
        panels, limits = [], (0.0, 1.0)
        for (scene, pattern), kept in self.lab.pictures.items():
            limits = kept['limits'] if scene == name else limits
            if scene == name and (pattern != 'sweep' or 'paper' in kept):
                panels += self._scene_panels(pattern, kept)
        heading = escape(name.replace('_', ' '))
        return (f'<details{" open" if name == SWEEP_SCENE else ""}><summary>{heading}</summary>'
                + note(f'Range maps: {color_bar(*limits)}.')
                + table(['method', 'pattern', *(title for title, _, _ in COLUMNS)], rows)
                + f'<div class="gallery">{"".join(panels)}</div></details>')

    def _scene_panels(self, pattern, kept):
        methods = ('paper',) if pattern == 'sweep' else self.methods
        panels = [panel('left image, ' + ('one sweep' if pattern == 'sweep' else
                                          "package's pattern"),
                        pictures.photograph(kept['left image']))]
        for method in methods:
            if method in kept:
                name = label_of(method)
                panels += [panel(name, pictures.picture(kept[method]), f'Range map of {name}'),
                           panel('its errors', pictures.picture(kept[f'{method} error']),
                                 f'Where {name} errs')]
        return panels

    def trust(self):
        """Return the section about confidence, standard deviation and pixel locking."""
        records = self.of('complex', values={})
        if not records:
            return ''
        rows = [([label, pattern, *(formatted(average(chosen, key), form) for key, form in (
            ('reliability.calibration_error', '{:.3f}'), ('z_scores.robust_std', '{:.2f}'),
            ('z_scores.within_2', '{:.3f}'), ('locking.peak_to_peak_px', '{:.3f}')))], own)
            for label, pattern, chosen, own in self.contenders('complex')]
        return section('trust', 'How far a pixel can be trusted', ''.join((
            note('Left and middle: what remains wrong when only the most trusted ranges are kept. '
                 "OpenCV's matchers give no confidence: a point. Right: of the pixels with "
                 'confidence c, how many are within 1 px; false ranges count as wrong.'),
            figure(plots.trust_plot(records, self.methods),
                   'Errors over the share of ranges kept; share of right ranges over confidence'),
            table(['method', 'pattern', 'calibration error', 'z: robust std (1)',
                   'z: within 2 (0.954)', 'locking, px'], rows),
            '<h3>Pixel locking</h3>',
            note('Mean error against the fractional part of the true disparity: a matcher that '
                 'prefers whole pixels draws a wave.'),
            figure(plots.locking_plot(records + self.of('sweep_slope', values={}), self.methods),
                   'Mean error over the fractional part of the true disparity'))))

    def sweeps(self):
        """Return the section of the sweeps."""
        parts = []
        for name, (title, _, _) in SWEEPS.items():
            records = self.of(f'sweep_{name}')
            if records:
                parts.append(f'<h3>{title[0].upper() + title[1:]}</h3>'
                             + figure(plots.sweep_plot(name, records, self.methods),
                                      f'Figures of each method: {title}'))
        if not parts:
            return ''
        return section('sweeps', 'Sweeps', ''.join(parts))

    def colophon(self, facts):
        """Return how the page was made."""
        versions = {'color_stereo_ros': __version__, 'OpenCV': cv2.__version__,
                    'numpy': np.__version__, 'Python': platform.python_version(),
                    **{f'{label_of(name)}': text for name, text in OPENCV.items()}}
        rows = [([escape(str(name)), escape(str(value))], False)
                for name, value in {**facts, **versions}.items()]
        return section('made', 'How this page was made', note(KINDER) + table(['', ''], rows))


def formatted(value, form):
    """Return a number as text, an en dash where there is none."""
    return '&ndash;' if value is None else form.format(value)


def mean_cell(records):
    """Return mean error in mm, and in % with the density below it."""
    if not records:
        return '&ndash;'
    return (formatted(average(records, 'mean_mm'), '{:.3f} mm') + '<br><small>'
            + formatted(average(records, 'mean_percent'), '{:.3f} %') + ' &middot; '
            + formatted(average(records, 'density'), '{:.2f}') + '</small>')


def color_bar(near, far):
    """Return the key of the range maps."""
    depths = np.linspace(near, far, 9, dtype=np.float32)
    colors = ', '.join(f'rgb{tuple(color)}'
                       for color in false_color(depths[None], near, far)[0].tolist())
    return (f'{near:g} m <span class="bar" style="background: linear-gradient(90deg, {colors})">'
            f'</span> {far:g} m')


def error_legend():
    """Return the key of the error pictures."""
    texts = {'right': 'within 0.5 px', 'small': 'within 1 px', 'large': 'wrong',
             'missing': 'visible, no range', 'false': 'false range', 'hidden': 'not visible'}
    return '<p class="soft">Errors:' + ''.join(
        f'<span class="key" style="background: rgb{color}"></span>{texts[name]}'
        for name, color in ERROR_COLORS.items()) + '</p>'
