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
The compiled kernels of the surface method against their loop-only twins.

Kernels compute in float32, twins in float64: 1e-4 relative, or as stated.

"""

import ast
import math
import os
from pathlib import Path
import subprocess
import sys

from color_stereo_ros.core import Settings, Status
from color_stereo_ros.core.compiled import Arena, band, BANDS, LENGTH
from color_stereo_ros.core.constants import replaced
from color_stereo_ros.core.surface import planes as surface_planes, raw_kernels
from color_stereo_ros.core.surface.bend_kernels import (
    find_bent_tiles, unbend, write_pulls)
from color_stereo_ros.core.surface.coarse import CoarseSearch, half_way
from color_stereo_ros.core.surface.coarse_kernels import (
    add_turned, count_rivals, GUARD_COST, LARGEST, reduce_colors, rival_gaps, seed_planes, winners)
from color_stereo_ros.core.surface.grid import tiles_of
from color_stereo_ros.core.surface.grid_kernels import (
    PAD, SILENT_VARIANCE, TILE_COLUMNS, TILE_ROWS)
from color_stereo_ros.core.surface.neighbor_kernels import HALO, PATCH_MARGIN, propagate
from color_stereo_ros.core.surface.pixel_kernels import expand
from color_stereo_ros.core.surface.plane_kernels import (
    find_smooth_tiles, fit_planes, linearize, RADIUS, WIDE_RADIUS)
from color_stereo_ros.core.surface.quality_kernels import sample_quality
from color_stereo_ros.core.surface.raw_faults import read_only
from color_stereo_ros.core.surface.row_kernels import moved_rows, row_cells
from color_stereo_ros.core.surface.step_kernels import lower_beside_steps
from color_stereo_ros.core.surface.texture_kernels import (
    add_seeds, linearize_brightness, local_colors)
from color_stereo_ros.core.surface.trust_kernels import (
    brightness_balance, distrust_islands, find_hidden, HOPELESS_ODDS, ISLAND_ODDS, join_nodes,
    MISFIT_CAP, rescale_std, root_of, settle, UNKNOWN_ODDS, weigh_evidence)
from color_stereo_ros.core.surface.tuning import TUNING
from color_stereo_ros.core.surface.view_kernels import (
    add_color_sums, average_alike, box_sums, channel_levels, sample_colors)
import naive_surface as naive
import numpy as np
import pytest

F4, I2 = np.float32, np.int16
ROWS, COLUMNS = 13, 41            # no multiples of a tile
SHAPE = (2 * PAD + 2 * TILE_ROWS, 2 * PAD + 2 * TILE_COLUMNS)
WIDTH = 2 * COLUMNS
INNER = np.s_[PAD:PAD + ROWS, PAD:PAD + COLUMNS]
TILES = tiles_of(SHAPE)
SOFT, NOISE = F4(TUNING.views.softening), tuple(F4(each) for each in TUNING.views.noise)
PSF = F4(1.2)  # px^2
ROBUST, STEEPEST = F4(TUNING.planes.robust_misfit), F4(TUNING.planes.steepest)
TRUNCATION = F4(TUNING.neighbors.misfit_cap)
JOINED_DISTANCE = F4(TUNING.trust.joined_distance)
HIDDEN_DISTANCE = F4(TUNING.trust.hidden_distance)
FORM = np.array(TUNING.trust.form, F4)
NO_BRIGHTNESS = (np.zeros((0, 0), F4),) * 4 + (F4(1),)
MATRIX = np.array([[1.1, 0.05, 0.02], [-0.04, 0.9, -0.03]], F4)


def framed(values, outside=0.0):
    """Return a framed float32 array with values (ROWS, COLUMNS) in it."""
    out = np.full(SHAPE, outside, F4)
    out[INNER] = values
    return out


def smooth_noise(rng, shape):
    """Return random values -1 .. 1 whose neighbors resemble each other."""
    noise = rng.uniform(-1, 1, (shape[0], shape[1] + 4))
    return sum(noise[:, i:i + shape[1]] for i in range(5)) / 2


def colors(rng, width, first, shape, bad_share=0.05):
    """Return u, v, variance (3, *shape) of a view; some nodes say nothing."""
    out = np.zeros((3, *shape), F4)
    out[2] = SILENT_VARIANCE
    area = np.s_[PAD:PAD + ROWS, first:first + width]
    for channel in range(2):
        out[channel][area] = smooth_noise(rng, (ROWS, width))
    variance = rng.uniform(1e-3, 2e-2, (ROWS, width))
    variance[rng.random((ROWS, width)) < bad_share] = SILENT_VARIANCE
    out[2][area] = variance
    return out


def views(seed):
    """Return u, v, variance of both cameras."""
    rng = np.random.default_rng(seed)
    return colors(rng, COLUMNS, PAD, SHAPE), colors(rng, WIDTH, 0, (SHAPE[0], WIDTH))


def planes(seed, unknown_share=0.1, jump=6.0):
    """Return d, a, b of two surfaces with a jump between them, negative disparities included."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:ROWS, :COLUMNS]
    d = -4 + 0.1 * row + 0.2 * column + jump * (column > 20) + rng.normal(0, 0.2, row.shape)
    d[rng.random(row.shape) < unknown_share] = np.nan
    return np.stack([framed(d, np.nan), framed(rng.normal(0.2, 0.1, row.shape)),
                     framed(rng.normal(0.1, 0.1, row.shape))])


def unknown(count):
    """Return so many float32 arrays without content."""
    return np.full((count, *SHAPE), np.nan, F4)


def test_every_parallel_kernel_has_a_twin():
    parallel = [node.name for path in Path(surface_planes.__file__).parent.glob('*_kernels.py')
                for node in ast.parse(path.read_text()).body
                if isinstance(node, ast.FunctionDef)
                and any('banded' in ast.unparse(mark) for mark in node.decorator_list)]
    assert parallel
    assert [name for name in parallel if not hasattr(naive, name)] == []


@pytest.mark.parametrize('height, width', [(5, 9), (2, 2), (16, 3)])
def test_box_sums_are_exact(height, width):
    image = np.random.default_rng(1).integers(0, 256, (height, width, 3)).astype(np.uint8)
    out = np.empty((height, width), np.uint32)
    pixels = np.concatenate([image, 255 - image[..., :1]], axis=-1).view(np.uint32)[..., 0]
    box_sums(pixels, out)
    unpacked = np.stack([out >> shift & 1023 for shift in (0, 10, 20)], axis=-1)
    np.testing.assert_array_equal(unpacked, naive.box_sums(image))


