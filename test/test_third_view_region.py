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
"""Kernels of the third view that choose nodes, and what they measure in colors and patches."""

from color_stereo_ros.core.projector.patch_kernels import choose_sites, predict_patches
from color_stereo_ros.core.projector.patches import Sites
from color_stereo_ros.core.status_codes import VALID
from color_stereo_ros.core.surface.grid import tiles_of
from color_stereo_ros.core.surface.grid_kernels import (
    PAD, SILENT_VARIANCE, TILE_COLUMNS, TILE_ROWS)
from color_stereo_ros.core.surface.third.color_kernels import MOST_RADIUS, window_means
from color_stereo_ros.core.surface.third.fusion_kernels import (
    bound_odds, expected_wrong, find_treated, spread_views)
from color_stereo_ros.core.surface.third.region_kernels import (
    find_known, find_region, reduce_firm, tiles_with)
from color_stereo_ros.core.surface.third.sweep import (
    lens_change, places, prepared_for, straightened, sweep_matrix)
from color_stereo_ros.core.surface.third.tuning import TUNING
from color_stereo_ros.core.surface.third.view import least_firm
import numpy as np
from projected import CALIBRATION, LIMITS, projector
import pytest

F4 = np.float32
ROWS, COLUMNS = 11, 70
SHAPE = ROWS + 2 * PAD, COLUMNS + 2 * PAD
INNER = np.s_[PAD:PAD + ROWS, PAD:PAD + COLUMNS]


def framed(values):
    """Return an array of nodes with a frame of zeros."""
    out = np.zeros(SHAPE, values.dtype)
    out[INNER] = values
    return out


def test_firm_nodes_are_known_and_fit_the_pattern():
    rng = np.random.default_rng(1)
    odds, witness = (framed(rng.uniform(0, 10, (ROWS, COLUMNS)).astype(F4)) for _ in range(2))
    firm, counts = np.zeros(SHAPE, bool), np.empty((ROWS, 2), F4)
    find_known(odds, witness, COLUMNS, F4(2), F4(7), firm, counts)
    known = odds[INNER] > 2
    expected = known & (witness[INNER] < 7)
    np.testing.assert_array_equal(firm, framed(expected))
    np.testing.assert_array_equal(counts, np.column_stack([known.sum(1), expected.sum(1)]))


def test_the_region_is_what_is_lit_and_not_firm():
    rng = np.random.default_rng(2)
    gain = np.exp(-rng.uniform(1, 6, (ROWS, COLUMNS))).astype(F4)
    s = framed(np.exp(rng.uniform(-1, 6, (ROWS, COLUMNS))).astype(F4))
    variance = framed(rng.choice([0.1, SILENT_VARIANCE], (ROWS, COLUMNS)).astype(F4))
    firm, region = framed(rng.random((ROWS, COLUMNS)) < 0.3), np.ones(SHAPE, bool)
    dim = np.empty((ROWS, COLUMNS), F4)
    find_region(gain, s, variance, firm, F4(2.5), dim, region)
    expected = np.clip(-np.log(np.maximum(s[INNER], 1) * gain), 0, TUNING.use.most_dim)
    np.testing.assert_allclose(dim, expected, atol=2e-4)
    lit = (variance[INNER] < SILENT_VARIANCE) & (s[INNER] > 1) & (dim < 2.5)
    np.testing.assert_array_equal(region[INNER], lit & ~firm[INNER])


# firm nodes and nodes of the region of 16, all others are dark; whether the coarse one is known,
# searched, and firm as a whole
COARSE_NODES = (
    (0, 0, False, False, False), (0, 1, False, True, False), (0, 12, False, True, False),
    (0, 16, False, True, False), (3, 0, False, False, False), (3, 1, False, True, False),
    (3, 13, False, True, False), (4, 12, True, False, False), (15, 1, True, False, False),
    (16, 0, True, False, True))


def test_a_coarse_node_is_searched_if_it_needs_a_seed_and_too_few_nodes_are_firm():
    factor, h, w = 4, 2, len(COARSE_NODES) // 2
    rng, least = np.random.default_rng(13), least_firm(factor)
    firm, region = (np.zeros(SHAPE, bool) for _ in range(2))
    for n, (firm_count, region_count, *_) in enumerate(COARSE_NODES):
        y, x = (PAD + factor * index for index in divmod(n, w))
        kinds = rng.permutation(np.repeat([1, 2, 0], [firm_count, region_count,
                                                      16 - firm_count - region_count]))
        block = kinds.reshape(factor, factor)
        firm[y:y + factor, x:x + factor] = block == 1
        region[y:y + factor, x:x + factor] = block == 2
    known, (wanted, whole) = np.empty((h, w), F4), np.empty((2, h, w), bool)
    reduce_firm(firm, region, np.full(SHAPE, 6, F4), factor, least, known, wanted, whole)
    for expected, told in zip(list(zip(*COARSE_NODES))[2:], (known == 6, wanted, whole)):
        np.testing.assert_array_equal(told.ravel(), expected)


