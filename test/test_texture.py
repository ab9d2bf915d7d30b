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
"""The search for texture over all disparities."""

from types import SimpleNamespace

from color_stereo_ros.core import PatternSettings, Settings
from color_stereo_ros.core.compiled import Arena
from color_stereo_ros.core.constants import replaced
from color_stereo_ros.core.patterns.expectation import Expectation
from color_stereo_ros.core.surface.brightness import BrightnessCarrier
from color_stereo_ros.core.surface.coarse import Seeds
from color_stereo_ros.core.surface.contest import Contest
from color_stereo_ros.core.surface.grid import HalfGrid
from color_stereo_ros.core.surface.grid_kernels import F4, PAD
from color_stereo_ros.core.surface.planes import PlaneField
from color_stereo_ros.core.surface.texture import (
    between_nodes, clear_share, details_show, drop_small_surfaces, likeness, more_alike,
    TextureSearch)
from color_stereo_ros.core.surface.trust import Trust
from color_stereo_ros.core.surface.trust_kernels import APART
from color_stereo_ros.core.surface.tuning import detailed_tuning, TUNING, tuning_for

import cv2

import numpy as np

import pytest

ROWS, COLUMNS = 60, 100


def views_of(disparity):
    """Return views of a gray plane of random texture."""
    rng = np.random.default_rng(5)
    light = rng.uniform(50, 250, (ROWS, 2 * COLUMNS + 1024))
    light = 150 + 3 * (cv2.GaussianBlur(light, (0, 0), 1.5) - 150)
    start = 500
    grid = HalfGrid(2 * ROWS, 2 * COLUMNS)
    left, right = np.zeros(grid.shape, F4), np.zeros((grid.shape[0], grid.width), F4)
    left[grid.inner] = light[:, start:start + 2 * COLUMNS:2]
    right[PAD:PAD + ROWS] = light[:, start + disparity:start + disparity + grid.width]
    return grid, SimpleNamespace(
        left=SimpleNamespace(u=left, v=left, s=left, inside=left > 0, columns_per_node=1),
        right=SimpleNamespace(u=right, v=right, s=right, inside=right > 0, columns_per_node=2))


@pytest.mark.parametrize('disparity', [-7, 0, 13])
@pytest.mark.parametrize('limits', [(-10, 20), (-150, 140)])
def test_disparities_of_texture_are_found_in_pixels(limits, disparity):
    grid, views = views_of(disparity)
    found = 2 * TextureSearch(grid, limits, TUNING).search(views, True).disparity
    assert found.shape == grid.nodes
    middle = found[5:-5, 15:-15]
    assert np.mean(np.abs(middle - disparity) < 0.5) > 0.99


@pytest.mark.parametrize('disparity', [-7, 13])
def test_a_small_pair_tells_which_disparities_are_searched(disparity):
    grid, views = views_of(disparity)
    search = TextureSearch(grid, (-150, 140), TUNING)
    images = [search.image(view, 1, True) for view in (views.left, views.right)]
    first, count = search.narrowed(images)
    assert first + 5 < disparity < first + count - 5
    assert count < search.count / 3


def test_dark_places_do_not_widen_what_is_searched():
    grid, views = views_of(13)
    search = TextureSearch(grid, (-150, 140), TUNING)
    images = [search.image(view, 1, True) for view in (views.left, views.right)]
    for image in images:
        image[:20] = 0
    first, count = search.narrowed(images)
    assert first + 5 < 13 < first + count - 5
    assert count < search.count / 3


def test_what_is_not_alike_counts_for_nothing():
    rng = np.random.default_rng(6)
    left = rng.integers(0, 255, (20, 30, 3)).astype(np.uint8)
    right = left.copy()
    right[:, 15:] = rng.integers(0, 255, (20, 15, 3))
    disparity = np.zeros((20, 30), F4)
    disparity[0, 0] = np.nan
    found = likeness((left, right), disparity, 5)
    assert np.isnan(found[0, 0])
    assert np.all(found[3:-3, 3:12] > 0.99)
    assert np.abs(found[:, 18:]).max() < 0.8
    assert np.abs(likeness((0 * left, 0 * right), disparity, 5)[3:-3, 3:-3]).max() == 0


def test_likeness_is_the_correlation_of_the_windows():
    rng = np.random.default_rng(7)
    left, right = (rng.integers(0, 255, (12, 20, 3)).astype(np.uint8) for _ in range(2))
    right[:, 2:] = right[:, 2:] // 2 + left[:, :-2] // 2
    disparity = rng.integers(-3, 4, (12, 20)).astype(F4)
    found = likeness((left, right), disparity, 5)
    for y, x in ((2, 2), (5, 9), (9, 17)):
        windows = np.zeros((2, 25, 3))
        for n, (j, i) in enumerate(np.ndindex(5, 5)):
            row, column = y + j - 2, x + i - 2
            place = np.clip(column - int(disparity[row, column]), 0, 19)
            windows[:, n] = left[row, column], right[row, place]
        apart = (windows - windows.mean(axis=1, keepdims=True)).reshape(2, -1)
        expected = apart[0] @ apart[1] / np.sqrt((apart ** 2).sum(axis=1).prod())
        np.testing.assert_allclose(found[y, x], expected, atol=1e-4)


