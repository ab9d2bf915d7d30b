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
"""The projector as a third view: where it lights, what it adds, when it is not believed."""

from functools import lru_cache
import math

from color_stereo_ros.cli.process import SAMPLE
from color_stereo_ros.core import ColorStereo, Settings, SettingsError, Status, StereoCalibration
from color_stereo_ros.core.compiled import BANDS
from color_stereo_ros.core.projector.patch_kernels import choose_sites, predict_patches
from color_stereo_ros.core.projector.tracking import Track
from color_stereo_ros.core.surface.coarse_kernels import seed_planes
from color_stereo_ros.core.surface.grid_kernels import (
    PAD, SILENT_VARIANCE, TILE_COLUMNS, TILE_ROWS)
from color_stereo_ros.core.surface.plane_kernels import fit_planes, RADIUS, WIDE_RADIUS
from color_stereo_ros.core.surface.third.color_kernels import (
    color_equations, color_errors, color_slopes, mixed_errors, solve_changes, window_means)
from color_stereo_ros.core.surface.third.colors import (
    chromaticity, fitted_colors, local_light, mixed)
from color_stereo_ros.core.surface.third.fitting_kernels import fit_region
from color_stereo_ros.core.surface.third.fusion import Fusion
from color_stereo_ros.core.surface.third.fusion_kernels import (
    AGREE, APART, bound_odds, decide, expected_wrong, find_treated, FIRM, gather_evidence,
    sort_nodes, spread_planes, spread_views, weigh_forms)
from color_stereo_ros.core.surface.third.projected import thinned
from color_stereo_ros.core.surface.third.region_kernels import (
    find_known, find_region, reduce_firm, tiles_with)
from color_stereo_ros.core.surface.third.search import needed_nodes
from color_stereo_ros.core.surface.third.sweep import (
    geometry_variance, lens_change, packed, places, straightened, sweep_matrix)
from color_stereo_ros.core.surface.third.sweep_kernels import (
    anchor_nodes, around_sparse, best_windows, cells_of_nodes, cheapest_disparities, claim_cells,
    count_nodes, find_contested, linearize_sweep, list_nodes, PATHS, paths_along_columns,
    paths_along_rows, places_of_nodes, put_nodes, seed_unknown, shorten_list, sparse_misfits,
    sum_windows, sweep_costs, sweep_misfits, take_best)
from color_stereo_ros.core.surface.third.tuning import TUNING
from color_stereo_ros.core.surface.trust import Verdict
from color_stereo_ros.core.surface.tuning import TUNING as TUNING_OF_TWO
from color_stereo_ros.files.image import read_image
from color_stereo_ros.parameters.files import read_settings
import naive_sweep
import numpy as np
from projected import CALIBRATION, LIMITS, pair, PATTERN, projector, truth
import pytest

F4 = np.float32
MARGIN = TUNING.color.margin
RED = 1.0, 0.35, 0.3


def settings(**changes):
    """Return settings for the wall and the plate."""
    focal_baseline = CALIBRATION.geometry.focal_baseline
    values = {'range.min_depth': focal_baseline / LIMITS[1],
              'range.max_depth': focal_baseline / LIMITS[0], 'matching.third_view': 'automatic',
              **{name.replace('__', '.'): value for name, value in changes.items()}}
    return Settings(pattern=PATTERN).updated(values)


@lru_cache(maxsize=None)
def stereo():
    """Return an object for the scene; its projector is set by each test."""
    return ColorStereo(CALIBRATION, settings())


def measured(model, **scene):
    """Return the result of a scene with a projector or without."""
    rig = stereo()
    rig.reset()
    rig.use_projector(model)
    return rig.process(*pair(**scene))


def cover(result):
    """Return the share of the lit pixels that are right within 1 px."""
    disparity, lit, _ = truth()
    with np.errstate(invalid='ignore'):
        return np.mean((np.abs(result.disparity - disparity) <= 1)[lit])


def same(one, other):
    """Return whether all arrays of two results have the same bytes."""
    names = 'disparity', 'depth', 'disparity_std', 'confidence', 'status', 'views'
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in names)


def test_the_sweep_lights_a_pixel_where_the_model_projects_its_point():
    geometry, rng = CALIBRATION.geometry, np.random.default_rng(1)
    x, y = rng.uniform(0, 319, 50), rng.uniform(0, 239, 50)
    d = rng.uniform(*LIMITS, 50)
    depth = geometry.focal_baseline / (d - geometry.principal_offset)
    points = np.stack([(x - geometry.center_x_left) / geometry.focal_x * depth,
                       (y - geometry.center_y) / geometry.focal_y * depth, depth], axis=-1)
    found = places(sweep_matrix(projector(), geometry), x, y, d)
    np.testing.assert_allclose(found, projector().project(points), atol=1e-9)


def test_a_straightened_pattern_shows_at_an_ideal_place_what_lights_it():
    model = projector(distortion=0.05)
    v, u = np.mgrid[:384, :512].astype(F4)
    ramp = np.stack([u, v, u + v], axis=-1)
    flat = straightened(ramp, model)
    rays = np.linalg.inv(model.camera_matrix) @ [400.0, 300.0, 1.0]
    square = rays[0] ** 2 + rays[1] ** 2
    there = model.camera_matrix @ [*(rays[:2] * (1 + 0.05 * square)), 1.0]
    # OpenCV places to 1/32 px, and its cubic is off by as much on a ramp
    np.testing.assert_allclose(flat[300, 400, :2], there[:2], atol=0.06)
    for rows in (slice(0, 3), slice(100, 110), slice(380, 384)):
        np.testing.assert_array_equal(straightened(ramp, model, rows), flat[rows])


def test_the_third_view_measures_what_the_right_camera_does_not_see():
    two, three = measured(None), measured(projector())
    disparity, lit, visible = truth()
    alone = lit & ~visible
    assert np.mean(np.isfinite(two.disparity[alone])) < 0.1
    error = np.abs(three.disparity - disparity)[alone]
    assert np.mean(error <= 1) > 0.9
    assert np.nanmedian(error) < 0.06
    assert cover(three) > cover(two) + 0.05


