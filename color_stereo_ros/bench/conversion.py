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
What `color_stereo convert` costs: `python -m color_stereo_ros.bench.conversion [PAIRS]`.

Prints JSON: processor time per pair of convert and of its steps, pairs per second with one and two
processes, and what it matters that a task does not carry on from the one before. Start it with
NUMBA_NUM_THREADS=1: then `process` has one thread, as in each process.

`--against COMMAND` measures another revision in turn, too: COMMAND is the `color_stereo` of an
environment in which it is installed. What both share of a busy machine is the same then.

"""

import argparse
from contextlib import contextmanager
import json
import os
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time

import numpy as np

from .scene import bench_calibration, bench_pair, bench_settings
from ..core import ColorStereo
from ..core.settings import flat, updated
from ..parameters.groups import RangeNodeSettings
from ..recordings.mcap_writing import DEFAULT_COMPRESSION
from ..recordings.measuring import make_stereo, OutputWriter, PairSensor
from ..recordings.memory import keep_memory
from ..recordings.reading import Recording
from ..recordings.tasks import plan_of, read_pairs, SETTLING, WARM_UP
from ..recordings.writing import open_writer, write_recording

SIZE = 512, 512
DISPARITIES = 64
PERIOD = 33_333_333  # ns
DIFFERENT = 8  # pairs of noise of their own, played in turn
CASES = {
    'workers_1': ('--workers=1',),
    'workers_2': ('--workers=2',),
    'workers_2_two_views': ('--workers=2', '--matching.third_view=off'),
}
"""Options of `convert` by the name of a figure."""
COMMAND = sys.executable, '-m', 'color_stereo_ros.cli.main'
OTHER = 'other_revision'
THREADS = 'NUMBA_NUM_THREADS'
"""Holds for this process alone: commands take as many threads as they do by themselves."""
LONG = 24  # pairs over which what is carried is compared


def measured(pairs, against=None):
    """
    Return all figures.

    Parameters
    ----------
    pairs : int
        Pairs of the short recording; the long one has three times as many. What starting costs
        is the same for both, so that their difference is what pairs cost.
    against : str, optional
        The command `color_stereo` of another revision, which is measured, too.

    Returns
    -------
    figures : dict

    """
    calibration = bench_calibration(SIZE)
    images = [bench_pair(calibration, seed) for seed in range(DIFFERENT)]
    settings = bench_settings(calibration, DISPARITIES, third_view='automatic')
    figures = {'process_cpu_ms': process_cost(calibration, settings, images),
               'carried': carried(calibration, settings, images)}
    with tempfile.TemporaryDirectory(prefix='color_stereo_conversion_') as name:
        folder = Path(name)
        options = [f'--range.{name}={getattr(settings.range, name)!r}'
                   for name in ('min_depth', 'max_depth')]
        for count in (pairs, 3 * pairs):
            write(folder / f'{count}', images, calibration, count)
        figures['steps_cpu_ms'] = steps(folder, pairs, settings)
        cases = {case: (COMMAND, more) for case, more in CASES.items()}
        if against:
            cases[OTHER] = [against], ()
        for command, more in cases.values():  # whoever compiles kernels does it now
            converted(folder, pairs, command, [*options, *more])
        used = {(case, count): converted(folder, count, command, [*options, *more])
                for count in (pairs, 3 * pairs) for case, (command, more) in cases.items()}
    for case in cases:
        wall, cpu = (last - first for first, last in zip(used[case, pairs],
                                                         used[case, 3 * pairs]))
        figures[case] = {'cpu_ms': cpu / (2 * pairs) * 1e3, 'pairs_per_s': 2 * pairs / wall}
    if against:
        figures['times_the_other'] = {case: {
            'pairs_per_s': figures[case]['pairs_per_s'] / figures[OTHER]['pairs_per_s'],
            'pairs_per_cpu_s': figures[OTHER]['cpu_ms'] / figures[case]['cpu_ms']}
            for case in CASES}
    return figures


def write(path, images, calibration, count):
    """Write a recording of some pairs in turn."""
    with write_recording(path) as writer:
        for index in range(count):
            writer.write_pair((1 + index) * PERIOD, *images[index % len(images)], calibration)


def converted(folder, count, command, options):
    """Return wall and processor time of a conversion, s; its processes included."""
    environment = {name: value for name, value in os.environ.items() if name != THREADS}
    before, start = _children(), time.monotonic()
    subprocess.run([*command, 'convert', str(folder / str(count)), str(folder / 'result'),
                    '--overwrite', *options], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL, cwd=folder, env=environment)
    return time.monotonic() - start, _children() - before


def steps(folder, count, settings):
    """
    Return the processor time of the steps of a conversion in this process.

    Returns
    -------
    milliseconds : dict
        A pair: pairing (the pass over all messages), reading (of the messages of a task),
        measuring (with the images and what is odd about them), contents (of the messages),
        writing (serialized, compressed, into the file).

    """
    settings = updated(RangeNodeSettings(), flat(settings))
    keep_memory()
    used = dict.fromkeys(('pairing', 'reading', 'measuring', 'contents', 'writing'), 0.0)
    with Recording(folder / str(count)) as recording, \
            open_writer(folder / 'steps', DEFAULT_COMPRESSION) as writer:
        topics = recording.stereo_topics()
        with timed(used, 'pairing'):
            plan = plan_of(recording, topics, settings, print)
        calibration, = plan.calibrations
        stereo, sensor = make_stereo(calibration, settings), PairSensor(topics, settings, print)
        outputs = OutputWriter(Timed(writer, used), settings, None, '/')
        pairs = read_pairs(recording, topics, plan.rows, calibration)
        for index in range(count):
            with timed(used, 'reading'):
                pair = next(pairs)
            with timed(used, 'measuring'):
                result = sensor.measure(stereo, pair)
            with timed(used, 'contents'):
                outputs.write(result, pair)
            if index < DIFFERENT:  # the first pairs load kernels and find rows and projector
                used.update(dict.fromkeys(('reading', 'measuring', 'contents', 'writing'), 0.0))
    used['contents'] -= used['writing']
    counts = dict.fromkeys(used, count - DIFFERENT) | {'pairing': count}
    return {name: seconds / counts[name] * 1e3 for name, seconds in used.items()}


@contextmanager
def timed(used, name):
    """Add the processor time of a block to an entry of a dict, s."""
    start = time.process_time()
    yield
    used[name] += time.process_time() - start


class Timed:
    """
    A RecordingWriter whose processor time is counted.

    Parameters
    ----------
    writer : RecordingWriter
    used : dict
        Its entry `writing` takes the time, s.

    """

    def __init__(self, writer, used):
        self._writer, self._used = writer, used

    def write_content(self, *arguments, **options):
        """Append a message, see RecordingWriter."""
        with timed(self._used, 'writing'):
            self._writer.write_content(*arguments, **options)


def _children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def process_cost(calibration, settings, images):
    """Return the processor time of `process` alone, ms a pair."""
    stereo = ColorStereo(calibration, settings)
    for pair in images:
        stereo.process(*pair)
    start = time.process_time()
    for pair in images * 2:
        stereo.process(*pair)
    return (time.process_time() - start) / (2 * len(images)) * 1e3


def carried(calibration, settings, images):
    """
    Compare the pairs after a task's warm-up with those of a run that has carried on throughout.

    Returns
    -------
    figures : dict
        Share of the ranges that are known in one result only; median and largest difference of
        the depth in standard deviations.

    """
    stereo = ColorStereo(calibration, settings)
    results, settled = [], None
    for index in range(LONG + SETTLING):
        results.append(stereo.process(*images[index % len(images)]))
        if index + 1 == SETTLING:
            settled = stereo.alignment, stereo.projector, stereo.health
    stereo.adopt(settled[0])
    stereo.adopt_projector(settled[1])
    stereo.adopt_health(settled[2])
    for index in range(len(results) - 1 - WARM_UP, len(results)):
        again = stereo.process(*images[index % len(images)])
    last = results[-1]
    known = np.isfinite(last.depth) & np.isfinite(again.depth)
    apart = np.abs(last.depth - again.depth)[known] / last.depth_std[known]
    other = np.isfinite(last.depth) != np.isfinite(again.depth)
    return {'known_in_one': float(np.mean(other)), 'median_std': float(np.median(apart)),
            'p99_std': float(np.percentile(apart, 99)), 'largest_std': float(apart.max())}


def main():
    """Print the figures that the command line asks for."""
    parser = argparse.ArgumentParser(description='What `color_stereo convert` costs.')
    parser.add_argument('pairs', nargs='?', type=int, default=128, help='pairs of the short '
                        'recording (default 128; fewer are no work for two processes)')
    parser.add_argument('--against', metavar='COMMAND', help='`color_stereo` of another revision')
    args = parser.parse_args()
    print(json.dumps(measured(args.pairs, args.against), indent=1))


if __name__ == '__main__':
    main()
