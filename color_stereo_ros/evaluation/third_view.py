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
What the projector as a third view adds, on scenes with truth.

`python -m color_stereo_ros.evaluation.third_view --light FOLDER` prints a table: two views, left
camera and projector alone, all three. The projector is found from the pair, or is the exact one
of the simulator (`--true`).

"""

import argparse
import sys
from time import process_time

import numpy as np

from . import third_time
from .metrics import RIGHT, words
from .stress.disturbances import DISTURBANCES
from .stress.light import LightScenes, MAIN, SCENES
from .stress.shot import Shots
from ..core import ColorStereo, PatternSettings, Settings
from ..core.projector.model import COUNT, ProjectorModel

COLUMNS = (('cover', '{:.4f}', 1), ('density', '{:.4f}', 1), ('wrong', '{:.2f} %', 100),
           ('false_wrong', '{:.2f} %', 100), ('hi', '{:.2f} %', 100), ('median_px', '{:.4f}', 1),
           ('z68', '{:.2f}', 1), ('alone_percent', '{:.4f} %', 1), ('alone_z68', '{:.2f}', 1),
           ('milliseconds', '{:.0f}', 1))
REPEATS = 3


def true_projector(rig, shape=None):
    """
    Return the exact ProjectorModel of a simulated rig.

    Parameters
    ----------
    rig : color_stereo_ros.sim.rig.Rig
        The simulated cameras and projector.
    shape : (int, int), optional
        Height and width of the pattern, px; default: that of the default pattern.

    Returns
    -------
    model : ProjectorModel
        Its covariance is 0.

    """
    default = PatternSettings()
    height, width = shape or (default.height, default.width)
    projector, camera = rig.projector, rig.left
    focal = projector.focal_length(width)
    camera_matrix = np.array([[focal, 0, width / 2 - 0.5],
                              [0, focal, (0.5 + projector.offset) * height - 0.5], [0, 0, 1]])
    # X_rig = R_left R_rect^T X + p_left;  Y = R_p^T (X_rig - p_p)
    to_rig = camera.pose.rotation @ rig.calibration.left.R.T
    rotation = projector.pose.rotation.T @ to_rig
    translation = projector.pose.to_child(camera.pose.position)
    return ProjectorModel(camera_matrix, 0.0, rotation, translation, (width, height),
                          np.zeros((COUNT, COUNT)))


def figures(result, truth):
    """
    Return the words of `metrics.words`, and those of what the right camera does not see.

    Returns
    -------
    figures : dict
        Also `alone_percent` (median error of Z, %) and `alone_z68`, where only left camera and
        projector see.

    """
    found = words(result, truth)
    alone = truth.lit & ~truth.visible & np.isfinite(result.disparity)
    error = np.abs(result.disparity - truth.disparity)[alone]
    depth = 100 * np.abs(result.depth / truth.depth - 1)[alone]
    told = alone.any()
    return {**found, 'alone_percent': float(np.median(depth)) if told else None,
            'alone_z68': float(np.percentile(error / result.disparity_std[alone], 68))
            if told else None,
            'alone_right': float(np.mean(error <= RIGHT)) if told else None}


def compared(scene, case, exact, seed=1):
    """
    Measure one pair of a scene with two views, with the third alone, and with three.

    Parameters
    ----------
    scene : color_stereo_ros.evaluation.stress.light.LightScene
        A scene whose light is stored.
    case : (str, float)
        Disturbance and level.
    exact : bool
        The projector of the simulator; False: the one that is found from the pair.
    seed : int
        Of the random numbers.

    Returns
    -------
    rows : dict
        Name to figures, and `milliseconds` of the processor.
    sentence : str
        What was found.

    """
    name, level = case
    rig = DISTURBANCES[name].rig(level)
    shots = Shots(scene, seed)
    pair, truth = shots.pair(rig, 1), shots.truth(rig.mounting)
    near, far = scene.depth_limits
    settings = Settings().updated({'range.min_depth': near, 'range.max_depth': far,
                                   'matching.third_view': 'automatic', **rig.settings})
    stereo = ColorStereo(scene.calibration, settings)
    stereo.use_projector(None)
    rows = {'two views': timed(lambda: stereo.process(*pair), truth)}
    if exact:
        stereo.use_projector(exact_projector(scene))
    else:
        stereo.reset()  # the first pair finds it
    track = stereo.process(*pair).projector
    if not track.usable:
        return rows, track.sentence()
    rows['three views'] = timed(lambda: stereo.process(*pair), truth)
    rows['third alone'] = timed(lambda: stereo.process_left(pair[0]), truth)
    return rows, track.sentence()


def exact_projector(scene):
    """Return the ProjectorModel of the simulator for a scene."""
    from ..sim import load_scene
    source, rig = SCENES[scene.name]
    return true_projector(load_scene(source, rig=rig).rig)


def timed(measure, truth):
    """Return the figures of a measurement, and the time of the processor it took."""
    result, times = measure(), []
    for _ in range(REPEATS):
        start = process_time()
        result = measure()
        times.append(process_time() - start)
    return {**figures(result, truth), 'milliseconds': 1e3 * min(times)}


def line(title, row):
    """Return one line of the table."""
    told = (form.format(factor * row[name]) if row.get(name) is not None else '-'
            for name, form, factor in COLUMNS)
    return f'{title:28}' + ''.join(f'{each:>14}' for each in told)


def means(rows):
    """Return the means of the figures of some rows."""
    found = {}
    for name, _, _ in COLUMNS:
        values = [row[name] for row in rows if row.get(name) is not None]
        found[name] = float(np.mean(values)) if values else None
    return found


def main(argv=None):
    """Print the table; return the exit status."""
    parser = argparse.ArgumentParser(prog='python -m color_stereo_ros.evaluation.third_view',
                                     description=__doc__.split('\n\n')[0].strip())
    parser.add_argument('scenes', nargs='*', default=MAIN, metavar='SCENE',
                        help=f'default: {" ".join(MAIN)}')
    parser.add_argument('--light', default='render_output/light', metavar='FOLDER',
                        help='keeps the rendered light (default %(default)s)')
    parser.add_argument('--disturbance', default='none=1', metavar='NAME=LEVEL',
                        help='of color_stereo evaluate --stress (default %(default)s)')
    parser.add_argument('--true', action='store_true', help='the exact projector of the simulator')
    parser.add_argument('--time', action='store_true',
                        help='only the time of pairs with and without the third view, in turn')
    args = parser.parse_args(argv)
    name, _, level = args.disturbance.partition('=')
    light, everything = LightScenes(args.light), {}
    if args.time:
        third_time.table(light, args.scenes, DISTURBANCES[name].rig(float(level or 1)))
        return 0
    print(f'{"":28}' + ''.join(f'{name:>14}' for name, _, _ in COLUMNS))
    for scene in args.scenes:
        rows, sentence = compared(light.scene(scene), (name, float(level or 1)), args.true)
        print(f'{scene}: {sentence}')
        for title, row in rows.items():
            print(line(f'  {title}', row), flush=True)
            everything.setdefault(title, []).append(row)
    print('mean')
    for title, rows in everything.items():
        print(line(f'  {title}', means(rows)))
    return 0


if __name__ == '__main__':
    sys.exit(main())