@lru_cache(maxsize=None)
def result_of_sample():
    """Return the result of the sample pair, once the projector is known."""
    calibration = StereoCalibration.from_yaml(SAMPLE / 'left.yaml', SAMPLE / 'right.yaml')
    stereo = ColorStereo(calibration,
                         Settings().updated(read_settings(SAMPLE / 'settings.yaml')))
    pair = [read_image(SAMPLE / f'{side}.webp') for side in ('left', 'right')]
    return [stereo.process(*pair) for _ in range(2)][-1]


def test_no_line_is_lost_where_the_right_image_ends():
    known = np.isfinite(result_of_sample().depth)
    # beside column 413 the right image ends; a flat wall lies there
    assert np.mean(known[100:400, 409:418], axis=0).min() > 0.9


def test_no_chance_match_stays_amid_a_wall_that_only_the_projector_sees():
    depth = result_of_sample().depth
    # beyond column 430 is nothing but a flat wall
    assert np.nanmax(np.abs(depth / np.nanmedian(depth[:, 430:]) - 1)[100:400, 430:470]) < 0.01


def test_the_views_say_who_saw_a_pixel():
    two, three = measured(None), measured(projector())
    _, lit, visible = truth()
    assert two.views.dtype == three.views.dtype == np.uint8
    assert np.array_equal(two.views, (two.status == Status.VALID).astype(np.uint8))
    assert np.array_equal(three.views > 0, three.status == Status.VALID)
    assert np.mean(three.views[lit & ~visible] & 2 > 0) > 0.9
    assert np.mean(three.views[lit & ~visible] == 2) > 0.75  # planes of two views reach into it
    assert np.mean(three.views[visible] == 3) > 0.9


def test_the_deviations_of_the_third_view_are_honest():
    three = measured(projector())
    disparity = truth()[0]
    alone = three.views == 2
    score = (np.abs(three.disparity - disparity) / three.disparity_std)[alone]
    assert 0.3 < np.percentile(score, 68) < 1.4


def test_colored_surfaces_are_measured_too():
    two, three = measured(None, paint=RED), measured(projector(), paint=RED)
    assert cover(three) > cover(two) + 0.05
    assert cover(three) > 0.95


def test_without_a_projector_nothing_changes():
    before = measured(None)
    measured(projector())
    assert same(before, measured(None))


def test_switched_off_the_projector_is_not_used():
    rig = ColorStereo(CALIBRATION, settings(matching__third_view='off'))
    rig.use_projector(projector())
    assert rig.projector is None
    assert same(rig.process(*pair()), measured(None))


def test_another_pattern_than_the_one_shown_falls_back_to_two_views():
    assert same(measured(projector(), seed=99), measured(None, seed=99))


def test_a_projector_elsewhere_falls_back_to_two_views():
    moved = projector().but(translation=projector().translation + [0.03, 0.02, 0.0])
    assert same(measured(moved), measured(None))


@pytest.mark.parametrize('distortion', [0.0024, -0.0024])
def test_ranges_stay_where_images_of_a_slightly_different_lens_are_kept(distortion):
    model, old, rig = projector(), projector(distortion), stereo()
    assert 0.09 < lens_change(model, old)[1] < TUNING.sweep.prepared_places
    fresh = measured(model)
    kept = rig.process(*pair(), projector=Track.known(model).but(prepared=old))
    assert kept.projector.prepared is old and fresh.projector.prepared is model
    alone = (fresh.views == 2) & (kept.views == 2)
    assert np.count_nonzero(alone) > 0.98 * np.count_nonzero(fresh.views == 2) > 2000
    moved = (kept.disparity - fresh.disparity)[alone]
    # .1 px of the pattern are .13 px of disparity; the affine map leaves that at corners only.
    # Without the map it is .10 px in the middle.
    assert abs(np.median(moved)) < 0.05 and np.median(np.abs(moved)) < 0.05
    assert abs(cover(kept) - cover(fresh)) < 0.002


def test_a_pattern_that_repeats_needs_no_projector():
    rig = ColorStereo(CALIBRATION, settings(pattern__type='sine', pattern__cycles=8))
    rig.use_projector(projector())
    assert rig.projector is None


def test_the_left_camera_measures_alone_with_the_projector():
    rig = stereo()
    rig.use_projector(projector())
    rig.process(*pair())
    left = rig.process_left(pair(noise=2)[0])
    assert cover(left) > 0.93
    assert set(np.unique(left.views)) <= {0, 2}


def test_the_left_camera_alone_measures_nothing_without_a_projector():
    rig = stereo()
    rig.use_projector(None)
    with pytest.raises(SettingsError, match='the projector is not known'):
        rig.process_left(pair()[0])


def test_an_uncertain_projector_makes_disparities_uncertain():
    geometry = CALIBRATION.geometry
    covariance = np.zeros((12, 12))
    covariance[9, 9] = 1e-3 ** 2  # 1 mm along x of the projector
    found = geometry_variance(projector().but(covariance=covariance), geometry, 64.0)
    # a shift along the baseline moves the place as a shift of that share of the disparity
    model, sweep = projector(), sweep_matrix(projector(), geometry)
    shifted = sweep_matrix(model.but(translation=model.translation + [1e-3, 0, 0]), geometry)
    x, y = 12.83, 12.83  # of the first sample
    near = np.array(places(sweep, x, y, 64.0))
    slope = np.array(places(sweep, x, y, 64.5)) - np.array(places(sweep, x, y, 63.5))
    moved = np.array(places(shifted, x, y, 64.0)) - near
    assert found[0, 0] == pytest.approx((moved @ slope / (slope @ slope)) ** 2, rel=0.05)


def test_the_colors_of_the_camera_are_found_but_for_brightness():
    rng = np.random.default_rng(3)
    light = rng.uniform(0.05, 1, (3, 2000))
    colors = np.array([[1.0, 0.1, 0.05, 0.02], [0.1, 0.9, 0.1, 0.02], [0.0, 0.1, 0.5, 0.02]])
    u, v = chromaticity(mixed(colors, light))
    found = fitted_colors(u, v, light, np.ones(2000))
    np.testing.assert_allclose(chromaticity(mixed(found, light)), [u, v], atol=0.01)