@pytest.mark.parametrize('factor', [2, 3])
def test_what_is_known_of_a_coarse_node_is_the_mean_of_its_firm_nodes(factor):
    rng = np.random.default_rng(3)
    h, w, least = ROWS // factor, COLUMNS // factor, least_firm(factor)
    firm, region = (framed(rng.random((ROWS, COLUMNS)) < 0.6) for _ in range(2))
    firm[PAD:PAD + factor, PAD:PAD + factor] = True
    region &= ~firm
    d = framed(rng.uniform(3, 9, (ROWS, COLUMNS)).astype(F4))
    known, (wanted, whole) = np.empty((h, w), F4), np.empty((2, h, w), bool)
    reduce_firm(firm, region, d, factor, F4(least), known, wanted, whole)
    for y, x in np.ndindex(h, w):
        at = np.s_[PAD + y * factor:PAD + (y + 1) * factor,
                   PAD + x * factor:PAD + (x + 1) * factor]
        there = firm[at].sum() >= least
        expected = d[at][firm[at]].mean() if there else np.nan
        assert known[y, x] == pytest.approx(expected, rel=1e-5, nan_ok=True)
        assert not (wanted[y, x] and there)
    assert np.isfinite(known).any() and np.isnan(known).any()


def test_tiles_with_some_of_the_nodes_are_found():
    shape = 2 * PAD + 2 * TILE_ROWS, 2 * PAD + 3 * TILE_COLUMNS
    tiles, nodes = tiles_of(shape), np.zeros(shape, bool)
    nodes[PAD + TILE_ROWS, PAD + TILE_COLUMNS - 1] = nodes[PAD - 1, PAD] = True
    some = np.empty(len(tiles), bool)
    tiles_with(nodes, tiles, some)
    expected = [nodes[y:y + TILE_ROWS, x:x + TILE_COLUMNS].any() for y, x in tiles]
    np.testing.assert_array_equal(some, expected)
    assert some.sum() == 1


def test_treated_nodes_have_a_plane_and_bounded_log_odds():
    rng = np.random.default_rng(4)
    region = rng.random(SHAPE) < 0.7
    d = rng.choice([3, np.nan], SHAPE).astype(F4)
    variance = rng.choice([0.1, np.inf, np.nan], SHAPE).astype(F4)
    treated = np.empty((ROWS, COLUMNS), bool)
    find_treated(region, d, variance, treated)
    expected = (region & np.isfinite(d) & np.isfinite(variance))[INNER]
    np.testing.assert_array_equal(treated, expected)
    odds = rng.normal(0, 12, (ROWS, COLUMNS)).astype(F4)
    low, high = TUNING.use.odds_limits
    limited = np.where(treated, np.clip(odds, low, high), low)
    bound_odds(treated, odds)
    np.testing.assert_array_equal(odds, limited.astype(F4))


def test_the_expected_share_of_wrong_nodes_is_that_of_their_log_odds():
    odds = np.random.default_rng(5).normal(0, 3, (ROWS, COLUMNS)).astype(F4)
    told = odds[::4, ::4]
    told = told[told > 0]
    assert expected_wrong(odds, 4) == pytest.approx(np.mean(1 / (1 + np.exp(told))), rel=1e-3)
    assert expected_wrong(-np.abs(odds), 4) == 0


