# SPDX-License-Identifier: Apache-2.0
"""The search for texture over all disparities."""

from types import SimpleNamespace

import cv2
from color_stereo_ros.core.compiled import Arena
from color_stereo_ros.core.surface.brightness import BrightnessCarrier
from color_stereo_ros.core.surface.grid import HalfGrid
from color_stereo_ros.core.surface.grid_kernels import F4, PAD
from color_stereo_ros.core.surface.texture import (
    drop_small_surfaces, likeness, TextureSearch)
from color_stereo_ros.core.surface.tuning import TUNING
import naive_surface as naive
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
    found = 2 * TextureSearch(grid, limits, TUNING, Arena()).search(views, True).disparity
    assert found.shape == grid.nodes
    middle = found[5:-5, 15:-15]
    assert np.mean(np.abs(middle - disparity) < 0.5) > 0.99


@pytest.mark.parametrize('disparity', [-7, 13])
def test_a_small_pair_tells_which_disparities_are_searched(disparity):
    grid, views = views_of(disparity)
    search = TextureSearch(grid, (-150, 140), TUNING, Arena())
    images = [search.image(view, 1) for view in (views.left, views.right)]
    first, count = search.narrowed(images)
    assert first + 5 < disparity < first + count - 5
    assert count < search.count / 3


def test_what_is_not_alike_counts_for_nothing():
    rng = np.random.default_rng(6)
    left = rng.integers(0, 255, (20, 30, 3)).astype(np.uint8)
    right = np.repeat(left, 2, axis=1)
    right[:, 30:] = rng.integers(0, 255, (20, 30, 3))
    disparity = np.zeros((20, 30), F4)
    disparity[0, 0] = np.nan
    found = likeness((left, right), disparity, 5)
    assert np.isnan(found[0, 0])
    assert np.all(found[3:-3, 3:12] > 0.99)
    assert np.abs(found[:, 18:]).max() < 0.7
    assert np.abs(likeness((0 * left, 0 * right), disparity, 5)[3:-3, 3:-3]).max() == 0


def test_small_surfaces_are_dropped():
    disparity = np.full((12, 12), np.nan, F4)
    disparity[2:4, 2:6], disparity[6:9, 2:6] = 20, -3.5  # 8 and 12 px
    drop_small_surfaces(disparity, 8)
    assert np.isnan(disparity[:5]).all()
    np.testing.assert_array_equal(disparity[6:9, 2:6], -3.5)


@pytest.mark.parametrize('seeded', [True, False])
def test_seeds_settle_disputes_as_their_naive_twin(seeded):
    rng = np.random.default_rng(7)
    grid = HalfGrid(2 * ROWS, 2 * COLUMNS)
    seed = rng.uniform(-20, 60, grid.nodes).astype(F4)
    seed[rng.random(seed.shape) < 0.1] = np.nan
    planes = [np.full(grid.shape, 7, F4) for _ in range(4)]
    near = seed + rng.uniform(-2, 2, seed.shape).astype(F4)
    planes[0][grid.inner] = np.where(rng.random(seed.shape) < 0.2, np.nan, near)
    before = [each.copy() for each in planes]
    field = SimpleNamespace(grid=grid, **dict(zip(('d', 'a', 'b', 'variance'), planes)))
    framed = np.full(grid.shape, np.nan, F4)
    framed[grid.inner] = seed
    carrier = SimpleNamespace(seeded=seeded, seed=framed, tuning=TUNING.brightness)
    BrightnessCarrier.settle_disputes(carrier, field)
    inner = [each[grid.inner] for each in before]
    expected = naive.settle_disputes(seed, inner[:3], inner[3], grid.width,
                                     TUNING.brightness) if seeded else inner
    for found, old, new in zip(planes, before, expected):
        np.testing.assert_array_equal(found[grid.inner], new)
        found[grid.inner] = old[grid.inner]  # nothing else is written
        np.testing.assert_array_equal(found, old)
    if seeded:
        assert 0.2 < np.mean(expected[3] != inner[3]) < 0.8