def test_small_surfaces_are_dropped():
    disparity = np.full((12, 12), np.nan, F4)
    disparity[2:4, 2:6], disparity[6:9, 2:6] = 20, -3.5  # 8 and 12 px
    drop_small_surfaces(disparity, 8)
    assert np.isnan(disparity[:5]).all()
    np.testing.assert_array_equal(disparity[6:9, 2:6], -3.5)


def test_between_two_nodes_lies_their_mean():
    image = np.array([[[10, 0], [20, 4], [40, 4]]], np.uint8)
    expected = [[10, 0], [15, 2], [20, 4], [30, 4], [40, 4], [40, 4]]
    np.testing.assert_array_equal(between_nodes(image), [expected])


def flat_pair():
    """Return images of random texture at 6 px, and disparities of half of their columns."""
    rng = np.random.default_rng(3)
    right = rng.integers(20, 200, (40, 120, 3)).astype(np.uint8)
    disparities = (np.full((40, 60), value, np.float32) for value in (6, 11, np.nan))
    return (np.roll(right, 6, axis=1), right), *disparities


INSIDE = np.s_[8:-8, 16:-16]


def test_the_more_alike_match_counts_where_one_search_is_better_overall():
    """What the worse search has alone counts there, too."""
    images, true, wrong, unknown = flat_pair()
    for pair in (true, wrong), (wrong, true), (true, unknown):
        found, alike = more_alike(images, *pair, TUNING.brightness)
        assert (found[INSIDE] == 6).all() and (alike[INSIDE] > 0.99).all()
    slightly = replaced(TUNING, {'brightness.clearly_alike': 2.0}).brightness
    assert (more_alike(images, true, wrong, slightly)[0][INSIDE] == 6).all()
    half = true.copy()
    half[:, 30:] = np.nan
    found, _ = more_alike(images, wrong, half, TUNING.brightness)
    assert (found[:, 16:28] == 6).all() and (found[INSIDE][:, 20:] == 11).all()


def test_the_evened_search_counts_where_none_is_better_overall():
    """Pieces of a search that is no better win by chance; a lone match must be alike."""
    images, true, wrong, unknown = flat_pair()
    tuning = replaced(TUNING, {'brightness.least_better': 2.0}).brightness
    assert (more_alike(images, true, wrong, tuning)[0][INSIDE] == 11).all()
    assert (more_alike(images, true, unknown, tuning)[0][INSIDE] == 6).all()
    assert np.isnan(more_alike(images, wrong, unknown, tuning)[0][INSIDE]).all()


def test_detail_shows_where_half_of_the_nodes_have_it():
    nothing, some = np.full(60, 0.1), np.full(41, 0.4)
    assert details_show(np.concatenate([nothing[:40], some]), F4(0), TUNING.brightness)
    assert not details_show(np.concatenate([nothing, some]), F4(0), TUNING.brightness)
    assert details_show(nothing, np.full(60, 0.4), TUNING.brightness)
    assert not details_show(nothing[:0], nothing[:0], TUNING.brightness)


@pytest.mark.parametrize('noise', [0.02, 0.1])
def test_detail_shows_against_the_noise_of_the_pair(noise):
    """Metal as photographed: three quarters of the nodes have twice the detail of the quietest."""
    quiet, fine = np.full(20, noise), np.full(80, 2.5 * noise)
    assert details_show(np.concatenate([quiet, fine]), F4(0), TUNING.brightness)
    assert not details_show(np.concatenate([quiet, fine]), F4(0), TUNING.brightness, quiet=False)
    assert not details_show(np.concatenate([quiet, quiet, fine]), F4(0), TUNING.brightness)


def test_quantization_is_no_detail():
    """Colors have no part in that: those of a slow pattern change more than noise everywhere."""
    found = np.concatenate([np.full(10, 1e-5), np.full(90, 1e-2)])
    assert not details_show(found, np.linspace(0.01, 0.29, 100), TUNING.brightness)


def test_views_of_one_scene_are_alike_and_those_of_two_are_not():
    grid, views = views_of(13)
    search = TextureSearch(grid, (-10, 20), TUNING)
    assert search.search(views, True).alike_share > 0.8
    views.right.s = views.right.u = views.right.v = np.ascontiguousarray(views.right.s[::-1])
    assert search.search(views, True).alike_share < 0.1


