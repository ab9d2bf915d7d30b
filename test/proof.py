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
"""The length of tests that gain from more seeds and rounds, and the figures that they give."""

from dataclasses import asdict, dataclass
from datetime import datetime, timezone
import json
import math
import os
from pathlib import Path
import platform
import subprocess

NORMAL_99 = 2.3263  # standard deviations, below which 99 of 100 normal values lie
ROOT = Path(__file__).resolve().parents[1]
OUTPUT = ROOT / 'proof_output' / 'proof.json'


@dataclass(frozen=True)
class Effort:
    """How long a test runs: short in `make test`, at full length in `make proof`."""

    full: bool

    def count(self, short, full):
        """Return a number of rounds."""
        return full if self.full else short

    def seeds(self, short, full):
        """Return so many seeds, from 0 on."""
        return range(self.count(short, full))


@dataclass(frozen=True)
class Figure:
    """A number that a test has measured."""

    name: str
    value: float
    unit: str
    goal: str
    """What the test asks of the value, for example 'at most 0.05'; empty = nothing."""
    seeds: str
    """The seeds or rounds behind it, for example '0 .. 199'."""
    test: str


def rms_bound(freedoms, others=math.inf):
    """
    Return what 99 of 100 runs of few seeds stay below.

    Parameters
    ----------
    freedoms : float
        Degrees of freedom of a root mean square: the seeds times the independent errors of each.
    others : float
        Those of the root mean square that it is divided by; infinite = a known value.

    Returns
    -------
    ratio : float
        Of the root mean square to its expectation: the root of the quantile of the chi-square, or
        of the F distribution (E. B. Wilson and M. M. Hilferty, 1931; E. Paulson, 1942).

    """
    upper, lower = 2 / (9 * freedoms), 2 / (9 * others)
    square = (1 - lower) ** 2 - NORMAL_99 ** 2 * lower
    mixed = (1 - lower) * (1 - upper)
    rest = (1 - upper) ** 2 - NORMAL_99 ** 2 * upper
    return ((mixed + math.sqrt(mixed ** 2 - square * rest)) / square) ** 1.5


class Figures:
    """Takes the figures of one test."""

    def __init__(self, test, kept):
        self._test = test
        self._kept = kept

    def __call__(self, name, value, unit, *, over, at_most=None, at_least=None):
        """
        Keep a figure, then ask of it what its goal says.

        Parameters
        ----------
        name : str
            For example 'surface: plane, median error'.
        value : float
            The figure.
        unit : str
            Of the value.
        over : range or int
            The seeds, or the number of rounds.
        at_most, at_least : float, optional
            The goal.

        """
        goal = ' and '.join(f'{word} {limit}' for word, limit in
                            (('at least', at_least), ('at most', at_most)) if limit is not None)
        seeds = f'{over[0]} .. {over[-1]}' if isinstance(over, range) else f'{over} rounds'
        self._kept.append(Figure(name, float(value), unit, goal, seeds, self._test))
        assert at_most is None or value <= at_most, f'{name} = {value} {unit}, {goal}'
        assert at_least is None or value >= at_least, f'{name} = {value} {unit}, {goal}'


def line_of(figure):
    """Return a figure as a line for people."""
    goal = f', {figure.goal}' if figure.goal else ''
    return f'{figure.name} = {figure.value:.4g} {figure.unit}'.rstrip() + (
        f'{goal} ({figure.seeds})')


def write(figures, failed, path=OUTPUT):
    """Write the figures of a run and what they were measured with as JSON."""
    from color_stereo_ros.files.atomic import write_text
    record = {'facts': facts(), 'figures': [asdict(figure) for figure in figures],
              'failed': sorted(failed)}
    write_text(path, json.dumps(record, indent=1) + '\n')


def facts():
    """Return revision, versions and machine."""
    import cv2
    import llvmlite
    import numba
    import numpy

    from color_stereo_ros import __version__
    return {
        'revision': _git('rev-parse', 'HEAD'),
        'changed_files': len(_git('status', '--porcelain').splitlines()),
        'date': datetime.now(timezone.utc).isoformat(timespec='seconds'),
        'versions': {'color_stereo_ros': __version__, 'python': platform.python_version(),
                     'numpy': numpy.__version__, 'opencv': cv2.__version__,
                     'numba': numba.__version__, 'llvmlite': llvmlite.__version__},
        'machine': platform.machine(), 'cores': os.cpu_count()}


def _git(*words):
    """Return what git says, or nothing outside a checkout."""
    said = subprocess.run(['git', *words], cwd=ROOT, capture_output=True, text=True)
    return said.stdout.strip() if said.returncode == 0 else ''
