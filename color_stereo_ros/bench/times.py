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
"""Times of `ColorStereo.process` and of OpenCV's matchers, taken in turn (A B A B ...)."""

from contextlib import ExitStack
from dataclasses import dataclass
import json
import os
from pathlib import Path
import subprocess
import sys
import time

import numpy as np

from .scene import bench_calibration, bench_pair, VGA
from ..nodes.live import LiveError

HASWELL = {'NUMBA_CPU_NAME': 'haswell', 'NUMBA_CPU_FEATURES': ','.join((
    '+64bit', '+cmov', '+cx8', '+cx16', '+fxsr', '+mmx', '+sse', '+sse2', '+sse3', '+ssse3',
    '+sse4.1', '+sse4.2', '+popcnt', '+sahf', '+movbe', '+bmi', '+bmi2', '+lzcnt', '+f16c',
    '+fma', '+avx', '+avx2', '+xsave', '+xsaveopt', '-avx512f'))}
"""The environment in which numba compiles for a processor of 2013: AVX2, no AVX-512."""


@dataclass(frozen=True)
class Contender:
    """What is measured."""

    kind: str
    """surface, third view, paper, bm or sgbm."""
    size: tuple = VGA
    """Width and height, px."""
    disparities: int = 128
    place: str = 'here'
    """The process: 'here', 'N threads' or 'AVX2'."""

    @property
    def name(self):
        """Return a name for people and files."""
        width, height = self.size
        where = '' if self.place == 'here' else f', {self.place}'
        return f'{self.kind} {width} x {height}, {self.disparities} disparities{where}'


def cores():
    """Return how many processor cores this process may use."""
    return len(os.sched_getaffinity(0))


def thread_counts():
    """Return the numbers of threads worth measuring: 1, 2, 4 ... and all cores."""
    return sorted({2 ** k for k in range(cores().bit_length()) if 2 ** k < cores()} | {cores()})


def all_contenders():
    """Return every contender of the full run."""
    wide, double = (960, 720), (1280, 960)
    found = [Contender('surface'), Contender('bm'), Contender('sgbm'), Contender('paper'),
             Contender('third view'),
             Contender('surface', VGA, 64), Contender('surface', VGA, 192),
             Contender('surface', VGA, 256), Contender('bm', VGA, 256),
             Contender('surface', (320, 240), 64), Contender('surface', wide, 192),
             Contender('surface', double, 256), Contender('bm', double, 256)]
    for count in thread_counts()[:-1]:
        place = f'{count} thread{"s" if count > 1 else ""}'
        found += [Contender(kind, place=place) for kind in ('surface', 'bm')]
    return [*found, Contender('surface', place='AVX2')]


def pair_contenders():
    """Return what takes the processor time of a pair apart: views and threads; a reference."""
    places = [f'{count} thread{"s" if count > 1 else ""}' for count in thread_counts()]
    return [*(Contender(kind, place=place) for kind in ('surface', 'third view')
              for place in places), Contender('bm', place=places[0])]


class Child:
    """
    A process that takes times (see `child`).

    Parameters
    ----------
    contenders : list of Contender
        All of one place.
    pairs : dict
        Size to a folder made by `save_pair`.
    environment : dict
        Added to ours.
    threads : int

    """

    def __init__(self, contenders, pairs, environment, threads):
        order = {'started': time.monotonic(), 'contenders': [
            {'kind': item.kind, 'folder': str(pairs[item.size]), 'disparities': item.disparities,
             'threads': threads} for item in contenders]}
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'color_stereo_ros.bench.child', json.dumps(order)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, 'NUMBA_NUM_THREADS': str(threads), **environment})
        self.first = None
        """s from the start of the process to its first result; None until `wait`."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def wait(self):
        """Wait until the kernels are warm; return s from the start to the first result."""
        self.first = self._answer()['first']
        return self.first

    def take(self, index):
        """Return a dict with the `seconds` of one call, its `cpu` time and its `stages`."""
        self._process.stdin.write(f'{index}\n')
        self._process.stdin.flush()
        return self._answer()

    def _answer(self):
        line = self._process.stdout.readline()
        if not line:
            raise LiveError(f'the process that takes times ended with status '
                            f'{self._process.wait()}')
        return json.loads(line)


def save_pair(folder, size):
    """Write the pair of a size into a new folder and return the folder."""
    folder = Path(folder) / f'{size[0]}x{size[1]}'
    folder.mkdir(parents=True)
    calibration = bench_calibration(size)
    calibration.to_yaml(folder / 'left.yaml', folder / 'right.yaml')
    np.save(folder / 'pair.npy', np.stack(bench_pair(calibration)))
    return folder


def interleaved(contenders, rounds, folder, progress=iter):
    """
    Take the times of all contenders in turn, again and again.

    Parameters
    ----------
    contenders : list of Contender
        What is timed in turn.
    rounds : int
        How often it is done.
    folder : str or Path
        Holds pairs and kernel caches.
    progress : callable
        Wraps the range of rounds, for example `tqdm.tqdm`.

    Returns
    -------
    times : dict
        Contender to {'median', 'least', 'cpu' (s), 'stages' (name to median, s)}.

    """
    pairs = {size: save_pair(folder, size) for size in {item.size for item in contenders}}
    places = {}
    for item in contenders:
        places.setdefault(item.place, []).append(item)
    answers = {item: [] for item in contenders}
    with ExitStack() as stack:
        children = {}
        for place, items in places.items():
            children[place] = stack.enter_context(
                Child(items, pairs, *_surroundings(place, folder)))
            children[place].wait()  # one at a time: what compiles does not share the cores
        last = None
        for _ in progress(range(rounds)):
            for item in contenders:
                child, index = children[item.place], places[item.place].index(item)
                if item.place != last:
                    child.take(index)  # a process that has waited finds cold caches: not counted
                answers[item].append(child.take(index))
                last = item.place
    return {item: summary(taken) for item, taken in answers.items()}


def _surroundings(place, folder):
    """Return environment and number of threads of a place."""
    if place == 'AVX2':
        return {**HASWELL, 'NUMBA_CACHE_DIR': str(Path(folder) / 'avx2_kernels')}, cores()
    return {}, cores() if place == 'here' else int(place.split()[0])


def summary(answers):
    """Return median and least of the seconds of some answers, other values' medians."""
    seconds = [answer['seconds'] for answer in answers]
    return {'median': float(np.median(seconds)), 'least': min(seconds),
            'cpu': float(np.median([answer['cpu'] for answer in answers])),
            'stages': {stage: float(np.median([answer['stages'][stage] for answer in answers]))
                       for stage in answers[0]['stages']}}


def first_results(folder):
    """Return s from process start to the first result: {'cold', 'warm'} kernel cache."""
    item = Contender('surface')
    pairs = {item.size: save_pair(Path(folder) / 'first', item.size)}
    environment = {'NUMBA_CACHE_DIR': str(Path(folder) / 'cold_kernels')}
    found = {}
    for state in ('cold', 'warm'):
        with Child([item], pairs, environment, cores()) as child:
            found[state] = child.wait()
    return found
