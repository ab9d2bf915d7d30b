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
"""From the figures of a bench to goals met or missed, and to tables for people."""

from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
import re
import statistics
from typing import Callable

from .scene import VGA
from .times import Contender, cores

BLOCK = re.compile(r'(<!-- bench: (\w+) -->\n).*?(<!-- end -->)', re.DOTALL)
FULL = Contender('surface')
NODE_RUNS = {'node': '`points`', 'node_profile': '`points`, `fastdds_shm.xml`',
             'node_depth': '`depth/image`', 'node_third': '`depth/image`, third view',
             'node_double': '`depth/image`, 1280 x 960'}
"""Runs of range_node, by their key among the figures."""


@dataclass(frozen=True)
class Goal:
    """A figure that shall be on the right side of a limit."""

    name: str
    limit: float
    unit: str
    """Written behind the figure: '', ' ms', ' s', ' MB' or ' %'."""
    figure: Callable
    """Takes the figures of a bench, returns a number; KeyError or IndexError if not measured."""
    at_least: bool = False

    def row(self, figures):
        """Return a dict with name, figure, goal and met; figure and met None if not measured."""
        try:
            figure = float(self.figure(figures))
        except (KeyError, IndexError):
            figure = None
        met = None if figure is None else (
            figure >= self.limit if self.at_least else figure <= self.limit)
        return {'name': self.name, 'figure': figure, 'unit': self.unit.strip(),
                'goal': f'{">=" if self.at_least else "<="} {self.limit:g}{self.unit}',
                'met': met}


def median(figures, item):
    """Return the median time of a contender, s."""
    return figures['times'][item.name]['median']


def ratio(above, below):
    """Return a function of the figures: one contender's time divided by another's."""
    return lambda figures: median(figures, above) / median(figures, below)


def node_rate(index, key, scale=1.0):
    """Return a function of the figures: a value of range_node at one of its rates."""
    return lambda figures: scale * figures['node']['rates'][index][key]


def answered(index, run='node'):
    """Return a function of the figures: pairs answered of pairs sent, %."""
    def share(figures):
        rate = figures[run]['rates'][index]
        return 100.0 * rate['answered'] / rate['sent']
    return share


GOALS = (
    Goal('640 x 480, 128 disparities: time of `ColorStereo.process` / time of OpenCV '
         '`StereoBM(128, 15).compute` alone', 1.0, '', ratio(FULL, Contender('bm'))),
    Goal('the same / OpenCV `StereoSGBM` on color (MODE_SGBM)', 0.15, '',
         ratio(FULL, Contender('sgbm'))),
    Goal('time at 256 disparities / at 64', 1.5, '',
         ratio(Contender('surface', VGA, 256), Contender('surface', VGA, 64))),
    Goal('time at 1280 x 960 with twice the disparities / at 640 x 480', 4.2, '',
         ratio(Contender('surface', (1280, 960), 256), FULL)),
    Goal("the paper's method, 9 x 9, 640 x 480, 128 disparities", 40.0, ' ms',
         lambda figures: 1e3 * median(figures, Contender('paper'))),
    Goal('range_node, pairs through real DDS at 30 Hz: answered of sent', 100.0, ' %',
         answered(0), at_least=True),
    Goal('the same at 60 Hz', 80.0, ' %', answered(1), at_least=True),
    Goal('the same at 60 Hz, `depth/image` alone', 95.0, ' %', answered(1, 'node_depth'),
         at_least=True),
    Goal('the same at 30 Hz, `depth/image` alone, 1280 x 960', 60.0, ' %',
         answered(0, 'node_double'), at_least=True),
    Goal('answers out of order or doubled at 60 Hz', 0.0, '', node_rate(1, 'out_of_order')),
    Goal('arrival of the second image to publication of `points` at 30 Hz, p50', 20.0, ' ms',
         node_rate(0, 'p50_ms')),
    Goal('the same, p99', 35.0, ' ms', node_rate(0, 'p99_ms')),
    Goal('first cloud after the start of range_node, kernel cache warm', 2.0, ' s',
         lambda figures: statistics.median(start['first'] for start in figures['starts'])),
    Goal('the same, kernel cache cold', 15.0, ' s',
         lambda figures: figures['node_cold']['first']),
    Goal('largest resident memory of range_node', 450.0, ' MB',
         lambda figures: max(figures[run]['peak_mb'] for run in ('node', 'node_third'))),
)


def goal_rows(figures):
    """Return the row of every goal."""
    return [goal.row(figures) for goal in GOALS]


def machine():
    """Return what the times depend on, a dict of words to words."""
    names = {'numpy': 'NumPy', 'numba': 'numba', 'opencv-python-headless': 'OpenCV',
             'opencv-python': 'OpenCV'}
    found = {'processor': processor(), 'cores': str(cores()),
             'load at the start': f'{os.getloadavg()[0]:.1f}', 'Python': platform.python_version()}
    for package, name in names.items():
        try:
            found.setdefault(name, version(package))
        except PackageNotFoundError:
            continue
    return found


def processor():
    """Return the name of the processor."""
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return names[0] if names else platform.processor() or platform.machine()


def machine_text(figures):
    """Return one line about the machine."""
    words = ', '.join(f'{name} {value}' for name, value in figures['machine'].items())
    return f'Measured on {figures["date"]}: {words}; {figures["rounds"]} rounds.\n'


def markdown(header, rows):
    """Return a Markdown table."""
    lines = [f'| {" | ".join(header)} |', f'|{"---|" * len(header)}']
    return '\n'.join([*lines, *(f'| {" | ".join(map(str, row))} |' for row in rows)]) + '\n'