def test_errors_of_colors_are_those_of_their_chromaticities():
    rng = np.random.default_rng(2)
    light, (u, v) = rng.random((3, 20)), rng.normal(0, 0.5, (2, 20))
    colors, error = np.eye(3, 4) + rng.uniform(0, 0.1, (3, 4)), np.empty(20)
    mixed_errors(u, v, light, colors, TUNING.color.least_light, error)
    expected = np.subtract([u, v], chromaticity(mixed(colors, light)))
    np.testing.assert_allclose(error, np.sum(expected ** 2, axis=0), rtol=1e-5)


@lru_cache(maxsize=None)
def nodes():
    """Return random inputs of the kernels: one tile row of nodes and a pattern."""
    rng = np.random.default_rng(5)
    shape = 2 * PAD + 2 * TILE_ROWS, 2 * PAD + 2 * TILE_COLUMNS
    image = rng.uniform(0.1, 0.9, (90, 120, 3))
    flat = packed(image)
    image = flat.view(np.uint8).reshape(90, 120, 4)[..., :3] / 255
    tiles = np.array([[PAD + y, PAD + x] for y in (0, TILE_ROWS) for x in (0, TILE_COLUMNS)],
                     np.int32)
    sweep = np.array([[0.7, 0.1, 1.0, 0.4], [0.05, 0.8, 12.0, 0.9], [1e-4, 2e-4, 1, 1e-3]], F4)
    colors = np.array([[0.9, 0.1, 0, 0.01], [0.1, 1, 0.1, 0.02], [0, 0.1, 0.6, 0.03]], F4)
    u, v = rng.normal(0, 0.5, (2, *shape)).astype(F4)
    variance = rng.uniform(0.001, 0.01, shape).astype(F4)
    d = rng.uniform(4, 30, shape).astype(F4)
    a, b = rng.uniform(-0.2, 0.2, (2, *shape)).astype(F4)
    light = rng.uniform(0.6, 1.2, (3, *shape)).astype(F4)
    unrest = rng.uniform(1, 3, shape).astype(F4)
    region = rng.random(shape) < 0.7
    return {'u': u, 'v': v, 'variance': variance, 'flat': flat, 'size': np.array([90, 120]),
            'image': image, 'colors': colors, 'light': light, 'unrest': unrest, 'sweep': sweep,
            'd': d, 'a': a, 'b': b, 'tiles': tiles, 'region': region}


def naive_node(given, y, x, d):
    """Return misfit, weight and moment of one node; None where it tells nothing."""
    seen = naive_sweep.color(given['image'], given['colors'], given['light'][:, y, x],
                             given['sweep'], 2 * (x - PAD) + 0.5, 2 * (y - PAD) + 0.5, float(d),
                             MARGIN)
    if seen is None or not given['region'][y, x]:
        return None
    value, slope = seen
    error = np.array([given['u'][y, x], given['v'][y, x]]) - value
    w = 1 / (1.5 * given['unrest'][y, x] * given['variance'][y, x] + 0.04 * slope @ slope)
    chi = w * error @ error
    w /= 1 + chi / 9
    return chi, w * slope @ slope, w * slope @ slope * (d - 10) + w * slope @ error


def inner(given):
    """Yield the places of all nodes of the tiles."""
    for top, left in given['tiles']:
        for y in range(top, top + TILE_ROWS):
            for x in range(left, left + TILE_COLUMNS):
                yield y, x


def listed(given):
    """Return the first arguments of the kernels: the nodes of the region in the tiles."""
    wanted = np.zeros(given['d'].shape, bool)
    for y, x in inner(given):
        wanted[y, x] = given['region'][y, x]
    counts = wanted.sum(axis=1)
    nodes, told = np.empty(counts.sum(), np.int32), np.empty((8, counts.sum()), F4)
    list_nodes(wanted, np.cumsum(counts) - counts, given['u'], given['v'], given['variance'],
               given['light'], given['unrest'], F4(1.5), nodes, told)
    np.testing.assert_array_equal(nodes, np.flatnonzero(wanted))
    return nodes, told, given['flat'], given['size'], given['colors'], given['sweep']


def test_nodes_are_linearized_as_their_formulas_say():
    given = nodes()
    weight, moment, misfit = np.full((3, *given['d'].shape), 7, F4)
    linearize_sweep(*listed(given), given['d'].ravel(), F4(9), F4(0.04), F4(10), weight.ravel(),
                    moment.ravel(), misfit.ravel())
    count = 0
    for y, x in inner(given):
        told = misfit[y, x], weight[y, x], moment[y, x]
        expected = naive_node(given, y, x, given['d'][y, x])
        if not given['region'][y, x]:
            assert told == (7, 7, 7)
        elif expected is None:
            np.testing.assert_array_equal(told, [np.nan, 0, 0])
        else:
            count += 1
            np.testing.assert_allclose(told, expected, rtol=2e-3,
                                       atol=2e-3 * abs(expected[1]) + 1e-4)
    assert count > 300


def test_the_plane_of_a_neighbor_is_compared_at_the_own_place():
    given = nodes()
    first, shape = listed(given), given['d'].shape
    steps, out = np.array([(0, 0), (1, -2)]), np.empty((2, first[0].size), F4)
    sweep_misfits(*first, *(given[name].ravel() for name in 'dab'), steps, shape[1], F4(0.04),
                  F4(60), out)
    for (down, along), misfits in zip(steps, out):
        put = np.full(shape, 7, F4)
        put_nodes(first[0], misfits, put.reshape(-1))
        for y, x in inner(given):
            d, a, b = (given[name][y + down, x + along] for name in 'dab')
            expected = naive_node(given, y, x, d - a * along - b * down)
            told = 60 if expected is None else min(expected[0], 60)
            assert put[y, x] == pytest.approx(told if given['region'][y, x] else 7, rel=2e-3)


