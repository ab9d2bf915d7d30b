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
"""Surface normals: planes and spheres of known direction, and the kernels beside loops."""

from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.cameras.geometry import RectifiedGeometry
from color_stereo_ros.core.normals import BEND, GATE, normals_of, PLANES, RIDGE

from naive import fitted_slopes, slopes_at_pixel
import numpy as np
import pytest

from surface_pairs import BASELINE, FOCAL, pair_of, rig, surface_settings

WIDTH, HEIGHT = 320, 240
GEOMETRY = rig(WIDTH, HEIGHT).geometry


def rays():
    """Return the ray of every pixel with Z = 1, float64 (H, W, 3)."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([(u - GEOMETRY.center_x_left) / FOCAL, (v - GEOMETRY.center_y) / FOCAL,
                     np.ones(u.shape)], axis=-1)


def plane(normal, distance):
    """Return depth of the plane n X = -distance and its normals; n looks to the camera."""
    normal = np.asarray(normal, np.float64) / np.linalg.norm(normal)
    return -distance / (rays() @ normal), np.broadcast_to(normal, (HEIGHT, WIDTH, 3))


def ball(center, radius, background):
    """Return depth and normals of a ball before a wall, and which pixels show the ball."""
    ray, center = rays(), np.asarray(center, np.float64)
    half, rest = ray @ center, center @ center - radius ** 2
    square = (ray ** 2).sum(axis=-1)
    root = half ** 2 - square * rest
    seen = root > 0
    depth = np.where(seen, (half - np.sqrt(np.maximum(root, 0))) / square, background)
    normals = (ray * depth[..., None] - center) / radius
    return depth, normals, seen


def measured(depth, seed=1, **changes):
    """Return the RangeResult of a surface of known depth."""
    disparity = FOCAL * BASELINE / depth
    pair = pair_of(disparity, seed=seed)
    settings = surface_settings(disparity.min() - 3, disparity.max() + 3, **changes)
    return ColorStereo(rig(WIDTH, HEIGHT), settings).process(*pair)


def errors(result, truth, where):
    """Return the angles between measured and true normals where both are known, degrees."""
    cosine = (result.normals() * truth).sum(axis=-1)[where]
    return np.degrees(np.arccos(np.clip(cosine[np.isfinite(cosine)], -1, 1)))


@pytest.mark.parametrize('normal', [(0, 0, -1), (0.3, 0.1, -1), (-0.4, 0.5, -1), (0.1, -0.6, -1)])
def test_the_normals_of_a_plane_are_right_within_a_degree(normal, effort, figures):
    found, seeds = [], effort.seeds(1, 10)
    depth, truth = plane(normal, 0.8)
    for seed in seeds:
        found.append(errors(measured(depth, seed), truth, np.s_[20:-20, 60:-20]))
    assert min(each.size for each in found) > 0.9 * 200 * 240
    figures(f'normals of a plane {normal}, median error', np.median(np.concatenate(found)),
            'degrees', over=seeds, at_most=1.0)


def test_the_normals_of_a_ball_are_right_within_a_degree(effort, figures):
    found, seeds = [], effort.seeds(1, 10)
    depth, truth, seen = ball((0.05, 0.0, 1.0), 0.3, 1.1)
    for seed in seeds:
        found.append(errors(measured(depth, seed), truth, seen))
    assert min(each.size for each in found) > 0.7 * seen.sum()
    figures('normals of a ball, median error', np.median(np.concatenate(found)), 'degrees',
            over=seeds, at_most=1.0)


def test_normals_are_unit_vectors_towards_the_camera_where_there_is_a_range():
    depth, _, _ = ball((0.0, 0.0, 1.0), 0.3, 1.2)
    result = measured(depth)
    normals, known = result.normals(), np.isfinite(result.depth)
    assert normals.dtype == np.float32 and normals.shape == (HEIGHT, WIDTH, 3)
    assert np.isnan(normals[~known]).all()
    found = np.isfinite(normals).all(axis=-1)
    assert found[known].mean() > 0.99
    np.testing.assert_allclose(np.linalg.norm(normals[found], axis=-1), 1.0, rtol=1e-6)
    assert ((normals * result.points()).sum(axis=-1)[found] < 0).all()


def test_normals_are_computed_once_and_when_asked():
    result = measured(plane((0, 0, -1), 0.8)[0])
    assert '_normals' not in vars(result)
    assert result.normals() is result.normals()


def test_the_paper_method_has_normals_too():
    depth, truth = plane((0.3, 0.1, -1), 0.8)
    result = measured(depth, matching__method='paper')
    assert not result.planar
    found = errors(result, truth, np.s_[20:-20, 60:-20])
    assert found.size > 0.7 * 200 * 240 and np.median(found) < 6.0


def exact(normal, distance, geometry, shape):
    """Return the disparity of a plane without noise."""
    v, u = np.mgrid[:shape[0], :shape[1]]
    ray = np.stack([(u - geometry.center_x_left) / geometry.focal_x,
                    (v - geometry.center_y) / geometry.focal_y, np.ones(u.shape)], axis=-1)
    inverse = ray @ (np.asarray(normal) / np.linalg.norm(normal)) / -distance
    return (geometry.focal_baseline * inverse + geometry.principal_offset).astype(np.float32)


@pytest.mark.parametrize('shape', [(24, 40), (25, 41), (2, 2), (3, 70), (41, 129)])
@pytest.mark.parametrize('planar', [True, False])
def test_a_plane_without_noise_has_its_exact_normal_everywhere(shape, planar):
    geometry = RectifiedGeometry(shape[1], shape[0], 60.0, 63.0, 17.5, -4.25, 11.0, 0.2)
    normal = np.array([0.2, -0.3, -1.0])
    found = normals_of(exact(normal, 0.9, geometry, shape), geometry, planar)
    if planar or min(shape) > 20:
        np.testing.assert_allclose(found, np.broadcast_to(
            normal / np.linalg.norm(normal), found.shape), atol=2e-4)


def test_an_image_without_a_whole_node_has_no_normals():
    assert np.isnan(normals_of(np.ones((1, 7), np.float32), GEOMETRY, True)).all()


def test_nothing_known_gives_nothing():
    unknown = np.full((24, 40), np.nan, np.float32)
    assert np.isnan(normals_of(unknown, GEOMETRY, True)).all()
    assert np.isnan(normals_of(unknown, GEOMETRY, False)).all()


def test_a_surface_does_not_bend_the_normals_of_the_one_beside_it():
    geometry = RectifiedGeometry(80, 40, 60.0, 60.0, 39.5, 39.5, 19.5, 0.2)
    near, far = (exact(normal, distance, geometry, (40, 80))
                 for normal, distance in (((0.3, 0, -1), 0.4), ((-0.2, 0.1, -1), 0.9)))
    disparity = np.where(np.arange(80) < 41, near, far)  # through a node
    found = normals_of(disparity, geometry, True)
    for part, normal in ((np.s_[:, :40], (0.3, 0, -1)), (np.s_[:, 42:], (-0.2, 0.1, -1))):
        np.testing.assert_allclose(found[part], np.broadcast_to(
            normal / np.linalg.norm(normal), found[part].shape), atol=1e-3)


def test_the_fit_is_that_of_the_loops():
    rng = np.random.default_rng(5)
    shape = 21, 70
    geometry = RectifiedGeometry(shape[1], shape[0], 60.0, 63.0, 30.0, 30.0, 11.0, 0.2)
    v, u = np.mgrid[:shape[0], :shape[1]]
    disparity = (20 + 0.1 * u - 0.05 * v + 0.002 * u * v % 3
                 + 0.05 * rng.standard_normal(shape)).astype(np.float32)
    disparity[rng.random(shape) < 0.15] = np.nan
    slopes = fitted_slopes(disparity, PLANES, (GATE, BEND, 0.0), RIDGE)
    found = normals_of(disparity, geometry, True)
    for row in range(shape[0]):
        for column in range(shape[1]):
            a, b = slopes_at_pixel(slopes, row, column)
            value = disparity[row, column]
            normal = np.array([a / 2 * 60.0, b / 2 * 63.0,
                               value - (column - 30.0) * a / 2 - (row - 11.0) * b / 2])
            np.testing.assert_allclose(found[row, column], -normal / np.linalg.norm(normal),
                                       atol=2e-4)