@pytest.mark.parametrize('known_dark', [-1.0, 0.0, 3.5])
@pytest.mark.parametrize('step, brightest', [(1, 40), (3, 200), (16, 255)])
def test_channel_levels_are_dark_level_and_mean_above(known_dark, step, brightest):
    rng = np.random.default_rng(9)
    image = np.sqrt(rng.uniform(0, 1, (90, 130, 4))) * brightest * [1, 0.5, 0.1, 1]
    image = image.astype(np.uint8)
    dark, mean = np.empty((2, 3), F4)
    channel_levels(image, step, F4(known_dark), TUNING.views.largest_dark_level, dark, mean)
    expected = naive.channel_levels(image, step, known_dark, TUNING.views.largest_dark_level)
    np.testing.assert_allclose([dark, mean], expected, rtol=1e-4)


@pytest.mark.parametrize('rows', [3, 9, 29])
@pytest.mark.parametrize('widened', [False, True])
def test_colors_are_sampled_between_pixels_with_a_variance(rows, widened):
    rng = np.random.default_rng(2)
    height, width = 11, 14
    box = rng.integers(0, 1021, (height, width, 3))
    box[rng.random(box.shape[:2]) < 0.1] = 40   # black
    box[rng.random(box.shape[:2]) < 0.1] = 1020
    shape = rows, 2 * LENGTH + 3
    row, column = rng.integers(0, height - 1, shape), rng.integers(0, width - 1, shape)
    index = (row * width + column).astype(np.int32)
    index[rng.random(index.shape) < 0.2] = -1
    frac_x, frac_y = rng.random((2, *index.shape)).astype(F4)
    dark, gain = np.array([2, 30, 5], F4), np.array([1.2, 0.7, 1.0], F4)
    packed = (box << (0, 10, 20)).sum(axis=-1).astype(np.uint32)
    out = np.full((5, *index.shape), 9, F4)
    widening = rng.uniform(-0.25, 0.25, (2, *shape) if widened else (2, 0, 0)).astype(F4)
    ring = np.empty((BANDS, 3, 3, shape[1]), F4)
    sample_colors(packed.reshape(-1), index, frac_x, frac_y, np.uint32(width), dark, gain,
                  SOFT, F4(230), NOISE, widening, ring, *out)
    expected = list(naive.sample_colors(box, index, frac_x, frac_y, dark, gain,
                                        float(SOFT), 230, NOISE))
    if widened:
        expected[:2] = [naive.widen(plane, *widening) for plane in expected[:2]]
    np.testing.assert_allclose(out, np.stack(expected), rtol=1e-4, atol=1e-4)
    assert (out[4] < SILENT_VARIANCE).any() and (out[4][index >= 0] == SILENT_VARIANCE).any()


