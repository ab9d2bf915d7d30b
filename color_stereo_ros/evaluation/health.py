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
How well the drift of knocked cameras is measured and corrected, on light of the stress test.

    python -m color_stereo_ros.evaluation.health FOLDER [--scenes NAME ...] [--knocks N]
                                                        [--sound N]

"""

import argparse
from dataclasses import dataclass

import numpy as np

from .stress.light import LightScenes, SCENES
from .stress.mounting import Mounting
from .stress.rig import StressRig
from .stress.shot import Shots
from ..core import ColorStereo, Settings
from ..core.health.drift import corrected, SHOWN

PAIRS = 6         # after a knock; the last one counts
LARGEST = 0.3     # degrees
FOCAL = 0.001     # largest relative change of the focal length
SMALL = 0.02      # degrees of pitch that must raise an alarm
SOON = 10         # pairs within which it must
FAR = 0.05        # relative depth errors count up to here: wrong matches are no drift
HEAD = ('| scene | true knock: pitch, yaw, roll, degrees; focal, % | error of the same | density: '
        'true, corrected | mean depth error: knocked, true, corrected, % |\n|---|---|---|---|---|')


@dataclass(frozen=True)
class Quality:
    """How good the ranges of one pair are."""

    density: float
    """Share of the visible pixels that have a range."""
    error: float
    """Mean relative error of their depth, %; each at most FAR."""


def quality(scene, mounting, result):
    """Return the Quality of a result."""
    visible = scene.truth(mounting).visible
    known = visible & np.isfinite(result.depth)
    error = np.abs(result.depth[known] / scene.depth[known] - 1)
    return Quality(known.sum() / visible.sum(), 100 * float(np.minimum(error, FAR).mean()))


def settings_of(scene, correct):
    """Return the settings of a scene with a choice of `health.correct`."""
    near, far = scene.depth_limits
    return Settings().updated({'range.min_depth': near, 'range.max_depth': far,
                               'health.correct': correct})


def random_knock(random):
    """Return a Mounting."""
    pitch, yaw, roll = random.uniform(-LARGEST, LARGEST, 3)
    return Mounting(pitch=pitch, yaw=yaw, roll=roll, focal=random.uniform(-FOCAL, FOCAL))


def drift_of(mounting):
    """Return the drift that a Mounting is, float64 (6,)."""
    return np.array([mounting.pitch, mounting.yaw, mounting.roll,
                     100 * mounting.focal, 0, 0]) / SHOWN


def measured(stereo, shots, mounting, first=1):
    """Yield the results of pairs from a rig."""
    for number in range(first, first + PAIRS):
        yield stereo.process(*shots.pair(StressRig(mounting=mounting), number))


def knocked(scene, mounting):
    """Return a line of the table about one knock."""
    shots, true = Shots(scene), drift_of(mounting)
    fixed = corrected(scene.calibration, true, baseline=False)
    *_, best = measured(ColorStereo(fixed, settings_of(scene, 'off')), shots, mounting)
    first, *_, last = measured(ColorStereo(scene.calibration, settings_of(scene, 'apply')),
                               shots, mounting)
    before, ideal, after = (quality(scene, mounting, each) for each in (first, best, last))
    numbers = [' '.join(f'{value:.4f}' for value in (each * SHOWN)[:4])
               for each in (true, last.health.drift - true)]
    return (f'| {scene.name} | {numbers[0]} | {numbers[1]} | {ideal.density:.4f}, '
            f'{after.density:.4f} | {before.error:.3f}, {ideal.error:.3f}, {after.error:.3f} |')


def alarms(scene, pairs):
    """Return false alarms among sound pairs, and pairs until a small knock is told."""
    stereo, shots = ColorStereo(scene.calibration, settings_of(scene, 'off')), Shots(scene)
    false = sum(stereo.process(*shots.pair(StressRig(), number)).health.drifted
                for number in range(1, pairs + 1))
    small = StressRig(mounting=Mounting(pitch=SMALL))
    told = (number for number in range(1, SOON + 1)
            if stereo.process(*shots.pair(small, pairs + number)).health.drifted)
    return false, next(told, None)


def main(words=None):
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0].strip())
    parser.add_argument('folder', help='where light is kept; what is missing is rendered')
    parser.add_argument('--scenes', nargs='+', choices=SCENES,
                        default=['barrel', 'unequal', 'effector_nut', 'casting'])
    parser.add_argument('--knocks', type=int, default=3, help='of each scene')
    parser.add_argument('--sound', type=int, default=20, help='pairs without a knock')
    args = parser.parse_args(words)
    random = np.random.default_rng(3)
    print(HEAD, flush=True)
    scenes = LightScenes(args.folder)
    for name in args.scenes:
        scene = scenes.scene(name)
        for _ in range(args.knocks):
            print(knocked(scene, random_knock(random)), flush=True)
        if args.sound:
            false, told = alarms(scene, args.sound)
            print(f'{name}: {false} false alarms in {args.sound} pairs; a pitch of {SMALL} '
                  f'degrees was told in pair {told}', flush=True)


if __name__ == '__main__':
    main()
