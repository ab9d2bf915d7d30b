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

Prints JSON: processor time per pair of convert and of `ColorStereo.process` alone, pairs per
second with one and two processes, and what it matters that a task does not carry on from the one
before. Start it with NUMBA_NUM_THREADS=1: then `process` has one thread, as in each process.

"""

import json
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time

import numpy as np

from .scene import bench_calibration, bench_pair, bench_settings
from ..core import ColorStereo
from ..recordings.tasks import SETTLING, WARM_UP
from ..recordings.writing import write_recording

SIZE = 512, 512
DISPARITIES = 64
PERIOD = 33_333_333  # ns
DIFFERENT = 8  # pairs of noise of their own, played in turn
WORKERS = 1, 2
LONG = 24  # pairs over which what is carried is compared


def measured(pairs):
    """
    Return all figures.

    Parameters
    ----------
    pairs : int
        Pairs of the short recording; the long one has three times as many. What starting costs
        is the same for both, so that their difference is what pairs cost.

    Returns
    -------
    figures : dict

    """
    calibration = bench_calibration(SIZE)
    images = [bench_pair(calibration, seed) for seed in range(DIFFERENT)]
    settings = bench_settings(calibration, DISPARITIES, third_view='automatic')
    figures = {'process_cpu_ms': process_cost(calibration, settings, images),
               'carried': carried(calibration, settings, images)}
    with tempfile.TemporaryDirectory(prefix='color_stereo_conversion_') as folder:
        options = [f'--range.{name}={getattr(settings.range, name)!r}'
                   for name in ('min_depth', 'max_depth')]
        for count in (pairs, 3 * pairs):
            write(Path(folder) / f'{count}', images, calibration, count)
        for workers in WORKERS:
            short, long = (converted(Path(folder), count, [*options, f'--workers={workers}'])
                           for count in (pairs, 3 * pairs))
            wall, cpu = (last - first for first, last in zip(short, long))
            figures[f'workers_{workers}'] = {'cpu_ms': cpu / (2 * pairs) * 1e3,
                                             'pairs_per_s': 2 * pairs / wall}
    return figures


def write(path, images, calibration, count):
    """Write a recording of some pairs in turn."""
    with write_recording(path) as writer:
        for index in range(count):
            writer.write_pair((1 + index) * PERIOD, *images[index % len(images)], calibration)


def converted(folder, count, options):
    """Return wall and processor time of a conversion, s; its processes included."""
    before, start = _children(), time.monotonic()
    subprocess.run([sys.executable, '-m', 'color_stereo_ros.cli.main', 'convert',
                    str(folder / str(count)), str(folder / 'result'), '--overwrite', *options],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - start, _children() - before


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


if __name__ == '__main__':
    print(json.dumps(measured(int(sys.argv[1]) if sys.argv[1:] else 128), indent=1))