@pytest.mark.parametrize('width', [37, 150])  # one part of a row, and two
@pytest.mark.parametrize('reach_y, reach_x', [(3, 3), (2, 4), (0, 1)])
def test_colors_are_averaged_in_opposite_pairs_that_are_alike(reach_y, reach_x, width):
    rng = np.random.default_rng(7)
    u, v = rng.normal(0, 0.03, (2, 19, width)).astype(F4) + F4(0.02) * np.arange(width, dtype=F4)
    u[:, width // 2:] += F4(0.5)  # a depth edge
    variance = np.where(rng.uniform(size=u.shape) < 0.1, SILENT_VARIANCE, F4(0.01))
    out = np.full((3, *u.shape), 9, F4)
    average_alike(u, v, variance, reach_y, reach_x, F4(0.12), F4(0.6), *out)
    expected = naive.average_alike(u, v, variance, reach_y, reach_x, 0.12, 0.6)
    np.testing.assert_allclose(out, expected, atol=1e-5)
    assert np.abs(out[0] - u).max() < 0.15 and np.abs(out[0] - u).mean() > 0.005


def test_averages_keep_slopes_and_depth_edges():
    rng = np.random.default_rng(8)
    truth = np.tile(F4(0.03) * np.arange(41, dtype=F4), (29, 1))
    truth[:, 20:] += F4(0.5)
    u = truth + rng.normal(0, 0.02, truth.shape).astype(F4)
    out = np.empty((3, *u.shape), F4)
    average_alike(u, truth, np.full(u.shape, F4(0.02 ** 2)), 3, 3, F4(0.15), F4(1), *out)
    inner = (out[0] - truth)[3:-3, 3:-3]
    assert inner.std() < 0.02 / 2 and np.abs(inner).max() < 0.05
    spread = 0.02 ** 2 / out[2][3:-3, 3:-3]  # what counting says
    assert 0.8 < np.mean(inner ** 2 / spread) < 1.5


@pytest.mark.parametrize('step_x, step_y, left', [(2, 2, PAD), (4, 2, 0)])
def test_coarse_colors_are_means_weighted_by_brightness(step_x, step_y, left):
    rng = np.random.default_rng(3)
    u, v = rng.uniform(-2, 2, (2, *SHAPE)).astype(F4)
    s = rng.uniform(0, 60, SHAPE).astype(F4)
    scale, knee = F4(TUNING.coarse.color_scale), F4(TUNING.coarse.full_trust)
    out = np.empty((4, ROWS // step_y, COLUMNS // step_x), I2)
    brightness = np.empty(out.shape[1:], F4)
    reduce_colors(u, v, s, PAD, left, step_x, step_y, SOFT, scale, knee,
                  out[0], out[1], brightness, out[3],
                  np.empty((BANDS, 3, COLUMNS), F4))
    expected = naive.reduce_colors(u.astype(float), v, s.astype(float), PAD, left, step_x, step_y,
                                   float(SOFT), float(scale), float(knee), out.shape[1:])
    np.testing.assert_allclose(brightness, expected[2], rtol=1e-5)
    for channel in (0, 1, 3):  # whole units, rounded towards zero
        np.testing.assert_allclose(out[channel], np.trunc(expected[channel]), atol=1)
        assert np.mean(out[channel] == np.trunc(expected[channel])) > 0.99


def coarse_pair(seed, rows=5, columns=9):
    """Return coarse colors, int16: left and right as `cost_volume` takes them."""
    rng = np.random.default_rng(seed)
    left, right = (np.stack([rng.integers(-128, 128, (rows, columns)),
                             rng.integers(-128, 128, (rows, columns)),
                             rng.integers(-40, 40, (rows, columns)),
                             rng.integers(0, 17, (rows, columns))]).astype(I2) for _ in range(2))
    return left, np.concatenate([*half_way(right[:2]), right[2:]])


def searched(left, right, first, depth, small=0, large=0):
    """Return the coarse search after the costs and paths of the kernels."""
    rows, columns = left.shape[1:]
    search = CoarseSearch((2 * rows, 2 * columns), 0, (4 * first, 4 * first),
                          Settings().matching, TUNING, Arena())
    search.first, search.penalties = first, (I2(small), I2(large))
    search.allocate(rows, columns, depth, Arena())
    search.upright.left[:] = left
    search.upright.inner[:] = right
    search.turn()
    search.aggregate()
    return search


def test_colors_between_two_nodes_are_those_half_way():
    colors = coarse_pair(7)[0][:2]
    np.testing.assert_array_equal(half_way(colors), naive.half_way(colors))


@pytest.mark.parametrize('rows, first, depth', [(5, 0, 6), (6, -5, 7), (5, -20, 4)])
def test_cost_volumes_of_both_layouts_are_exact(rows, first, depth):
    left, right = coarse_pair(5, rows)
    search = searched(left, right, first, depth)
    expected = naive.cost_volume(left, right, first, depth, *map(int, search.costs))
    np.testing.assert_array_equal(search.upright.cost.transpose(0, 2, 1), expected)
    np.testing.assert_array_equal(search.turned.cost.transpose(2, 0, 1)[:rows], expected)


@pytest.mark.parametrize('rows', [5, 6])
@pytest.mark.parametrize('small, large', [(60, 600), (0, 0), (600, 6000)])
def test_semi_global_paths_are_exact(rows, small, large):
    search = searched(*coarse_pair(6, rows), -3, 6, small, large)
    cost = search.upright.cost.transpose(0, 2, 1).astype(int)
    np.testing.assert_array_equal(search.upright.total.transpose(0, 2, 1),
                                  naive.sgm_paths(cost, small, large))


def test_turned_costs_are_added_where_they_belong():
    rng = np.random.default_rng(8)
    total = rng.integers(0, 9000, (5, 3, 70)).astype(I2)
    turned = rng.integers(0, 9000, (70, 3, 6)).astype(I2)
    expected = naive.add_turned(turned.transpose(0, 2, 1)[:, :5], total.transpose(0, 2, 1))
    add_turned(turned.reshape(-1).view(np.int32), 70, total)
    np.testing.assert_array_equal(total.transpose(0, 2, 1), expected)


@pytest.mark.parametrize('first, depth, gap', [(-3, 7, 0), (0, 1, 0), (2, 5, 0), (-3, 12, 2)])
def test_winners_are_consistent_from_left_to_right_and_clear_without_a_near_rival(
        first, depth, gap):
    total = np.random.default_rng(7).integers(0, 30, (6, depth, 17)).astype(I2)
    disparity, clear = np.empty((2, 6, 17), F4)
    winners(total, first, gap, disparity, clear,
            np.empty((BANDS, 2, 17), np.int32))
    expected = naive.winners(total.transpose(0, 2, 1).astype(int), first, gap)
    np.testing.assert_allclose(disparity, expected[0], atol=1e-5)
    np.testing.assert_array_equal(clear, expected[1])
    assert clear.all() == (gap == 0)
    assert np.isfinite(disparity).any()


def test_the_largest_path_costs_leave_room_for_the_disparity():
    # four paths, each at most eight capped pixels and the largest penalty that settings allow
    tuning = replaced(TUNING, {'coarse.smoothness': 40.0})
    search = CoarseSearch((24, 32), 64, (2, 20), Settings().matching, tuning, Arena())
    largest = 4 * (8 * int(search.costs[0]) + int(search.penalties[1]))
    assert largest < 2 ** 15
    assert largest // 4 < GUARD_COST
    total = np.full((1, 3, 5), largest, I2)
    total[:, 1] -= 1
    disparity, clear = np.empty((2, 1, 5), F4)
    winners(total, -1, 0, disparity, clear,
            np.empty((BANDS, 2, 5), np.int32))
    np.testing.assert_array_equal(disparity, 0)


@pytest.mark.parametrize('factor', [2, 4])
def test_coarse_disparities_seed_planes(factor):
    rng = np.random.default_rng(8)
    coarse = rng.normal(0, 3, (ROWS // factor, COLUMNS // factor)).astype(F4)
    coarse[rng.random(coarse.shape) < 0.2] = np.nan
    out = unknown(3)
    seed_planes(coarse, factor, F4(-0.5), ROWS, COLUMNS, *out)
    expected = naive.seed_planes(coarse.astype(float), factor, -0.5, ROWS, COLUMNS)
    np.testing.assert_allclose(out[:, *INNER], expected, rtol=1e-4, atol=1e-4)
    assert np.isnan(out[0, :PAD]).all()


@pytest.mark.parametrize('height, width', [(48, 80), (30, 66), (9, 64), (48, 40), (3, 2)])
def test_raw_rows_are_counted(height, width):
    rng = np.random.default_rng(width)
    images = rng.integers(0, 256, (2, height, width, 3), dtype=np.uint8)
    images[1, :, ::2] = rng.integers(90, 100, (height, -(-width // 2), 1))
    images[1, 10::3] = 120  # a border cuts the ring around a value
    counts = np.full((2, len(raw_kernels.QUANTITIES)), -1)
    scratch = np.zeros((2, 3, width + raw_kernels.EDGE_REACH), np.uint8)
    shares = np.full((2, (height // raw_kernels.EDGE_ROWS + 1) * width), -1, F4)
    raw_kernels.look_at_rows(*map(read_only, images), counts, scratch, shares)
    for image, count, share in zip(images, counts, shares):
        expected, edges = naive.look_at_rows(image)
        assert dict(zip(raw_kernels.QUANTITIES, count)) == expected
        np.testing.assert_array_equal(share[:len(edges)], np.array(edges, F4))
        assert (share[len(edges):] == -1).all()


def compiled_linearize(left, right, shape, tiles, lines=(0, 1)):
    """Return weight, moment and misfit of the kernel, NaN where it writes nothing."""
    out = unknown(3)
    linearize(*left, *right, PSF, MATRIX, *shape, tiles, *lines, ROBUST, F4(1.7), F4(3.0),
              *out)
    return out


@pytest.mark.parametrize('fold', [False, True])
@pytest.mark.parametrize('tiles', [TILES, TILES[1:]])
def test_brightness_is_added_to_the_linearized_colors(tiles, fold):
    left, right = (np.ascontiguousarray(view[[0, 2]]) for view in views(14))
    shape = planes(15)
    before = np.random.default_rng(16).uniform(0, 9, (3, *SHAPE)).astype(F4)
    before[2][::5, ::3] = np.nan  # the colors say nothing
    out, own = before.copy(), unknown(1)[0]
    linearize_brightness(*left, *right, PSF, *shape, tiles, ROBUST, F4(0.6), F4(3.0), fold, *out,
                         own)
    expected = naive.linearize_brightness(left, right, float(PSF), shape, tiles, float(ROBUST),
                                          0.6, 3.0, fold, before.astype(float))
    inside = np.isfinite(expected[0])
    np.testing.assert_allclose(out[:, inside], expected[:3, inside], rtol=1e-3, atol=2e-3)
    np.testing.assert_allclose(own, expected[3], rtol=1e-3, atol=1e-4)
    np.testing.assert_array_equal(out[:, ~inside], before[:, ~inside])


def test_seeds_near_a_plane_hold_it():
    rng = np.random.default_rng(17)
    d = planes(18)[0]
    seed = d + rng.normal(0, 1, SHAPE).astype(F4)
    weight = np.maximum(rng.uniform(-1, 3, SHAPE), 0).astype(F4)
    moment = rng.normal(0, 3, SHAPE).astype(F4)
    found = weight.copy(), moment.copy()
    add_seeds(seed, d, TILES[:-1], F4(1.1), F4(0.2), F4(3), *found)
    expected = naive.add_seeds(seed, d, TILES[:-1], F4(1.1), 0.2, 3.0, weight, moment)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
    assert 0.1 < np.mean(found[0][INNER] != weight[INNER]) < 0.8


@pytest.mark.parametrize('step', [1, 2, 3])
def test_nodes_with_a_rival_are_counted(step):
    rng = np.random.default_rng(19)
    total = rng.integers(0, 3000, (21, 9, 70)).astype(I2)
    trust = rng.integers(14, 17, (21, 70)).astype(I2)
    counts = np.full((BANDS, 2), -1, np.int64)
    count_rivals(total, trust, I2(16), 300, 120, step, counts)
    expected = naive.count_rivals(total, trust, 16, 300, 120, step)
    assert counts.sum(axis=0).tolist() == expected
    assert 0 < expected[1] < expected[0]


@pytest.mark.parametrize('depth', [2, 9])  # without a rival, and with several
def test_own_colors_tell_a_match_from_its_rival(depth):
    rng = np.random.default_rng(12)
    cost, total = rng.integers(0, 3000, (2, 5, depth, 150)).astype(I2)
    gaps = np.full((5, 150), 9, F4)
    rival_gaps(cost, total, gaps)
    np.testing.assert_array_equal(gaps, naive.rival_gaps(cost, total))
    assert (gaps == LARGEST).all() == (depth == 2)


@pytest.mark.parametrize('channels', [1, 3])
@pytest.mark.parametrize('column', [PAD, 0])
def test_colors_are_given_the_brightness_against_their_surroundings(column, channels):
    rng = np.random.default_rng(20)
    size = SHAPE[0], COLUMNS + PAD
    u, v = rng.uniform(-1, 2, size).astype(F4), rng.uniform(-1.5, 1.5, size).astype(F4)
    s = rng.uniform(0, 600, size).astype(F4)
    mean = rng.uniform(12, 612, size).astype(F4)
    out = np.empty((ROWS, COLUMNS, channels), np.uint8)
    local_colors(u, v, s, mean, PAD, column, F4(70), out)
    expected = naive.local_colors(u, v, s, mean, PAD, column, 70.0, channels, (ROWS, COLUMNS))
    np.testing.assert_allclose(out, np.floor(expected), atol=1)  # a rounding may cross a number
    assert np.mean(out == np.floor(expected)) > 0.99


@pytest.mark.parametrize('fraction', [0.1, 0.25, 0.5, 0.75, 0.9])
def test_waves_of_twelve_pixels_are_not_drawn_to_whole_columns(fraction):
    phase = 2 * np.pi / 12

    def view(places):
        colors = np.stack([np.cos(phase * places), np.sin(phase * places), 0.01 + 0 * places])
        return np.repeat(colors[:, None], SHAPE[0], 1).astype(F4)

    left = view(2 * (np.arange(SHAPE[1]) - PAD) - 8 - fraction)
    d = framed(np.full((ROWS, COLUMNS), 8 + fraction), np.nan)
    weight, moment = unknown(2)
    level = np.zeros((2, *SHAPE), F4)
    linearize(*left, *view(np.arange(WIDTH)), PSF, np.eye(2, 3, dtype=F4), d, *level, TILES, 0, 1,
              ROBUST, F4(1), F4(0), weight, moment, unknown(1)[0])
    # Catmull-Rom: 0.004 px at a quarter
    assert abs(np.nansum(moment) / np.nansum(weight) - 8 - fraction) < 0.0005


@pytest.mark.parametrize('tiles, slope', [(TILES, 0), (TILES[1:3], 0), (TILES, 0.8), (TILES, 5)])
def test_linearization_is_the_derivative_of_the_misfit(tiles, slope):
    left, right = views(9)
    shape = planes(10)
    shape[1] += slope  # px per node: .8 is blurred most, 5 is turned over
    expected = naive.linearize(left.astype(float), right.astype(float), float(PSF),
                               MATRIX.astype(float), shape.astype(float), tiles,
                               float(ROBUST), 1.7, 3.0)
    found = compiled_linearize(left, right, shape, tiles)
    assert np.count_nonzero(found[0] > 0) > 100
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-3)
    some = compiled_linearize(left, right, shape, tiles, (1, 3))
    lines = [PAD + tile * TILE_ROWS + line for tile in range(2) for line in (1, 4, 7)]
    np.testing.assert_array_equal(some[:, lines], found[:, lines])
    assert np.isnan(np.delete(some, lines, axis=1)).all()


@pytest.mark.parametrize('slope', [-0.5, 0.3, 0.5])
def test_a_leaning_plane_is_blurred_as_much_in_the_left_view_as_in_the_right(slope):
    # waves of 14 px of the left image, seen through kernels of 1 px^2 each
    psf, phase, shown = 1.0, 2 * np.pi / 14, 1 - slope

    def view(places, frequency):
        strength = np.exp(-psf * frequency ** 2 / 2)
        colors = np.stack([strength * np.cos(phase * places), strength * np.sin(phase * places),
                           1e-4 + 0 * places])
        return np.repeat(colors[:, None], SHAPE[0], 1).astype(F4)

    columns = 2.0 * (np.arange(SHAPE[1]) - PAD)
    left = view(columns, phase)
    right = view((np.arange(WIDTH) - 4) / shown, phase / shown)
    shape = np.zeros((3, *SHAPE), F4)
    shape[0], shape[1] = columns * slope - 4, 2 * slope
    misfit = []
    for variance in (0, psf):
        out = unknown(3)
        linearize(*left, *right, F4(variance), np.eye(2, 3, dtype=F4), *shape, TILES, 0, 1,
                  ROBUST, F4(1), F4(0), *out)
        misfit.append(np.nanmean(out[2]))
    assert misfit[1] < 0.2 * misfit[0]


def test_one_step_from_the_linearization_recovers_a_disparity():
    rng = np.random.default_rng(11)
    phase = rng.uniform(0, 6, (SHAPE[0], 1))
    right, left = np.zeros((3, SHAPE[0], WIDTH), F4), np.zeros((3, *SHAPE), F4)
    right[2], left[2] = 1e-3, 1e-3
    place = 2 * (np.arange(SHAPE[1]) - PAD) - 7.3
    for channel, wave in enumerate((np.sin, np.cos)):
        right[channel] = wave(phase + 0.3 * np.arange(WIDTH))
        left[channel] = wave(phase + 0.3 * place)
    shape = np.zeros((3, *SHAPE), F4)
    shape[0] = 7.0
    weight, moment, _ = unknown(3)
    linearize(*left, *right, PSF, np.eye(2, 3, dtype=F4), *shape, TILES, 0, 1, ROBUST,
              F4(1), F4(3), weight, moment, unknown(1)[0])
    inside = weight > 0
    np.testing.assert_allclose(3 + moment[inside] / weight[inside], 7.3, atol=0.02)


def fit_inputs(seed):
    """Return weight, moment and planes as a linearization leaves them."""
    left, right = views(seed)
    shape = planes(seed + 1)
    weight, moment, _ = compiled_linearize(left, right, shape, TILES)
    weight[np.isnan(weight)], moment[np.isnan(moment)] = 0, 0  # the frame
    return weight, moment, shape


@pytest.mark.parametrize('gate, stride, ridge', [(0.8, 1, 0.5), (3.0, 1, 1e6), (1.5, 2, 0.5)])
def test_planes_are_weighted_least_squares(gate, stride, ridge):
    weight, moment, shape = fit_inputs(12)
    reach = np.array([0, RADIUS, WIDE_RADIUS, 0] * len(TILES))[:len(TILES)]
    out = unknown(4)
    fit_planes(weight, moment, *shape, TILES, reach.astype(np.int8), F4(gate), stride,
               F4(0.7), F4(ridge), STEEPEST, F4(3), *out)
    expected = naive.fit_planes(weight.astype(float), moment.astype(float), shape.astype(float),
                                TILES, reach, gate, stride, 0.7, ridge,
                                float(STEEPEST), 3.0)
    np.testing.assert_allclose(out[:3], expected[:3], rtol=1e-3, atol=3e-3)
    same = np.isfinite(out[3]) == np.isfinite(expected[3])
    assert same[PAD:-PAD, PAD:-PAD].mean() > 0.99  # hardly more signal than noise
    both = np.isfinite(out[3]) & np.isfinite(expected[3])
    assert both.sum() > 100
    np.testing.assert_allclose(np.median(out[3][both] / expected[3][both]), 1, atol=1e-4)


def test_tiles_without_information_keep_their_planes():
    shape = planes(13)
    out = unknown(4)
    fit_planes(np.zeros(SHAPE, F4), np.zeros(SHAPE, F4), *shape, TILES,
               np.zeros(len(TILES), np.int8), F4(1), 1, F4(0.7), F4(0.5),
               STEEPEST, F4(0), *out)
    np.testing.assert_array_equal(out[:3, *INNER], shape[:, *INNER])
    assert np.isinf(out[3][INNER]).all()


def variances(seed):
    """Return variances of planes, px^2, and misfits; some are unknown."""
    rng = np.random.default_rng(seed)
    variance = rng.choice([1e-3, 0.02, 0.5, np.inf], SHAPE, p=[0.6, 0.3, 0.05, 0.05]).astype(F4)
    misfit = rng.gamma(1, 4, SHAPE).astype(F4)
    misfit[rng.random(SHAPE) < 0.1] = np.nan
    return variance, misfit


@pytest.mark.parametrize('least_share', [0.1, 0.5, 0.9])
def test_tiles_bend_where_second_differences_exceed_their_noise(least_share):
    variance, misfit = variances(51)
    d = planes(52, jump=2.0)[0]
    bent, noise = np.empty(len(TILES), bool), np.empty(len(TILES), F4)
    options = 0.05, 12.0, 1.1, 3.0, least_share
    find_bent_tiles(d, variance, misfit, TILES, *(F4(each) for each in options), bent, noise)
    expected = naive.find_bent_tiles(d.astype(float), variance.astype(float),
                                     misfit.astype(float), TILES, *options)
    np.testing.assert_array_equal(bent, expected[0])
    np.testing.assert_allclose(noise, expected[1], rtol=1e-4)


def test_bent_planes_are_corrected_by_the_pulls_of_the_window():
    weight, moment, shape = fit_inputs(53)
    variance, _ = variances(54)
    variance[~np.isfinite(variance)] = 1
    pull = np.empty(SHAPE, F4)
    write_pulls(weight, moment, shape[0], F4(3), pull)
    exact = naive.write_pulls(weight.astype(float), moment.astype(float), shape[0].astype(float),
                              3.0)
    np.testing.assert_allclose(pull, exact, rtol=1e-4, atol=1e-3)
    noise = np.linspace(0.01, 0.03, len(TILES)).astype(F4)
    smooth = np.arange(len(TILES)) % 2 == 0
    out = np.stack([*shape, variance])
    unbend(weight, pull, *shape, TILES, noise, smooth, F4(1.5), F4(0.7), F4(0.1), STEEPEST,
           F4(0.2), *out)
    expected = naive.unbend(weight.astype(float), exact, shape.astype(float),
                            variance.astype(float), TILES, noise, smooth, 1.5, 0.7, 0.1,
                            float(STEEPEST), 0.2)
    inside = np.s_[:, PAD:-PAD, PAD:-PAD]
    near = np.isclose(out[inside], expected[inside], rtol=1e-3, atol=3e-3, equal_nan=True)
    assert near.mean() > 0.99  # a share near 0, or hardly more signal than noise
    assert np.nanmean(np.abs(expected[inside][0] - shape[inside][0]) > 0.02) > 0.2


def test_the_quality_of_the_fit_is_sampled():
    weight, moment, shape = fit_inputs(55)
    variance, _ = variances(56)
    row, column = np.mgrid[:SHAPE[0], :SHAPE[1]]
    shape[0] = -4 + 0.1 * row + 0.2 * np.sin(column / 3) * row  # known in the frame, too
    shape[0][20:22, 20:30] = np.nan
    samples = np.full((4, 3, 10), np.nan, F4)
    sample_quality(shape[0], weight, moment, variance, F4(3), 4, samples)
    expected = naive.sample_quality(shape[0].astype(float), weight.astype(float),
                                    moment.astype(float), variance.astype(float), 3.0, 4,
                                    samples.shape[1:])
    assert 0.2 < expected[2].mean() < 0.95
    np.testing.assert_allclose(samples, expected, rtol=1e-3, atol=1e-3)


def test_nodes_beside_steps_lose_log_odds():
    rng = np.random.default_rng(57)
    d = planes(58, jump=2.0)[0]
    d[rng.random(SHAPE) < 0.1] = np.nan
    rough = rng.choice([0, 0.5, 1], (ROWS, COLUMNS)).astype(F4)
    odds = rng.choice([-200, 0, 1.5, 3, 8], SHAPE).astype(F4)
    before = odds.copy()
    lower_beside_steps(d, rough, ROWS, COLUMNS, F4(1), F4(2), F4(2.5), F4(1.9), odds)
    expected = naive.lower_beside_steps(d.astype(float), rough.astype(float), 1, 2, 2.5, 1.9,
                                        before.astype(float))
    np.testing.assert_allclose(odds, expected, rtol=1e-5, atol=1e-5)
    assert 0.1 < np.mean(odds[INNER] < before[INNER]) < 0.9
    assert odds[INNER][before[INNER] > 1.9].min() >= F4(1.9)


@pytest.mark.parametrize('change', [
    'nothing', 'jump', 'hole', 'dark', 'dark jump', 'round crease'])
def test_smooth_tiles_hold_one_surface(change):
    row, column = np.mgrid[:SHAPE[0], :SHAPE[1]]
    shape = np.stack([0.1 * row - 0.2 * column, np.full(SHAPE, -0.2),
                      np.full(SHAPE, 0.1)]).astype(F4)
    variance = np.full(SHAPE, 0.01, F4)
    where = np.s_[PAD + 3:PAD + 6, PAD + 4:PAD + 7]
    if 'jump' in change:
        shape[0][where] += 5
    if change == 'hole':
        shape[0][where] = np.nan
    if change == 'round crease':  # of .8 px per px, rounded over 8 nodes: neighbors are even
        shape[1] = -0.8 + np.clip(0.2 * (column - PAD - 12), 0, 1.6)
        shape[0] = 0.1 * row + np.cumsum(shape[1], axis=1)
    if 'dark' in change:
        variance[PAD + 1:PAD + 8, PAD + 2:PAD + 9] = SILENT_VARIANCE
    smooth = np.empty(len(TILES), bool)
    step = F4(TUNING.planes.smooth_steps[-1])
    find_smooth_tiles(*shape, variance, TILES, 2, step, smooth)
    expected = naive.find_smooth_tiles(shape.astype(float), variance, TILES, 2, float(step))
    np.testing.assert_array_equal(smooth, expected)
    assert smooth[0] == (change in ('nothing', 'dark', 'dark jump'))


@pytest.mark.parametrize('bright', [False, True])
@pytest.mark.parametrize('judged', [False, True])
@pytest.mark.parametrize('step, tiles', [(1, TILES), (4, TILES[:1]), (2, TILES[2:])])
def test_nodes_take_the_plane_of_the_neighbor_that_fits_best(step, tiles, judged, bright):
    left, right = views(20)
    own = [np.ascontiguousarray(each[[0, 2]]) for each in views(24)]
    brightness = (*own[0], *own[1], F4(0.7)) if bright else NO_BRIGHTNESS
    shape = planes(21, unknown_share=0.15)
    out = unknown(4)
    out[3] = np.random.default_rng(23).uniform(5, 30, SHAPE)
    own_cost = out[3].copy() if judged else None
    propagate(*left, *right, PSF, MATRIX, F4(1.3), TRUNCATION, F4(0.5), brightness, *shape,
              tiles, step, judged, *out)
    expected = naive.propagate(left.astype(float), right.astype(float), float(PSF),
                               MATRIX.astype(float), 1.3, float(TRUNCATION), 0.5, shape,
                               tiles, step, own_cost, (*own, 0.7) if bright else None)
    inside = np.isfinite(expected[3])
    out[3][~inside] = np.nan
    np.testing.assert_allclose(out[3], expected[3], rtol=1e-3, atol=1e-3)
    same = np.isclose(out[:3], expected[:3], rtol=1e-4, atol=1e-4, equal_nan=True)
    assert same.mean() > 0.998  # two planes may fit equally well to float32 rounding


def test_the_frame_is_as_wide_as_windows_and_steps_reach():
    farthest = max(step for steps in TUNING.neighbors.steps for step in steps)
    assert farthest + max(PATCH_MARGIN, HALO) <= PAD
    assert 4 * math.ceil(WIDE_RADIUS / 4) <= PAD and WIDE_RADIUS < PAD


def test_tiles_far_from_any_plane_stay_unknown():
    left, right = views(22)
    out = np.zeros((4, *SHAPE), F4)
    propagate(*left, *right, PSF, MATRIX, F4(1), TRUNCATION, F4(0.5), NO_BRIGHTNESS,
              *unknown(3), TILES, 2, False, *out)
    assert np.isnan(out[0][INNER]).all()
    assert (out[3][INNER] == TRUNCATION).all()


def brightness(rng):
    """Return random brightness of left and right, and a usual imbalance."""
    return (rng.uniform(0, 300, SHAPE).astype(F4),
            rng.uniform(0, 300, (SHAPE[0], WIDTH)).astype(F4),
            rng.uniform(-0.3, 0.3, (ROWS, COLUMNS)).astype(F4))


def test_brightness_is_compared_where_colors_match():
    rng = np.random.default_rng(28)
    left_s, right_s, _ = brightness(rng)
    d = planes(28)[0]
    misfit = rng.choice([1, 30, np.nan], SHAPE).astype(F4)
    out = np.empty((2, ROWS // 4, COLUMNS // 4), F4)
    brightness_balance(d, misfit, left_s, right_s, 4, ROBUST, *out)
    expected = naive.brightness_balance(d, misfit, left_s, right_s, 4, float(ROBUST),
                                        out[0].shape)
    assert 0 < out[1].mean() < 1
    np.testing.assert_allclose(out, expected, atol=1e-5)


def test_color_sums_are_those_of_the_matched_nodes():
    left, right = views(40)
    d, misfit = planes(41)[0], np.random.default_rng(42).gamma(1, 8, SHAPE).astype(F4)
    misfit[np.isnan(d)] = np.nan
    normal, target = np.eye(3), np.zeros((3, 2))
    add_color_sums(left[0], left[1], right[0], right[1], d, misfit, F4(9), ROWS, COLUMNS,
                   3, 2, normal, target)
    expected = naive.color_sums(left, right, d, misfit, 9, ROWS, COLUMNS, 3, 2)
    assert expected[0][2, 2] > 20
    np.testing.assert_allclose(normal - np.eye(3), expected[0], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(target, expected[1], rtol=1e-4, atol=1e-4)


def judged(seed):
    """Return what the kernel and the twin say about random planes: evidence and trust."""
    rng = np.random.default_rng(seed)
    shape = planes(seed)
    cost, misfit = rng.gamma(1, 8, (2, *SHAPE)).astype(F4)
    misfit[rng.random(SHAPE) < 0.1] = np.nan
    variance = rng.choice([1e-3, 0.1, 4, np.inf], SHAPE).astype(F4)
    left_s, right_s, balance = brightness(rng)
    evidence, trust = np.empty((5, ROWS, COLUMNS), F4), np.zeros(SHAPE, F4)
    weigh_evidence(*shape, cost, misfit, variance, left_s, right_s, balance, ROWS, COLUMNS,
                   FORM, evidence, trust)
    expected = naive.weigh_evidence(shape.astype(float), cost, misfit, variance.astype(float),
                                    left_s.astype(float), right_s.astype(float), balance, ROWS,
                                    COLUMNS, FORM.astype(float))
    return (evidence, trust[INNER]), expected


def test_trust_is_the_weighted_sum_of_the_evidence():
    (evidence, trust), expected = judged(23)
    np.testing.assert_allclose(evidence, expected[0], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(trust, expected[1], rtol=1e-3, atol=5e-3)
    assert (trust == UNKNOWN_ODDS).any() and (trust > 0).any()


BRIGHT = 32  # parts of a node are then exact


def light_of_nodes(seed):
    """Return brightnesses (DN) on both sides of BRIGHT, none where a part of a node begins."""
    rng = np.random.default_rng(seed)
    return framed(rng.integers(0, 2 * BRIGHT, (ROWS, COLUMNS)) + 0.5)


def scattered(seed):
    """Return planes with steps and their trust, both of changing sign from node to node."""
    rng = np.random.default_rng(seed)
    shape = planes(seed, unknown_share=0.0)
    shape[0][INNER] += 4 * (rng.random((ROWS, COLUMNS)) < 0.2)
    return shape, framed(rng.normal(0.5, 1, (ROWS, COLUMNS)))


def test_nodes_of_a_band_are_joined_to_segments():
    shape, trust = scattered(24)
    run_of, first, parent, size = np.empty((4, ROWS * COLUMNS), np.int32)
    ends = np.empty(BANDS, np.int32)
    light = light_of_nodes(25)
    join_nodes(*shape, trust, light, F4(BRIGHT), ROWS, COLUMNS, JOINED_DISTANCE, run_of,
               first, parent, size, ends)
    for k in range(BANDS):
        top, bottom = band.py_func(k, ROWS)
        found = {}
        for node in range(top * COLUMNS, bottom * COLUMNS):
            if run_of[node] >= 0:
                assert top * COLUMNS <= run_of[node] < ends[k]
                place = node // COLUMNS + PAD, node % COLUMNS + PAD
                found.setdefault(root_of.py_func(parent, run_of[node]), set()).add(place)
        expected = naive.join_nodes(shape, trust, top, bottom, COLUMNS, 1.0)
        assert sorted(map(sorted, found.values())) == sorted(map(sorted, expected))
        runs = size[top * COLUMNS:ends[k]] if top < bottom else size[:0]
        assert runs.sum() == sum(naive.size_of(each, light, BRIGHT) for each in expected)


@pytest.mark.parametrize('least_size', [2, 6, 40])
def test_islands_are_the_small_connected_segments(least_size):
    shape, trust = scattered(24)
    light = light_of_nodes(25)
    expected = naive.distrust_islands(shape, trust, light, BRIGHT, ROWS, COLUMNS, 1.0, least_size)
    scratch = np.empty((4, ROWS * COLUMNS), np.int32)
    distrust_islands(*shape, trust, light, F4(BRIGHT), ROWS, COLUMNS, JOINED_DISTANCE,
                     least_size, *scratch)
    assert JOINED_DISTANCE == 1.0
    np.testing.assert_array_equal(trust, expected)
    assert (trust == ISLAND_ODDS).any() and (trust > 0).any()


def test_hidden_nodes_lie_behind_more_trusted_ones():
    rng = np.random.default_rng(25)
    shape = planes(25, unknown_share=0.1, jump=12.0)
    trust = framed(rng.normal(0, 3, (ROWS, COLUMNS)), UNKNOWN_ODDS)
    trust[np.isnan(shape[0])] = UNKNOWN_ODDS
    hidden = np.zeros(SHAPE, bool)
    find_hidden(*shape[:2], trust, ROWS, COLUMNS, WIDTH, HIDDEN_DISTANCE, hidden,
                np.empty((BANDS, WIDTH), np.int32), np.empty((BANDS, WIDTH), F4))
    expected = naive.find_hidden(shape, trust, ROWS, COLUMNS, WIDTH, float(HIDDEN_DISTANCE))
    assert hidden.any() and not hidden[INNER].all()
    np.testing.assert_array_equal(hidden[INNER], expected)


def test_every_reason_is_given_and_as_documented():
    rng = np.random.default_rng(26)
    d = framed(rng.choice([np.nan, -9, 0, 3, 8, 30], (ROWS, COLUMNS)))
    variance = rng.choice([1e-3, 0.2, np.inf], SHAPE).astype(F4)
    evidence = rng.uniform(0, 1, (5, ROWS, COLUMNS)).astype(F4)
    cost = rng.choice([1, 0.9 * MISFIT_CAP], SHAPE).astype(F4)
    trust = rng.choice([ISLAND_ODDS, -4, 0, 1.5, 4], SHAPE).astype(F4)
    hidden = rng.random(SHAPE) < 0.3
    peak = rng.choice([-1, 40, 40, 40, 255], SHAPE).astype(F4)
    s = rng.choice([0, 3, 90, 90], SHAPE).astype(F4)
    std, odds = np.zeros((2, *SHAPE), F4)
    reason = np.zeros(SHAPE, np.uint8)
    rest = (np.array([-5, 20], F4), F4(253), F4(4), F4(TUNING.trust.hidden_odds),
            TUNING.trust.vague_std)
    settle(d, variance, evidence, cost, trust, hidden, peak, s, ROWS, COLUMNS, *rest, std,
           odds, reason)
    expected = naive.settle(d, variance, evidence, cost, trust, hidden, peak, s, ROWS, COLUMNS,
                            *rest)
    np.testing.assert_allclose(std[INNER], expected[0], rtol=1e-4)
    np.testing.assert_allclose(odds[INNER], expected[1], rtol=1e-4)
    np.testing.assert_array_equal(reason[INNER], expected[2])
    assert set(np.unique(reason[INNER])) == set(Status) - {Status.VALID, Status.MOVED}


def test_deviations_follow_the_variances_of_planes():
    rng = np.random.default_rng(27)
    std, apart = rng.uniform(0.01, 1, (2, ROWS, COLUMNS)).astype(F4)
    assumed, variance = rng.choice([0, np.nan, np.inf, 1e-4, 0.02, 0.3],
                                   (2, ROWS, COLUMNS)).astype(F4)
    scaled, framed = unknown(2)
    scaled[INNER], framed[INNER] = std, variance
    rescale_std(scaled, apart, assumed, framed)
    expected = naive.rescale_std(std, apart, assumed, variance)
    assert not np.array_equal(scaled[INNER], std)
    np.testing.assert_allclose(scaled[INNER], expected, rtol=1e-5)


def expanded(size, seed):
    """Return what the kernel and its twin make of random planes for an image of this size."""
    rng = np.random.default_rng(seed)
    shape = planes(seed)
    shape[0][:, PAD:PAD + 3] = 4  # the first of these pixels lie outside the right image
    std = rng.random(SHAPE).astype(F4)
    odds = rng.choice([HOPELESS_ODDS, -20, -1, 2, 5], SHAPE).astype(F4)
    odds[np.isnan(shape[0])] = HOPELESS_ODDS
    odds[:, PAD - 1], odds[:, PAD + COLUMNS] = odds[:, PAD], odds[:, PAD + COLUMNS - 1]
    reason = rng.choice([Status.AMBIGUOUS, Status.NO_MATCH], SHAPE).astype(np.uint8)
    beyond = rng.random(SHAPE) < 0.3
    limits, least = np.array([-3, 9], F4), F4(0.4)
    images, codes = np.empty((4, *size), F4), np.empty(size, np.uint8)
    expand(*shape, std, odds, reason, beyond, ROWS, COLUMNS, np.arange(size[0]), limits, F4(40),
           F4(-20), least, *images, codes)
    some, few = np.full_like(images, -7), np.array([0, 3, size[0] - 1])
    expand(*shape, std, odds, reason, beyond, ROWS, COLUMNS, few, limits, F4(40), F4(-20), least,
           *some, np.empty_like(codes))
    np.testing.assert_array_equal(some[:, few], images[:, few])
    assert (np.delete(some, few, axis=1) == -7).all()
    expected = naive.expand(shape, std, odds, reason, beyond, ROWS, COLUMNS, limits, 40.0,
                            -20.0, float(least), size)
    return (images, codes), expected


@pytest.mark.parametrize('beyond', [0, 1])  # 1: the last pixels have no node of their own
def test_planes_are_evaluated_at_every_pixel(beyond):
    (images, codes), expected = expanded((2 * ROWS + beyond, 2 * COLUMNS + beyond), 27)
    np.testing.assert_array_equal(codes, expected[1])
    np.testing.assert_allclose(images, expected[0], rtol=1e-4, atol=1e-4)
    assert {Status.VALID, Status.OUT_OF_RANGE, Status.NO_MATCH, Status.INCONSISTENT} < set(
        np.unique(codes))


def test_a_pixel_beside_a_doubtful_node_is_doubted_more():
    odds = framed(np.full((ROWS, COLUMNS), 2.0))
    odds[PAD + 3, PAD + 5] = -4
    flat = [framed(np.full((ROWS, COLUMNS), value)) for value in (5.0, 0.0, 0.0)]
    images, codes = np.empty((4, 2 * ROWS, 2 * COLUMNS), F4), np.empty(
        (2 * ROWS, 2 * COLUMNS), np.uint8)
    expand(*flat, odds, odds, np.zeros(SHAPE, np.uint8), np.zeros(SHAPE, bool), ROWS, COLUMNS,
           np.arange(2 * ROWS), np.array([-3, 9], F4), F4(40), F4(-20), F4(-9), *images, codes)
    confidence = images[3]
    assert confidence[6, 11] < confidence[6, 12] < confidence[6, 13]
    assert confidence[6, 13] == pytest.approx(1 / (1 + np.exp(-2)), abs=1e-4)


@pytest.mark.parametrize('seed, scale, turn', [(1, 0.7, 0), (2, 0.7, 1), (2, 3.1, 0)])
def test_cells_tell_the_rows_as_their_normal_equations_do(seed, scale, turn):
    left, right = views(seed)
    d = planes(seed)[0]
    cells = np.full((2, 2, 7), np.nan, F4)
    row_cells(*left, *right, MATRIX, d, ROBUST, F4(scale), ROWS, COLUMNS, turn, cells)
    expected = naive.row_cells(left, right, MATRIX.astype(float), d, float(ROBUST), scale, ROWS,
                               COLUMNS, turn, (2, 2))
    assert (expected[..., 0] > 0).sum() >= 3 - turn
    np.testing.assert_allclose(cells, expected, rtol=2e-4, atol=2e-3)


def test_wrong_matches_do_not_hide_the_structure_of_the_left_view():
    left, right = views(1)
    d = planes(1)[0]
    found = np.zeros((3, 2, 2, 7), F4)
    for scale, cells in zip((1, 8.7, 20), found):
        row_cells(*left, *right, MATRIX, d, ROBUST, F4(scale), ROWS, COLUMNS, 0, cells)
    assert found[0, ..., 6].max() > 0
    np.testing.assert_array_equal(found[1:, ..., 6], found[[0, 0], ..., 6])
    assert found[2, ..., 1].max() < 0.5 * found[0, ..., 1].max()  # information knows the matches


@pytest.mark.parametrize('seed', [3, 4])
def test_rows_are_moved_by_all_seven_terms(seed):
    rng = np.random.default_rng(seed)
    margin, size = 4, (44, 2 * ROWS)
    y, x = np.mgrid[-margin:ROWS + margin, :WIDTH // 2].astype(F4)
    x, y = 1.01 * x + 0.02 * y, 2 * y - 0.03 * x + rng.uniform(0, 0.5, x.shape).astype(F4)
    seen = (rng.random(x.shape) < 0.9).astype(np.uint8)
    coefficients = rng.uniform(-2, 2, 7).astype(F4)
    index, frac_x, frac_y = np.zeros(SHAPE, np.int32), *np.zeros((2, *SHAPE), F4)
    moved_rows(x.astype(F4), y.astype(F4), seen, margin, 1, coefficients, F4(size[0] / 2),
               F4(size[1] / 2), *size, PAD, index, frac_x, frac_y)
    expected = naive.moved_rows(x.astype(float), y.astype(float), seen, margin, 1,
                                coefficients.astype(float), size)
    inner = np.s_[PAD:PAD + ROWS, PAD:PAD + WIDTH // 2]
    row, column = np.divmod(index[inner], size[0])
    outside = expected[0] < 0
    np.testing.assert_array_equal(index[inner] < 0, outside)
    # rounding may carry a place over a pixel
    np.testing.assert_allclose((row + frac_y[inner])[~outside], (
        expected[0] // size[0] + expected[2])[~outside], atol=1e-4)
    np.testing.assert_allclose((column + frac_x[inner])[~outside], (
        expected[0] % size[0] + expected[1])[~outside], atol=1e-4)
    assert 0.05 < outside.mean() < 0.95


SCRIPT = """
import numpy as np
from color_stereo_ros.core import ColorStereo
from surface_pairs import plane_pair, rig, surface_settings
left, right = plane_pair(64, 48, 9.3, seed=3)
left[20:24, 30:34] = 1
result = ColorStereo(rig(64, 48), surface_settings(3, 24)).process(left, right)
np.savez(OUT, disparity=result.disparity, status=result.status, std=result.disparity_std,
         confidence=result.confidence)
"""


def test_kernels_give_the_same_without_the_compiler(tmp_path):
    results = []
    folder = Path(__file__).parent
    for disabled in ('0', '1'):
        out = tmp_path / f'{disabled}.npz'
        subprocess.run(
            [sys.executable, '-W', 'ignore', '-c', SCRIPT.replace('OUT', repr(str(out)))],
            check=True, env={**os.environ, 'NUMBA_DISABLE_JIT': disabled,
                             'PYTHONPATH': os.pathsep.join([str(folder.parent), str(folder)])})
        results.append(np.load(out))
    compiled, interpreted = results
    known = np.isfinite(compiled['disparity'])
    assert known.mean() > 0.3
    # rounding may move single nodes over a threshold
    assert np.mean(compiled['status'] == interpreted['status']) > 0.99
    known &= np.isfinite(interpreted['disparity'])
    for name, tolerance in (('disparity', 2e-3), ('std', 2e-3), ('confidence', 2e-2)):
        difference = np.abs(compiled[name] - interpreted[name])[known]
        assert np.percentile(difference, 99) < tolerance, name