def goal_table(figures):
    """Return the goals as a Markdown table."""
    words = {True: 'met', False: '**missed**', None: ''}
    return markdown(('', 'figure', 'goal', ''), [
        (row['name'], _figure(row), row['goal'], words[row['met']]) for row in figures['goals']])


def _figure(row):
    if row['figure'] is None:
        return 'not measured'
    unit = f' {row["unit"]}' if row['unit'] else ''
    return f'{row["figure"]:.3g}{unit}'


def time_table(figures):
    """Return all times as a Markdown table."""
    return markdown(('', 'median, ms', 'least, ms'), [
        (name, f'{1e3 * times["median"]:.1f}', f'{1e3 * times["least"]:.1f}')
        for name, times in figures['times'].items()])


def stage_table(figures):
    """Return the stages of `ColorStereo.process` as a Markdown table, a column for each size."""
    items = [FULL, Contender('surface', VGA, 256), Contender('surface', (1280, 960), 256)]
    items = [item for item in items if item.name in figures['times']]
    stages = {item: figures['times'][item.name]['stages'] for item in items}
    names = list(dict.fromkeys(name for found in stages.values() for name in found))
    header = ('stage, ms', *(f'{item.size[0]} x {item.size[1]}, {item.disparities}'
                             for item in items))
    return markdown(header, [
        (name, *(f'{1e3 * stages[item].get(name, 0.0):.2f}' for item in items))
        for name in names])


def node_table(figures):
    """Return range_node at its rates as a Markdown table."""
    rows = [(name, f'{rate["rate"]:g}', f'{rate["answered"]} of {rate["sent"]}',
             rate['dropped'], f'{rate["p50_ms"]:.1f}', f'{rate["p99_ms"]:.1f}',
             f'{rate["oldest_ms"]:.0f}', f'{rate["cpu_ms"]:.1f}', f'{rate["reference_ms"]:.1f}')
            for name, rate in _node_rates(figures)]
    return markdown(('listened to', 'Hz', 'answered', 'replaced by a newer pair', 'p50, ms',
                     'p99, ms', 'oldest answer on arrival, ms', 'processor time an answer, ms',
                     'reference, ms'), rows)


def part_table(figures):
    """Return the processor time of every part per answer as a Markdown table."""
    rates = _node_rates(figures)
    parts = list(rates[0][1]['parts']) if rates else []
    return markdown(('ms an answer', *parts, 'reference'), [
        (f'{name}, {rate["rate"]:g} Hz', *(f'{rate["parts"][part]:.2f}' for part in parts),
         f'{rate["reference_ms"]:.1f}') for name, rate in rates])


def pair_table(figures):
    """Return the processor time of `ColorStereo.process` alone as a Markdown table."""
    return markdown(('', 'processor time, ms', 'time, ms', 'least time, ms'), [
        (name, *(f'{1e3 * times[key]:.1f}' for key in ('cpu', 'median', 'least')))
        for name, times in figures.get('pair', {}).items()])


def _node_rates(figures):
    """Return (what was listened to, figures) of range_node at all its rates."""
    return [(name, rate) for key, name in NODE_RUNS.items()
            for rate in figures.get(key, {}).get('rates', ())]


def start_table(figures):
    """Return the starts of range_node as a Markdown table."""
    starts = [('cold', figures['node_cold'])] if 'node_cold' in figures else []
    starts += [('warm', start) for start in figures.get('starts', ())]
    rows = [(cache, f'{start["ready"]:.1f}', f'{start["first"]:.1f}', f'{start["peak_mb"]:.0f}')
            for cache, start in starts]
    return markdown(('kernel cache', 'ready, s', 'first cloud, s', 'largest memory, MB'), rows)


def output_table(figures):
    """Return the cost of every output as a Markdown table."""
    return markdown(('output', 'median, ms', 'least, ms', 'data, kB'), [
        (f'`{name}`' if not name.startswith('input') else name, f'{1e3 * cost["median"]:.2f}',
         f'{1e3 * cost["least"]:.2f}', f'{cost["bytes"] / 1e3:.0f}' if cost['bytes'] else '')
        for name, cost in figures.get('outputs', {}).items()])


TABLES = {'machine': machine_text, 'goals': goal_table, 'times': time_table,
          'stages': stage_table, 'outputs': output_table, 'node': node_table,
          'parts': part_table, 'pair': pair_table, 'starts': start_table}

MEASURED = {'outputs': 'outputs', 'node': 'node', 'parts': 'node', 'pair': 'pair',
            'starts': 'starts'}
"""What a table needs of the figures; others need `times`."""


def with_tables(text, figures):
    """
    Return a Markdown text whose `<!-- bench: NAME -->` blocks hold the tables of a bench.

    Blocks whose figures are not measured stay as they are.

    """
    def filled(block):
        if not figures.get(MEASURED.get(block[2], 'times')):
            return block[0]
        return block[1] + TABLES[block[2]](figures) + block[3]

    return BLOCK.sub(filled, text)


def plain(figures):
    """Return all tables as text for a terminal."""
    parts = [machine_text(figures)]
    parts += [_aligned(table(figures)) for name, table in TABLES.items() if name != 'machine']
    return '\n'.join(parts)


def _aligned(table):
    """Return a Markdown table with columns of equal width and without its bars."""
    rows = [[cell.strip() for cell in line.strip('|\n').split('|')]
            for line in table.splitlines() if not line.startswith('|---')]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return '\n'.join('  '.join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
                     for row in rows).replace('`', '').replace('**', '') + '\n'