@pytest.mark.parametrize('more', [(0, 0), (1, 1)])
def test_pixels_are_seen_by_whom_their_node_is(more):
    rng = np.random.default_rng(6)
    views = framed(rng.integers(1, 4, (ROWS, COLUMNS)).astype(np.uint8))
    height, width = 2 * ROWS + more[0], 2 * COLUMNS + more[1]
    status = rng.choice(np.array([VALID, VALID + 1], np.uint8), (height, width))
    out = np.full_like(status, 9)
    spread_views(views, status, out)
    for v, u in np.ndindex(height, width):
        node = views[PAD + min(v // 2, ROWS - 1), PAD + min(u // 2, COLUMNS - 1)]
        assert out[v, u] == (node if status[v, u] == VALID else 0)


@pytest.mark.parametrize('radius', [1, MOST_RADIUS])
def test_window_means_take_what_lies_outside_as_0(radius):
    planes = np.random.default_rng(7).random((2, 9, 130)).astype(F4)
    out = np.empty_like(planes)
    window_means(planes, radius, out)
    wide = np.pad(planes, ((0, 0), (radius, radius), (radius, radius)))
    side = 2 * radius + 1
    expected = sum(wide[:, j:j + 9, i:i + 130] for j in range(side) for i in range(side))
    np.testing.assert_allclose(out, expected / side ** 2, rtol=1e-4)


def test_predicted_patches_are_projections_and_their_differences():
    rng, model = np.random.default_rng(8), projector(distortion=0.05)
    points = rng.uniform(-0.1, 0.1, (20, 3)) + [0, 0, 0.5]
    slopes = rng.normal(0, 1e-3, (20, 2, 3))
    start, shape = np.empty((20, 2)), np.empty((20, 2, 2))
    predict_patches(points, slopes, model.camera_matrix, model.rotation, model.translation,
                    model.distortion, start, shape)
    np.testing.assert_allclose(start, np.column_stack(model.project(points)), rtol=1e-9)
    for axis in range(2):
        ends = (np.column_stack(model.project(points + sign * slopes[:, axis]))
                for sign in (1, -1))
        np.testing.assert_allclose(shape[:, :, axis], np.subtract(*ends) / 2, atol=1e-9)
    points[0, 2] = -1
    predict_patches(points, slopes, model.camera_matrix, model.rotation, model.translation,
                    model.distortion, start, shape)
    assert np.isnan(start[0]).all() and np.isfinite(start[1:]).all()


def test_sites_are_trusted_pixels_of_smooth_surfaces():
    rng = np.random.default_rng(9)
    depth = (0.5 + rng.choice([0, 0, 0, 0, 2e-4, 0.1], (40, 60))).astype(F4)
    depth[rng.random((40, 60)) < 0.05] = np.nan
    confidence = rng.random((40, 60)).astype(F4)
    rows, columns, reach, scale = np.arange(5, 35, 3), np.arange(5, 55, 4), 4, 40.0
    pixels, inverse = np.empty((200, 2), np.int32), np.empty((200, 5))
    count = choose_sites(depth, confidence, rows, columns, reach, scale, 0.3, 0.5, 0.2, pixels,
                         inverse)
    expected = []
    for y in rows:
        for x in columns:
            w = [1 / float(depth[y + j, x + i])
                 for j, i in ((0, 0), (0, -reach), (0, reach), (-reach, 0), (reach, 0))]
            bends = abs(w[1] + w[2] - 2 * w[0]), abs(w[3] + w[4] - 2 * w[0])
            leans = abs(w[2] - w[1]), abs(w[4] - w[3])
            if confidence[y, x] > 0.3 and all(bend * scale < 0.5 for bend in bends) and all(
                    lean * scale < 2 * reach * 0.2 for lean in leans):
                expected.append((x, y, *w))
    assert 10 < count == len(expected)
    np.testing.assert_allclose(np.hstack([pixels, inverse])[:count], expected, rtol=1e-12)


def test_some_sites_are_evenly_chosen():
    every = Sites(np.arange(20).reshape(10, 2), *(np.zeros((10, 1)) for _ in range(3)))
    np.testing.assert_array_equal(every.some(4).pixels[:, 0], [0, 4, 10, 14])
    assert every.some(10) is every


def test_a_lens_that_changes_a_little_keeps_the_images_and_the_places():
    geometry = CALIBRATION.geometry
    old, new = projector(distortion=0.01), projector(distortion=0.0108)
    change, apart = lens_change(new, old)
    assert 0 < apart < TUNING.sweep.prepared_places
    assert prepared_for(new, old, geometry, LIMITS) is old
    assert prepared_for(projector(distortion=0.05), old, geometry, LIMITS) is not old
    v, u = np.mgrid[:384, :512].astype(F4)
    ramp = np.stack([u, v, u + v], axis=-1)
    sweep, (x, y, d) = sweep_matrix(new, geometry), (150.5, 110.5, 12.0)
    shown = []
    for matrix, lens in ((sweep, new), (change @ sweep, old)):
        at = np.array(places(matrix, x, y, d))
        i, j = np.floor(at).astype(int)
        s, t = at - (i, j)
        part = straightened(ramp, lens)[j:j + 2, i:i + 2, :2]
        shown.append(np.einsum('j,i,jic->c', [1 - t, t], [1 - s, s], part))
    # OpenCV places to 1/32 px
    np.testing.assert_allclose(*shown, atol=TUNING.sweep.prepared_places + 0.06)