def planes_beside_seeds(likeness, plane=13.4, seed=13):
    """Return planes without information, a carrier of seeds beside them, and the seeds."""
    grid, views = views_of(13)
    planes = PlaneField(grid, 1.0, True, Arena())
    for array, value in ((planes.d, plane), (planes.a, 0.1), (planes.b, 0),
                         (planes.variance, np.inf)):
        array[grid.inner] = value
    views.grid = grid
    carrier = BrightnessCarrier(views, TUNING, Arena())
    found = np.full(grid.nodes, seed / 2, F4)
    seeds = Seeds(found, 1, None, 0.0, likeness=np.full(grid.nodes, likeness, F4))
    carrier.rely_on(seeds, grid)
    return planes, carrier, seeds


@pytest.mark.parametrize('likeness, believed', [(0.9, True), (0.2, False), (np.nan, False)])
def test_a_plane_without_information_is_as_good_as_its_seed_where_views_are_alike(
        likeness, believed):
    planes, carrier, seeds = planes_beside_seeds(likeness)
    grid = planes.grid
    carrier.claims(grid)
    carrier.settle(planes, seeds)
    variance = planes.variance[grid.inner]
    if believed:
        np.testing.assert_allclose(variance, TUNING.brightness.uninformed_std ** 2)
    else:
        assert np.isinf(variance).all()
    np.testing.assert_allclose(planes.d[grid.inner], 13.4, rtol=1e-6)


@pytest.mark.parametrize('plane, seed', [(16, 13), (13, 16), (np.nan, 13)])
def test_a_seed_replaces_a_plane_only_where_it_fits_better(plane, seed):
    planes, carrier, seeds = planes_beside_seeds(0.9, plane, seed)
    grid, views = views_of(13)
    planes.a[grid.inner] = 0
    search = TextureSearch(grid, (-10, 20), TUNING)
    search.search(views, True)
    Contest(grid, TUNING, Arena()).hold(planes, search.compared, np.zeros(grid.nodes, F4),
                                        carrier.claims(grid))
    carrier.settle(planes, seeds)
    middle = np.s_[5:-5, 15:-15]
    assert np.mean(np.abs(planes.d[grid.inner][middle] - 13) < 0.01) > 0.99
    odds = TUNING.brightness.agreement_odds if seed == 13 else 0
    assert np.mean(carrier.confirmed(planes)[middle] == odds) > 0.99


def test_seeds_replace_nothing_where_they_point_beyond_the_right_view():
    planes, carrier, _ = planes_beside_seeds(0.9)
    grid = planes.grid
    beyond = 2 * np.arange(grid.columns) - 13 < TUNING.brightness.disputed_border
    claims = carrier.claims(grid)[grid.inner]
    assert beyond.any() and np.isnan(claims[:, beyond]).all()
    assert (claims[:, ~beyond] == 13).all()


def test_seeds_add_to_the_odds_of_planes_that_they_confirm():
    planes, carrier, seeds = planes_beside_seeds(0.9)
    grid, odds = planes.grid, TUNING.brightness.agreement_odds
    carrier.claims(grid)
    carrier.settle(planes, seeds)
    planes.d[grid.inner][:10] += 2
    confirmed = carrier.confirmed(planes)
    assert (confirmed[:10] == -odds).all() and (confirmed[10:] == odds).all()


@pytest.mark.parametrize('coarse, more', [(16, True), (13, False), (np.nan, True)])
def test_the_search_for_texture_counts_where_it_finds_more(coarse, more):
    grid, views = views_of(13)
    search = TextureSearch(grid, (-10, 20), TUNING)
    found = search.search(views, True)
    planes = PlaneField(grid, 1.0, True, Arena())
    planes.d[grid.inner] = coarse
    assert search.finds_more(found, planes) is more


def test_detail_may_show_where_it_is_clear_at_many_nodes():
    rng = np.random.default_rng(1)
    brightness = np.concatenate([rng.uniform(0.01, 0.02, 30), rng.uniform(0.1, 0.2, 70)])
    assert clear_share(brightness, TUNING.brightness) == 0.7
    assert clear_share(brightness[:0], TUNING.brightness) == 0


def test_discord_takes_little_from_nodes_whose_surroundings_are_alike():
    """All planes contradict their neighbors; the right half of the nodes is alike in both."""
    grid, _ = views_of(13)
    detailed = detailed_tuning(tuning_for(Expectation.of(PatternSettings(type='unknown')), 640))
    trust = Trust(grid, np.array([0, 40], F4), Settings(), detailed, Arena())
    planes = PlaneField(grid, 1.0, True, Arena())
    planes.variance[grid.inner] = 0.01
    trust.evidence[APART] = 2
    before = np.tile(np.array([-1, 0.5, 1.5, 4], F4), (grid.rows, grid.columns // 4))
    alike = np.zeros(grid.nodes, bool)
    alike[:, grid.columns // 2:] = True
    trust.log_odds[grid.inner] = before
    trust.distrust_discord(planes, 0.45, alike)
    found, least = trust.log_odds[grid.inner], detailed.trust.alike_odds
    held = alike & (before >= least)
    np.testing.assert_allclose(found[held], least)
    np.testing.assert_allclose(found[~held], (before - detailed.trust.discord_odds)[~held],
                               rtol=1e-5)
