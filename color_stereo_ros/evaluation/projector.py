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
How well the projector is found: `python -m color_stereo_ros.evaluation.projector`.

Path-traced scenes of the stress test under a choice of its disturbances. The truth is the
projector of the simulated rig.

"""

import argparse
from dataclasses import dataclass
import sys
from time import perf_counter

import numpy as np

from .stress.disturbances import DISTURBANCES
from .stress.light import LightScenes, MAIN, SCENES
from .stress.shot import Shots
from ..core import ColorStereo, make_pattern, PatternSettings, Settings
from ..core.projector import Measured, ProjectorFinder, ProjectorModel

CASES = (('none', 1), ('gamma_both', 2.2), ('projector_gamma', 2.2), ('blur_both', 2),
         ('blur_both', 3), ('jpeg', 60), ('exposure', 0.2), ('crosstalk_both', 0.15),
         ('crosstalk_both', 0.3), ('rows', 1), ('rows', 20), ('print', 0.9), ('defocus', 3),
         ('ambient', 100))
"""Names and levels of disturbances."""
DEPTHS = (0.8, 1.0, 1.2)
"""Shares of the true depth at which predictions are compared."""


@dataclass(frozen=True)
class Record:
    """What was found of one pair."""

    scene: str
    case: str
    reason: str
    matches: int
    seconds: float
    residual: float = float('nan')
    """Median, px of the pattern."""
    center: float = float('nan')
    """Distance of the found center from the true one, mm."""
    spread: float = float('nan')
    """The same as its standard deviation says it, mm."""
    predicted: tuple = ()
    """Median error of predicted places at the DEPTHS, px of the pattern."""

    def line(self):
        """Return the record as a row of a table."""
        places = ' / '.join(f'{each:.2f}' for each in self.predicted)
        return (f'| {self.scene} | {self.case} | {self.reason.lower()} | {self.matches} '
                f'| {self.residual:.2f} | {self.center:.2f} | {self.spread:.2f} | {places} '
                f'| {self.seconds:.2f} |')


HEAD = ('| scene | disturbance | outcome | matches | residual, px | center off by, mm '
        '| standard deviation, mm | predictions off by, px, at .8 / 1 / 1.2 of the depth | s |\n'
        '|---|---|---|---|---|---|---|---|---|')


def true_projector(name, size):
    """
    Return the projector of a scene of the stress test as a model.

    Parameters
    ----------
    name : str
        A key of `stress.light.SCENES`.
    size : (int, int)
        Width and height of the pattern, px.

    Returns
    -------
    model : ProjectorModel
        Its covariance is 0.

    """
    from .. import sim
    source, rig = SCENES[name]
    return projector_of(sim.load_scene(source, rig=rig).rig, size)


def projector_of(rig, size):
    """Return the projector of a simulated rig as a model; see `true_projector`."""
    shown = rig.projector
    width, height = size
    from_left = rig.left.pose.rotation @ rig.calibration.left.R.T
    focal = shown.focal_length(width)
    matrix = [[focal, 0, (width - 1) / 2], [0, focal, (0.5 + shown.offset) * height - 0.5],
              [0, 0, 1]]
    return ProjectorModel(matrix, 0.0, shown.pose.rotation.T @ from_left,
                          shown.pose.to_child(rig.left.pose.position), size, np.zeros((12, 12)))


def record(scene, case, finding, true, measured, depth, seconds):
    """Return the Record of a Finding; depth: the true one, (H, W), m."""
    name = case[0] if len(DISTURBANCES[case[0]].levels) == 1 else f'{case[0]} {case[1]:g}'
    if finding.model is None:
        return Record(scene, name, finding.reason.name, finding.matches, seconds)
    model, step = finding.model, 16
    row, column = np.indices(depth.shape)
    pixels = np.column_stack([column[::step, ::step].ravel(), row[::step, ::step].ravel()])
    points = measured.rays(pixels) * depth[::step, ::step].reshape(-1, 1)
    apart = [np.column_stack(model.project(share * points))
             - np.column_stack(true.project(share * points)) for share in DEPTHS]
    return Record(
        scene, name, finding.reason.name, finding.matches, seconds, model.residual,
        1e3 * float(np.linalg.norm(model.center - true.center)),
        1e3 * float(np.linalg.norm(model.center_std)),
        tuple(float(np.nanmedian(np.hypot(*each.T))) for each in apart))


def evaluate(scene, cases):
    """Yield the Record of every case of a LightScene."""
    pattern = make_pattern(PatternSettings())
    size = pattern.shape[1], pattern.shape[0]
    shots, true = Shots(scene), true_projector(scene.name, size)
    near, far = scene.depth_limits
    stereo = ColorStereo(scene.calibration, Settings().updated(
        {'range.min_depth': near, 'range.max_depth': far}))
    geometry = scene.calibration.geometry
    finder = ProjectorFinder(pattern, (geometry.width, geometry.height))
    for case in cases:
        left, right = shots.pair(DISTURBANCES[case[0]].rig(case[1]))
        stereo.reset()
        measured = Measured.of(stereo.process(left, right))
        start = perf_counter()
        finding = finder.find(measured)
        yield record(scene.name, case, finding, true, measured, scene.depth,
                     perf_counter() - start)


def main(argv=None):
    """Print the table; return the exit status."""
    parser = argparse.ArgumentParser(prog='python -m color_stereo_ros.evaluation.projector',
                                     description=__doc__.split('\n\n')[1], allow_abbrev=False)
    parser.add_argument('scenes', nargs='*', default=MAIN, metavar='SCENE',
                        help='names of the stress test (default: %(default)s)')
    parser.add_argument('--renders', default='render_output/stress', metavar='FOLDER',
                        help='keeps the light of the scenes (default %(default)s)')
    parser.add_argument('--only', metavar='NAMES', help='disturbances, commas between them')
    args = parser.parse_args(argv)
    cases = [case for case in CASES if not args.only or case[0] in args.only.split(',')]
    print(HEAD)
    for name in args.scenes:
        for each in evaluate(LightScenes(args.renders).scene(name), cases):
            print(each.line(), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
