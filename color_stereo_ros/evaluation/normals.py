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
Angles between measured and true normals, on rendered planes and spheres.

`python -m color_stereo_ros.evaluation.normals` renders planes of several tilts and spheres of
several sizes and distances with both rigs of the simulator. For each it prints the median and the
90th percentile of the angle, and the share of the ranges that have a normal.

"""

import argparse
import sys

import cv2
import numpy as np

from .renders import default_pattern, Renders
from ..core import ColorStereo, Settings
from ..core.triangulation import points_from_depth

RIGS = {'paper': 0.38, 'effector': 0.5}
"""Rigs and the distance at which their surfaces stand, m."""
TILTS = (0, 30, 0), (40, 0, 0), (15, 50, 0), (0, 60, 0)
"""Degrees about x, y, z; a plane that faces the rig comes first."""
SPHERES = (0.03, 0.0), (0.05, 0.0), (0.08, 0.0), (0.05, 0.1)
"""Radius, and by how much the sphere stands behind the distance of its rig, m."""
CARD = 0.1
"""Distance between a sphere and the card behind it, m."""
TOUCHES = 1e-4
"""A point this close to a surface lies on it, m."""
RIM = 6
"""Pixels of a surface so close to its outline count as its rim, px."""


def scenes():
    """
    Return the descriptions of all scenes.

    Returns
    -------
    scenes : list of dict
        As `sim.load_scene` takes them. The first object is the one that is judged.

    """
    found = []
    for rig, distance in RIGS.items():
        for tilt in ((0, 0, 0), *TILTS):
            found.append(_scene(f'{rig} plane {" ".join(map(str, tilt))}', rig, {
                'shape': 'plane', 'position': [0, 0, distance], 'rotation': list(tilt),
                'size': [0.3, 0.3]}))
        for radius, behind in SPHERES:
            center = distance + behind
            found.append(_scene(f'{rig} sphere {1000 * radius:.0f} mm at {center:.2f} m', rig, {
                'shape': 'sphere', 'position': [0, 0, center], 'radius': radius}, {
                'shape': 'plane', 'position': [0, 0, min(center + CARD, 0.6)],
                'size': [1.5, 1.5]}))
    return found


def _scene(name, rig, *objects):
    # a plane alone throws no light on anything
    return {'name': name, 'rig': rig, 'ambient': 0.004, 'indirect': len(objects) > 1,
            'objects': list(objects)}


def true_normals(scene, points):
    """
    Return the normals of the first object of a scene at points on it.

    Parameters
    ----------
    scene : color_stereo_ros.sim.Scene
        Its first object is a plane or a sphere.
    points : numpy.ndarray, shape (H, W, 3)
        m, rectified left camera, NaN = unknown.

    Returns
    -------
    normals : numpy.ndarray, float64, shape (H, W, 3)
        Rectified left camera, towards the camera's side; NaN where a point lies elsewhere.

    """
    camera, thing = scene.rig.left, scene.objects[0]
    turn = scene.rig.calibration.left.R @ camera.pose.rotation.T
    away = points - turn @ (thing.pose.position - camera.pose.position)
    if thing.shape == 'sphere':
        radius = thing.form['radius']
        normals, distance = away / radius, np.linalg.norm(away, axis=-1) - radius
        on = np.abs(distance) < TOUCHES
    else:
        local = away @ (turn @ thing.pose.rotation)
        normals = np.broadcast_to(-(turn @ thing.pose.rotation)[:, 2], points.shape)
        half = np.asarray(thing.form['size']) / 2
        on = (np.abs(local[..., 2]) < TOUCHES) & (np.abs(local[..., :2]) <= half).all(axis=-1)
    return np.where(on[..., None], normals, np.nan)


def angles(result, truth):
    """
    Return the angles between measured and true normals.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    truth : numpy.ndarray, shape (H, W, 3)
        True normals, NaN = not judged.

    Returns
    -------
    angles : numpy.ndarray, float32, shape (H, W)
        Degrees, NaN where one of the two is unknown.

    """
    found = result.normals()
    across = np.linalg.norm(np.cross(found, truth), axis=-1)
    return np.degrees(np.arctan2(across, (found * truth).sum(axis=-1))).astype(np.float32)


def figures(result, truth):
    """
    Return the figures of one result.

    Returns
    -------
    figures : dict
        `median`, `p90`, `rim` (median near the outline), degrees; `share`: normals per range of
        the surface, `pixels`: the ranges of the surface.

    """
    on = np.isfinite(truth[..., 0])
    inner = cv2.erode(on.astype(np.uint8), np.ones((2 * RIM + 1,) * 2, np.uint8),
                      borderValue=0).astype(bool)
    angle, ranges = angles(result, truth), np.isfinite(result.depth) & on
    known = np.isfinite(angle)
    return {'median': float(np.median(angle[known])),
            'p90': float(np.percentile(angle[known], 90)),
            'rim': float(np.median(angle[known & ~inner])),
            'share': float(known[ranges].mean()), 'pixels': int(ranges.sum())}


def measured(renders, description, values):
    """Return the RangeResult of a rendered scene, and its true normals."""
    from ..sim import load_scene
    pair = renders.pair(description, default_pattern())
    stereo = ColorStereo(pair.calibration, Settings().updated({**pair.settings, **values}))
    points = points_from_depth(pair.truth.depth.astype(np.float64), pair.calibration.geometry)
    truth = true_normals(load_scene(description), points)
    return stereo.process(pair.left, pair.right), truth


def line(name, row):
    """Return one line of the table."""
    return (f'{name:32}{row["median"]:9.3f}{row["p90"]:9.3f}{row["rim"]:9.3f}'
            f'{row["share"]:9.4f}{row["pixels"]:9d}')


def main(argv=None):
    """Print the table; return the exit status."""
    parser = argparse.ArgumentParser(prog='python -m color_stereo_ros.evaluation.normals',
                                     description=__doc__.split('\n\n')[0].strip())
    parser.add_argument('--renders', default='render_output/normals', metavar='FOLDER',
                        help='keeps the rendered pairs (default %(default)s)')
    parser.add_argument('--only', default='', metavar='TEXT',
                        help='scenes whose name holds this text')
    parser.add_argument('--method', default='surface', help='default %(default)s')
    args = parser.parse_args(argv)
    renders, rows = Renders(args.renders), {}
    print(f'{"degrees":32}{"median":>9}{"p90":>9}{"rim":>9}{"share":>9}{"pixels":>9}')
    for description in scenes():
        name = description['name']
        if args.only in name:
            rows[name] = figures(*measured(renders, description, {'matching.method': args.method}))
            print(line(name, rows[name]), flush=True)
    for kind in ('plane', 'sphere'):
        own = [row for name, row in rows.items() if kind in name]
        if own:
            mean = {key: np.mean([row[key] for row in own]) for key in own[0]}
            print(line(f'mean of {kind}s', {**mean, 'pixels': int(mean['pixels'])}))
    return 0


if __name__ == '__main__':
    sys.exit(main())