def test_a_shortened_list_tells_the_same_of_fewer_nodes():
    given = nodes()
    everyone, told = listed(given)[:2]
    wanted = np.random.default_rng(13).random(given['d'].shape) < 0.3
    some, flat = np.zeros(everyone.size, np.int32), np.zeros(told.size, F4)
    count = shorten_list(everyone, told, wanted.reshape(-1), some, flat)
    kept = wanted.reshape(-1)[everyone]
    np.testing.assert_array_equal(some[:count], everyone[kept])
    np.testing.assert_array_equal(flat[:8 * count].reshape(8, count), told[:, kept])


@pytest.mark.parametrize('columns', [30, 31])
def test_sparse_misfits_are_those_of_every_second_node_and_spread_as_means(columns):
    given, rows = nodes(), 14
    d, variance = given['d'].copy(), np.where(given['region'], given['variance'], SILENT_VARIANCE)
    d[PAD + 4, PAD + 6] = np.nan
    sparse = np.zeros((rows // 2 + 1, columns // 2 + 1), F4)
    sparse_misfits(given['u'], given['v'], variance, given['light'], given['unrest'], F4(1.5),
                   given['flat'], given['size'], given['colors'], given['sweep'], d, F4(0.04),
                   F4(60), sparse)
    for y, x in np.ndindex(sparse.shape):
        at = PAD + 2 * y, PAD + 2 * x
        expected = None if np.isnan(d[at]) else naive_node(given, *at, d[at])
        assert sparse[y, x] == pytest.approx(
            60 if expected is None else min(expected[0], 60), rel=2e-3)
    around = np.full(d.shape, 7, F4)
    around_sparse(sparse, rows, columns, around)
    for y, x in np.ndindex(rows, columns):
        known = [sparse[j // 2, i // 2] for j in (y - 1, y, y + 1) for i in (x - 1, x, x + 1)
                 if j % 2 == 0 and i % 2 == 0]
        assert around[PAD + y, PAD + x] == pytest.approx(np.mean(known), rel=1e-5)
    assert (np.delete(around, np.s_[PAD:PAD + rows], axis=0) == 7).all()
    assert (around[:, PAD + columns:] == 7).all() and (around[:, :PAD] == 7).all()


def test_a_wanted_node_takes_the_best_plane_around():
    given, step = nodes(), 3
    costs = np.random.default_rng(1).random((4, *given['d'].shape)).astype(F4)
    best = np.random.default_rng(2).random(given['d'].shape).astype(F4)
    given['d'][PAD + 2, PAD + 2] = np.nan  # nobody takes an unknown plane
    new, kept = [np.zeros_like(best) for _ in range(3)], best.copy()
    take_best(*(given[name] for name in 'dab'), step, costs, best, given['region'],
              *new)
    for y, x in np.ndindex(best.shape):
        expected = naive_sweep.better_plane(*(given[name] for name in 'dab'), y, x, step,
                                            costs[:, y, x], kept[y, x], given['region'][y, x])
        np.testing.assert_allclose([best[y, x], *(each[y, x] for each in new)], expected,
                                   rtol=1e-5, atol=1e-5)


def test_firm_nodes_get_what_two_cameras_know_and_all_others_nothing():
    rng = np.random.default_rng(3)
    firm = rng.random((9, 40)) < 0.5
    told, *given = rng.random((6, *firm.shape)).astype(F4)
    own = list(rng.random((6, *firm.shape)).astype(F4))
    planes = [each.copy() for each in own[:3]]
    anchor_nodes(firm, told, *given, F4(60), *own)
    for known, out, otherwise in zip((*given, told), own, (*planes, 0, 0, 60)):
        np.testing.assert_array_equal(out, np.where(firm, known, F4(otherwise)))


def test_the_best_window_is_the_one_of_the_lowest_mean_that_holds_a_node():
    rng = np.random.default_rng(8)
    shape = 20 + 2 * PAD, 150 + 2 * PAD
    cost, chosen = rng.uniform(0, 60, shape).astype(F4), np.zeros(shape, bool)
    chosen[PAD:-PAD, PAD:-PAD] = rng.random((20, 150)) < 0.1
    chosen[PAD + 3] = False
    out = np.full(shape, -1, F4)
    best_windows(cost, chosen, out)
    for y, x in np.argwhere(chosen):
        expected = naive_sweep.best_window(cost, y, x)
        assert out[y, x] == pytest.approx(expected, rel=1e-6)
    assert (out[PAD + 3] == -1).all()


def test_unknown_nodes_get_the_planes_of_the_coarse_search():
    rng = np.random.default_rng(9)
    h, w, factor = 6, 9, 2
    coarse = rng.uniform(2, 9, (h, w)).astype(F4)
    whole = rng.random((h, w)) < 0.5
    nodes = h * factor + 1, w * factor + 1
    shape = tuple(count + 2 * PAD for count in nodes)
    seeded, planes = np.full((2, 3, *shape), 7, F4)
    seed_planes(coarse, factor, F4(0), *nodes, *seeded)
    seed_unknown(coarse, whole, factor, *nodes, *planes)
    for y, x in np.ndindex(nodes):
        cy, cx = min(y // factor, h - 1), min(x // factor, w - 1)
        skipped = whole[cy, cx] and cy < h - 1 and cx < w - 1
        at = np.s_[:, y + PAD, x + PAD]
        np.testing.assert_array_equal(planes[at], 7 if skipped else seeded[at])


@pytest.mark.parametrize('reach', [0, RADIUS, WIDE_RADIUS])
def test_planes_are_fitted_where_the_region_needs_them(reach):
    given = nodes()
    rng, shape = np.random.default_rng(10), given['d'].shape
    weight, moment = rng.random((2, *shape)).astype(F4)
    region = np.zeros(shape, bool)
    region[PAD + 2, PAD + 3] = region[PAD + TILE_ROWS + 1, PAD + TILE_COLUMNS] = True
    tiles = given['tiles'][[0, 3]]
    numbers = np.full(2, reach, np.int8), F4(3), 1, F4(0.01), F4(0.1), F4(1), F4(10)
    every, some = np.full((2, 4, *shape), 7, F4)
    fit_planes(weight, moment, *(given[name] for name in 'dab'), tiles, *numbers, *every)
    fit_region(weight, moment, *(given[name] for name in 'dab'), region, tiles, *numbers, *some)
    for tile, line in zip(tiles, (2, 1)):
        for y, x in np.ndindex(TILE_ROWS, TILE_COLUMNS):
            at = np.s_[:, tile[0] + y, tile[1] + x]
            np.testing.assert_array_equal(some[at], every[at] if reach or y == line else 7)
    assert (some[:, PAD:PAD + TILE_ROWS, PAD + TILE_COLUMNS:] == 7).all()


def test_with_a_stride_a_line_takes_the_near_planes_of_the_one_above():
    given = nodes()
    rng, shape = np.random.default_rng(14), given['d'].shape
    weight, moment = rng.random((2, *shape)).astype(F4)
    region = np.zeros(shape, bool)
    region[PAD + 3, PAD + 3] = True  # its pair begins at line 2
    tiles, gate = given['tiles'][:1], 12.0
    numbers = np.zeros(1, np.int8), F4(gate), 2, F4(0.01), F4(0.1), F4(1), F4(10)
    planes = [given[name] for name in 'dab']
    every, some = np.full((2, 4, *shape), 7, F4)
    fit_planes(weight, moment, *planes, tiles, *numbers, *every)
    fit_region(weight, moment, *planes, region, tiles, *numbers, *some)
    line = np.s_[PAD:PAD + TILE_COLUMNS]
    d, a, b, variance = above = every[:, PAD + 2, line]
    np.testing.assert_allclose(some[:, PAD + 2, line], above, rtol=1e-5)
    own = [plane[PAD + 3, line] for plane in planes]
    near = np.abs(d + b - own[0]) < gate
    assert near.any() and not near.all()
    np.testing.assert_allclose(some[:, PAD + 3, line], [
        *(np.where(near, new, old) for new, old in zip((d + b, a, b), own)),
        np.where(near, variance, np.inf)], rtol=1e-5)
    assert (np.delete(some, [PAD + 2, PAD + 3], axis=1) == 7).all()


def test_a_seed_beside_an_edge_is_not_treated_by_the_fit_of_the_other_surface():
    given = nodes()
    shape, line = given['d'].shape, np.s_[PAD:PAD + TILE_COLUMNS]
    weight, region = np.ones(shape, F4), np.ones(shape, bool)
    d, a, b = np.full(shape, 5, F4), *np.zeros((2, *shape), F4)
    d[PAD + 3, PAD + 4] = 25  # a seed of the surface behind the edge
    variance, new = np.full(shape, 7, F4), np.full((3, *shape), 7, F4)
    numbers = np.zeros(1, np.int8), F4(3), 2, F4(0), F4(0.1), F4(1), F4(0)
    fit_region(weight, 5 * weight, d, a, b, region, given['tiles'][:1], *numbers, *new, variance)
    treated = np.empty((TILE_ROWS, TILE_COLUMNS), bool)
    find_treated(region, new[0], variance, treated)
    assert not treated[3, 4] and np.count_nonzero(~treated) == 1
    assert new[0, PAD + 3, PAD + 4] == 25
    np.testing.assert_allclose(np.delete(new[0, PAD + 3, line], 4), 5, rtol=1e-5)


def test_standard_deviations_are_those_of_fit_neighbors_and_geometry():
    rng, (rows, columns) = np.random.default_rng(11), (5, 70)
    distance, geometry = rng.random((2, rows, columns)).astype(F4)
    variance, std = rng.random((2, rows + 2 * PAD, columns + 2 * PAD)).astype(F4)
    frame = std[PAD - 1].copy()
    spread_planes(distance, variance, geometry, F4(0.25), F4(2), F4(0.3), std)
    for y, x in np.ndindex(rows, columns):
        square = (2 * variance[y + PAD, x + PAD] + (0.3 * distance[y, x] ** 2) ** 2
                  + 0.25 * geometry[y, x])
        assert std[y + PAD, x + PAD] == pytest.approx(math.sqrt(square), rel=1e-5)
    np.testing.assert_array_equal(std[PAD - 1], frame)


def test_nodes_whose_color_says_nothing_are_not_listed():
    wanted, variance = np.ones((3, 8), bool), np.full((3, 8), 0.01, F4)
    wanted[0, :3], variance[1, 5:] = False, SILENT_VARIANCE
    counts = np.zeros(3, np.int64)
    count_nodes(wanted, variance, counts)
    np.testing.assert_array_equal(counts, [5, 5, 8])


def test_a_thinned_pattern_keeps_its_light():
    image = np.random.default_rng(12).random((7, 9, 3)).astype(F4)
    thin = thinned(image, 2)
    assert thin.shape == (4, 5, 3) and thinned(image, 1) is image
    np.testing.assert_allclose(thin[1, 2], image[2:4, 4:6].mean(axis=(0, 1)), rtol=1e-5)
    np.testing.assert_allclose(thin[3, 4], image[6, 8], rtol=1e-5)


def test_coarse_costs_are_differences_of_colors_and_leave_known_nodes_alone():
    given, rng = nodes(), np.random.default_rng(2)
    h, w, depth = 5, 7, 70
    left = rng.integers(-100, 100, (2, h, w)).astype(np.int16)
    trust = rng.choice([0, 7, 16], (h, w)).astype(np.int16)
    known = np.where(rng.random((h, w)) < 0.2, 12.0, np.nan).astype(F4)
    light = rng.uniform(0.6, 1.2, (3, h, w)).astype(F4)
    thin = given['flat'].reshape(90, 120)[::2, ::2].copy()
    cost, needed = np.zeros((h, w, depth), np.int16), rng.integers(0, 3, (h, w), np.uint8)
    sweep_costs(left[0], left[1], trust, thin, F4(0.5), given['size'], given['colors'], light,
                known, needed, given['sweep'], F4(1.5), F4(4), F4(2), F4(0.5), F4(100),
                np.int16(160), np.int16(70), F4(40), depth - 2, cost)
    for y, x, n in np.ndindex(h, w, depth):
        if needed[y, x] == 0 or n >= depth - 2:
            expected = 0
        elif known[y, x] == known[y, x]:
            expected = min(40 * abs(n - 12), 160)
        else:
            seen = naive_sweep.color(given['image'], given['colors'], light[:, y, x],
                                     given['sweep'], 1.5 + 4 * x, 1.5 + 4 * y, 2 + 0.5 * n, 0.0,
                                     naive_sweep.thin_light)
            away = 160 if seen is None else min(np.abs(left[:, y, x] - 100 * seen[0]).sum(), 160)
            expected = 70 + (away - 70) * trust[y, x] / 16
        assert abs(cost[y, x, n] - expected) <= 1.5


def runs(needed):
    """Return the slices of a line of nodes whose paths are needed."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], needed == PATHS, [False]])))
    return [slice(*each) for each in edges.reshape(-1, 2)]


@pytest.mark.parametrize('share, depth', [(1.0, 13), (0.7, 13), (0.7, 70)])
def test_paths_and_windows_are_those_of_semi_global_matching(share, depth):
    rng = np.random.default_rng(4)
    cost = rng.integers(0, 160, (9, 11, depth)).astype(np.int16)
    needed = np.where(rng.random((9, 11)) < share, PATHS, 1).astype(np.uint8)
    summed, total = np.zeros((2, *cost.shape), np.int16)
    sum_windows(cost, needed, summed)
    windows = naive_sweep.windows(cost)
    np.testing.assert_array_equal(summed, np.where((needed == PATHS)[..., None], windows, 0))
    scratch = np.empty((BANDS, 11 // BANDS + 2, depth + 3), np.int16)
    penalties = np.int16(60), np.int16(600), np.int16(8000)
    paths_along_rows(summed, needed, *penalties, total, scratch)
    paths_along_columns(summed, needed, *penalties, total, scratch)
    expected = np.zeros(cost.shape, int)
    for volume, out, nodes_needed in ((summed, expected, needed), (
            summed.swapaxes(0, 1), expected.swapaxes(0, 1), needed.T)):
        for line, line_out, some in zip(volume, out, nodes_needed):
            for run in runs(some):
                line_out[run] += naive_sweep.path(line[run], 60, 600)
                line_out[run] += naive_sweep.path(line[run][::-1], 60, 600)[::-1]
    np.testing.assert_array_equal(total, expected)


def test_paths_are_needed_around_what_is_unknown_and_costs_around_paths():
    unknown = np.zeros((7, 8), bool)
    unknown[3, 3] = True
    needed = needed_nodes(unknown)
    assert (needed[2:5, 2:5] == PATHS).all() and np.count_nonzero(needed == PATHS) == 9
    assert np.count_nonzero(needed) == 25 and needed[1, 1] == 1


def test_the_cheapest_disparity_is_refined():
    total = np.full((1, 4, 12), 900, np.int16)
    total[..., 11] = 0  # beyond the depth
    total[0, 0, 3:6] = 300, 100, 200
    total[0, 1, 0] = 450
    best, needed = np.zeros((1, 4), F4), np.array([[2, 2, 1, 0]], np.uint8)
    known = np.array([[np.nan, np.nan, np.nan, 7]], F4)
    cheapest_disparities(total, 11, known, needed, best)
    assert best[0, 2] == best[0, 1] and best[0, 3] == 7
    assert best[0, 0] == pytest.approx(4 + 0.5 * (300 - 200) / (300 - 100))
    assert best[0, 1] == 0


def test_two_surfaces_cannot_claim_one_place_of_the_pattern():
    two, third = np.zeros((2, 1 + 2 * PAD, 4 + 2 * PAD), F4)
    two[PAD, PAD:PAD + 4], third[PAD, PAD:PAD + 4] = (10, 10.5, 30, 50), (10, 10.5, 30, 30)
    odds = np.array([[[2, 5, 1, -1]], [[2, 5, 1, 3]]], F4)  # of two cameras, of the third view
    cells = np.array([[[0, 0, 0, 2]], [[0, 0, 0, -1]]], np.int32)
    best, owner = np.empty((2, 4), F4)
    contested = np.empty((2, 1, 4), F4)
    claim_cells(two, third, odds, cells, best, owner)
    assert owner[0] == F4(10.5) and np.isnan(owner[1:]).all()
    for d, at, out in zip((two, third), cells, contested):
        find_contested(d, at, F4(2), best, owner, out)
    np.testing.assert_array_equal(contested, [[[0, 0, 5, 0]], [[0, 0, 5, 0]]])


def test_cells_are_those_of_the_places_that_light_the_nodes():
    given, cell, (height, width) = nodes(), 4.0, (10, 12)
    given['d'][PAD + 2, PAD + 3] = np.nan
    out = np.empty((TILE_ROWS, TILE_COLUMNS), np.int32)
    cells_of_nodes(given['sweep'], given['d'], F4(cell), height, width, out)
    for y, x in np.ndindex(out.shape):
        (u, v), _, depth = naive_sweep.place(given['sweep'], 2 * x + 0.5, 2 * y + 0.5,
                                             given['d'][PAD + y, PAD + x])
        inside = depth > 0 and 0 <= u < cell * width and 0 <= v < cell * height
        assert out[y, x] == (int(v / cell) * width + int(u / cell) if inside else -1)
    assert out[2, 3] == -1 and (out >= 0).sum() > 50 and (out < 0).sum() > 20


def test_forms_are_weighed_by_the_kinds_of_nodes():
    rng = np.random.default_rng(6)
    evidence = rng.uniform(-1, 2, (3, 4, 70)).astype(F4)
    forms = np.triu(rng.normal(0, 1, (2, 4, 4))).astype(F4)
    kind = rng.integers(0, 3, (4, 70)).astype(np.uint8)
    out = np.full((4, 70), 7, F4)
    weigh_forms(evidence, kind, forms, out)
    for y, x in np.ndindex(4, 70):
        one = np.append(1, evidence[:, y, x])
        expected = one @ forms[kind[y, x] - 1] @ one if kind[y, x] else 7
        assert out[y, x] == pytest.approx(expected, abs=1e-4)


def test_nodes_are_sorted_by_what_both_say_and_the_better_plane_is_taken():
    rng = np.random.default_rng(9)
    rows, columns = 7, 9
    shape = rows + 2 * PAD, columns + 2 * PAD
    inner = np.s_[PAD:PAD + rows, PAD:PAD + columns]
    two, third = rng.uniform(0, 2, (2, 4, *shape)).astype(F4)  # d, a, b, standard deviation
    hopeless = F4(TUNING_OF_TWO.trust.hopeless_odds)
    odds = rng.choice([hopeless, -3, 1, 4], shape).astype(F4)
    witness = rng.choice([np.nan, 2, 80], shape).astype(F4)
    firm, treated = rng.random(shape) < 0.2, rng.random((rows, columns)) < 0.6
    evidence = np.zeros((8, rows, columns), F4)
    kind, only_third = np.zeros((2, rows, columns), np.uint8)
    possible = np.zeros((rows, columns), bool)
    dim, own_odds, lone = rng.random((3, rows, columns)).astype(F4)
    sort_nodes(two[0], third[0], odds, witness, firm, treated, dim, evidence, kind, only_third,
               possible, own_odds, lone)
    np.testing.assert_array_equal(own_odds, odds[inner])
    assert (lone == hopeless).all() and (evidence[5] == dim).all()
    weighed, third_odds = rng.normal(0, 3, (2, rows, columns)).astype(F4)
    third_odds[only_third == 0] = hopeless
    doubts, reason = np.array([0, 0.5, 0.25, 0.75], F4), np.full(shape, 3, np.uint8)
    out = np.zeros((5, *shape), F4)
    codes, views, beyond = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8), np.zeros(
        shape, bool)
    certainty = np.array([1, 0.5, 1, 0.75], F4)
    decide(kind, possible, evidence, weighed, third_odds, certainty, doubts, *two, reason, *third,
           *out[:4], out[4], codes, views, beyond)
    use = TUNING.use
    for y, x in np.ndindex(rows, columns):
        at = y + PAD, x + PAD
        told, may = treated[y, x], odds[at] > hopeless / 2
        which = APART if told or may else 0
        which = AGREE if told and abs(two[0][at] - third[0][at]) < use.agreement else which
        which = FIRM if firm[at] else which
        assert (kind[y, x], only_third[y, x], possible[y, x]) == (
            which, told and which == APART, may)
        bounded = np.clip(odds[at], *use.odds_limits)
        np.testing.assert_allclose(evidence[[0, 2], y, x], [bounded, np.sqrt(np.fmin(
            witness[at], use.misfit_cap))], rtol=1e-6)
        lost = which == APART and not may
        own = hopeless if lost else weighed[y, x]
        better = third_odds[y, x] > own or (which == AGREE and bounded < use.kept_odds)
        best = max(own, third_odds[y, x])
        sure = TUNING.use.sure_odds
        best = max(sure + (best - sure) * certainty[which] if best > sure else best,
                   bounded if which == AGREE else hopeless)
        np.testing.assert_allclose(out[:, at[0], at[1]], [
            *(third if better else two)[:, at[0], at[1]],
            best - (0 if lost else doubts[which])], rtol=1e-6)
        agree = which in (AGREE, FIRM)
        assert beyond[at] == (agree or better)
        assert codes[at] == (Status.IMPLAUSIBLE if better else 3)
        assert views[at] == (1 if agree or not better else 0) + (2 if agree or better else 0)
    np.testing.assert_array_equal(out[4][inner][:, 0], out[4][PAD:PAD + rows, PAD - 1])
    np.testing.assert_array_equal(out[4][inner][:, -1], out[4][PAD:PAD + rows, PAD + columns])


def test_doubts_fade_where_two_cameras_expect_wrong_ranges():
    grid = stereo()._method.views.grid
    begin, end = TUNING.use.expected_wrong
    counts = []
    for wrong in (begin / 2, (begin + end) / 2, 2 * end):
        odds = np.full(grid.shape, -5.0, F4)  # nodes without a range do not count
        odds[::2] = np.log(1 / wrong - 1)
        verdict = Verdict(odds, odds, np.zeros(grid.shape, np.uint8))
        counts.append(Fusion(grid).demanding(verdict))
    np.testing.assert_allclose(counts, [1, 0.5, 0], atol=1e-3)
    nothing = Verdict(odds, np.full(grid.shape, -5.0, F4), np.zeros(grid.shape, np.uint8))
    assert Fusion(grid).demanding(nothing) == 1


def test_what_shares_the_left_image_is_less_certain_where_doubts_have_faded():
    fusion = Fusion(stereo()._method.views.grid)
    kept = TUNING.use.kept_certainty
    assert kept < 1
    np.testing.assert_allclose(fusion.certainty(F4(1)), 1)  # pairs that two cameras know well
    np.testing.assert_allclose(fusion.certainty(F4(0))[[AGREE, FIRM, APART]], [kept, 1, kept])
    np.testing.assert_allclose(fusion.certainty(F4(0.5))[AGREE], (1 + kept) / 2)


def colored_nodes():
    """Return colors, light, map, variances and which are known, of a small grid."""
    rng = np.random.default_rng(8)
    light, variance = rng.random((3, 24, 32)).astype(F4), rng.uniform(1, 2, (24, 32)).astype(F4)
    colors = (np.eye(3, 4) + rng.uniform(0, 0.1, (3, 4))).astype(F4)
    known = rng.random((24, 32)) < 0.6
    u, v = chromaticity(mixed(colors, light) * np.array(RED, F4)[:, None, None])
    light[:, ~known] = np.nan
    return (u, v, F4(1e-4) * variance, light, known, colors), rng


def test_normal_equations_of_colors_are_those_of_their_rows():
    rng = np.random.default_rng(3)
    u, v = rng.uniform(-0.5, 0.5, (2, 40)).astype(F4)
    light, weight = rng.random((3, 40)).astype(F4), rng.uniform(1, 2, 40)
    colors, normal = np.eye(3, 4) + 0.1, np.empty((12, 12))
    color_equations(u, v, light, weight, colors, 0.02, normal)
    p = np.vstack([light, np.ones(40)]).astype(float)
    size, root = np.sqrt(weight) / np.sum(colors @ p, axis=0), 3 ** 0.5
    u, v = u.astype(float), v.astype(float)
    rows = [np.vstack([each * p for each in three]) * size for three in (
        (u - 2.0, u + 1.0, u + 1.0), (v, v - root, v + root))]
    np.testing.assert_allclose(normal, sum(each @ each.T for each in rows), rtol=1e-9)


def test_slopes_of_colors_are_differences_and_their_steps_solve_them():
    (u, v, variance, light, known, colors), rng = colored_nodes()
    change = rng.uniform(-0.3, 0.3, (3, 24, 32)).astype(F4)
    sums, error = np.empty((9, 24, 32), F4), np.empty((24, 32), F4)
    color_slopes(u, v, variance, light, known, colors, change, sums)
    color_errors(u, v, variance, light, known, colors, change, error)

    def predicted(changes, at):
        r, g, b = colors[:, :3] @ light[(..., *at)].astype(float) + colors[:, 3]
        r, b = r * np.exp(changes[0]), b * np.exp(changes[1])
        return np.exp(changes[2]) * np.array([2 * r - g - b, 3 ** 0.5 * (g - b)]) / (r + g + b)

    upper = np.triu_indices(3)
    for at in np.ndindex(24, 32):
        if not known[at]:
            assert not sums[(..., *at)].any() and error[at] == 0
            continue
        here = change[(..., *at)].astype(float)
        slopes = np.array([predicted(here + step, at) - predicted(here - step, at)
                           for step in 1e-5 * np.eye(3)]) / 2e-5
        apart = np.array([u[at], v[at]]) - predicted(here, at)
        chi = apart @ apart / variance[at]
        weight = 1 / variance[at] / (1 + chi / TUNING.color.robust_misfit)
        expected = weight * np.append((slopes @ slopes.T)[upper], slopes @ apart)
        np.testing.assert_allclose(sums[(..., *at)], expected, rtol=2e-3,
                                   atol=1e-4 * np.abs(expected).max())
        assert error[at] == pytest.approx(chi, rel=1e-3, abs=1e-3)
    limits, before = np.array([[-0.4, 0.4], [-0.4, 0.4], [-0.2, 0.2]], F4), change.copy()
    solve_changes(sums, F4(5), limits, change)
    for at in np.ndindex(24, 32):
        normal = np.zeros((3, 3))
        normal[upper] = sums[:6][(..., *at)]
        normal = normal + np.triu(normal, 1).T + 5 * np.eye(3)
        step = np.linalg.solve(normal, sums[6:][(..., *at)])
        np.testing.assert_allclose(change[(..., *at)], np.clip(
            before[(..., *at)] + step, *limits.T), atol=1e-3)


def test_the_color_of_a_surface_is_measured_where_places_are_known():
    (u, v, variance, light, known, colors), _ = colored_nodes()
    local, error = local_light(u, v, light, colors, variance, known)
    assert np.median(local[0][known]) == pytest.approx(RED[0] / RED[1], rel=0.05)
    assert np.median(local[1][known]) == pytest.approx(RED[2] / RED[1], rel=0.05)
    assert np.median(error[known]) < 1


def test_the_evidence_of_a_plane_is_what_its_neighbors_say():
    rng = np.random.default_rng(7)
    rows, columns = 6, 9
    shape = rows + 2 * PAD, columns + 2 * PAD
    d, cost, variance, misfit = rng.uniform(0.1, 3, (4, *shape)).astype(F4)
    a, b = rng.uniform(-0.2, 0.2, (2, *shape)).astype(F4)
    d[PAD + 2, PAD + 3] = misfit[PAD + 4, PAD + 4] = np.nan
    treated = rng.random((rows, columns)) < 0.6
    own, steps = np.zeros((4, rows, columns), F4), np.zeros((2, rows, columns), F4)
    gather_evidence(d, a, b, cost, variance, misfit, treated, own, steps)
    for row, column in np.ndindex(rows, columns):
        y, x = row + PAD, column + PAD
        away = [float(d[y + j, x + i] - d[y, x] - i * a[y, x] - j * b[y, x])
                for j, i in ((0, 1), (0, -1), (1, 0), (-1, 0))]
        away = [min(max(each, -2), 2) if each == each else 2 for each in away]
        np.testing.assert_allclose(
            steps[:, row, column], [max(max(away), 0) ** 0.5, max(-min(away), 0) ** 0.5],
            atol=1e-3)
        near = np.fmin(misfit[y - 1:y + 2, x - 1:x + 2], TUNING.use.misfit_cap)
        expected = np.sqrt([cost[y, x], near.mean(), variance[y, x] ** 0.5,
                            np.mean(np.abs(away))]) if treated[row, column] else np.zeros(4)
        np.testing.assert_allclose(own[:, row, column], expected, atol=1e-3)


def test_places_of_nodes_are_those_of_the_sweep():
    given = nodes()
    out = np.empty((2, 6, 10), F4)
    places_of_nodes(given['sweep'], given['d'], 2, out)
    expected = naive_sweep.place(given['sweep'], 2 * 2 * 3 + 0.5, 2 * 2 * 4 + 0.5,
                                 given['d'][PAD + 8, PAD + 6])[0]
    np.testing.assert_allclose(out[:, 4, 3], expected, rtol=1e-5)


def test_nothing_compiles_after_a_projector_is_taken():
    rig = ColorStereo(CALIBRATION, settings())
    rig.use_projector(projector())
    kernels = (mixed_errors, sparse_misfits, around_sparse, color_equations, color_errors,
               color_slopes, solve_changes, decide, sort_nodes,
               gather_evidence, weigh_forms, cells_of_nodes, claim_cells, find_contested,
               anchor_nodes, best_windows, count_nodes, fit_region, list_nodes, linearize_sweep,
               seed_unknown, spread_planes,
               paths_along_columns, sweep_costs, paths_along_rows, places_of_nodes, sum_windows,
               sweep_misfits, take_best, cheapest_disparities, put_nodes, shorten_list,
               window_means, find_known, find_region, reduce_firm, tiles_with, find_treated,
               bound_odds, expected_wrong, spread_views, choose_sites, predict_patches)
    before = [len(kernel.signatures) for kernel in kernels]
    result = rig.process(*pair())
    assert (result.views & 2).any()
    assert before == [len(kernel.signatures) for kernel in kernels] and min(before) > 0
