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
What the third view costs: pairs with and without it, in turn, in one process.

`python -m color_stereo_ros.evaluation.third_view --light FOLDER --time` prints for each scene the
medians of the time of the processor and of the clock, and their ratio. With NUMBA_NUM_THREADS=1
the time of the processor hardly depends on what else runs.

"""

from collections import defaultdict
from statistics import mean, median
from time import perf_counter, process_time

from .stress.shot import Shots
from ..core import ColorStereo, Settings

ROUNDS = 25
WARM_UP = 3


def timed(measure):
    """Return the result of a call, and the time of processor and clock that it took, ms."""
    processor, clock = process_time(), perf_counter()
    result = measure()
    return result, (1e3 * (process_time() - processor), 1e3 * (perf_counter() - clock))


def interleaved(scene, rig, rounds=ROUNDS):
    """
    Measure one pair of a scene with the third view and without, in turn.

    Parameters
    ----------
    scene : color_stereo_ros.evaluation.stress.light.LightScene
        A scene whose light is stored.
    rig : color_stereo_ros.evaluation.stress.disturbances.Rig
        The cameras and their settings.
    rounds : int
        How often it is done.

    Returns
    -------
    times : dict
        'on', 'off': lists of (processor, clock), ms; 'first': that of the pair that finds the
        projector.
    stages : dict
        Name of a stage to the mean of its times with the third view, ms.

    """
    pair = Shots(scene, 1).pair(rig, 1)
    near, far = scene.depth_limits
    stereos = {value: ColorStereo(scene.calibration, Settings().updated({
        'range.min_depth': near, 'range.max_depth': far,
        'matching.third_view': 'automatic' if value == 'on' else 'off', **rig.settings}))
        for value in ('on', 'off')}
    times, stages = defaultdict(list), defaultdict(list)
    times['first'] = [timed(lambda: stereos['on'].process(*pair))[1]]
    for turn in range(-WARM_UP, rounds):
        for name, stereo in stereos.items():
            result, told = timed(lambda: stereo.process(*pair))
            if turn >= 0:
                times[name].append(told)
                if name == 'on':
                    for stage, seconds in result.seconds.items():
                        stages[stage].append(1e3 * seconds)
    return times, {stage: mean(each) for stage, each in stages.items()}


def table(light, scenes, rig):
    """Print a line and the stages of each scene; light: LightScenes, rig: of a disturbance."""
    print(f'{"ms, medians":16}' + ''.join(f'{name:>12}' for name in (
        'cpu on', 'cpu off', 'ratio', 'of means', 'clock on', 'clock off', 'ratio', 'first cpu')))
    for name in scenes:
        times, stages = interleaved(light.scene(name), rig)
        (on, on_clock), (off, off_clock) = (
            [median(each) for each in zip(*times[which])] for which in ('on', 'off'))
        means = [mean(cpu for cpu, _ in times[which]) for which in ('on', 'off')]
        print(f'{name:16}' + ''.join(f'{value:12.2f}' for value in (
            on, off, on / off, means[0] / means[1], on_clock, off_clock, on_clock / off_clock,
            times['first'][0][0])))
        print('  ' + ', '.join(f'{stage} {value:.1f}' for stage, value in stages.items()),
              flush=True)
