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
"""The command that judges normals: what it takes as true, and the figures that it makes of it."""

from types import SimpleNamespace

from color_stereo_ros.evaluation.normals import angles, figures, line, scenes, true_normals
from color_stereo_ros.sim import load_scene
from color_stereo_ros.sim.geometry import rotation_from_degrees

import numpy as np
import pytest


def scene(name):
    """Return the Scene of a name."""
    return load_scene(next(each for each in scenes() if each['name'] == name))


def directions(shape=(20, 30)):
    """Return unit vectors towards the cameras, float64 (H, W, 3)."""
    found = np.random.default_rng(1).standard_normal((*shape, 3))
    found[..., 2] = -np.abs(found[..., 2]) - 0.5
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def test_both_rigs_look_at_planes_and_spheres():
    names = [each['name'] for each in scenes()]
    assert len(set(names)) == len(names) == 18
    assert all(sum(rig in name and kind in name for name in names) >= 4
               for rig in ('paper', 'effector') for kind in ('plane', 'sphere'))


@pytest.mark.parametrize('name, radius', [('effector sphere 50 mm at 0.50 m', 0.05),
                                          ('paper sphere 30 mm at 0.38 m', 0.03)])
def test_the_true_normals_of_a_sphere_point_away_from_its_center(name, radius):
    found = scene(name)
    camera = found.rig.left
    turn = found.rig.calibration.left.R @ camera.pose.rotation.T
    normals = directions()
    points = turn @ (found.objects[0].pose.position - camera.pose.position) + radius * normals
    points[0] += 0.01 * normals[0]  # beside the sphere
    truth = true_normals(found, points)
    np.testing.assert_allclose(truth[1:], normals[1:], atol=1e-9)
    assert np.isnan(truth[0]).all()


def test_the_true_normal_of_a_tilted_plane_is_that_of_its_rotation():
    found = scene('effector plane 15 50 0')
    turn = rotation_from_degrees((15, 50, 0))
    places = np.random.default_rng(2).uniform(-0.14, 0.14, (20, 30, 3))
    places[..., 2] = 0
    places[0, :, 0] = 0.2  # beside the plane
    points = places @ turn.T + [0, 0, 0.5] - found.rig.left.pose.position
    truth = true_normals(found, points)
    np.testing.assert_allclose(truth[1:], np.broadcast_to(-turn[:, 2], (19, 30, 3)), atol=1e-9)
    assert np.isnan(truth[0]).all()


def test_the_figures_are_those_of_a_known_angle():
    truth = directions((40, 40))
    aside = np.cross(truth, [1.0, 0, 0])
    aside /= np.linalg.norm(aside, axis=-1, keepdims=True)
    degrees = np.where(np.arange(40) < 30, 1.0, 3.0)[:, None] * np.ones(40)
    measured = (truth * np.cos(np.radians(degrees))[..., None]
                + aside * np.sin(np.radians(degrees))[..., None])
    measured[5, :20] = np.nan
    depth = np.ones((40, 40))
    depth[6] = np.nan
    result = SimpleNamespace(normals=lambda: measured, depth=depth)
    np.testing.assert_allclose(np.delete(angles(result, truth), 5, 0), np.delete(degrees, 5, 0),
                               atol=1e-3)
    row = figures(result, truth)
    assert row['median'] == pytest.approx(1.0, abs=1e-3)
    assert row['p90'] == pytest.approx(3.0, abs=1e-3)
    assert row['pixels'] == 39 * 40 and row['share'] == pytest.approx(1 - 20 / (39 * 40))
    assert line('a sphere', row).split()[:4] == ['a', 'sphere', '1.000', '3.000']
