# SPDX-License-Identifier: Apache-2.0
"""The search for texture over all disparities."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from color_stereo_ros.core.surface.grid import HalfGrid
from color_stereo_ros.core.surface.grid_kernels import F4, PAD
from color_stereo_ros.core.surface.texture import between_nodes, TextureSearch
from color_stereo_ros.core.surface.tuning import TUNING

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
    images = [search.image(view, 1) for view in (views.left, views.right)]
    first, count = search.narrowed(images)
    assert first + 5 < disparity < first + count - 5
    assert count < search.count / 3


def test_between_two_nodes_lies_their_mean():
    image = np.array([[[10, 0], [20, 4], [40, 4]]], np.uint8)
    expected = [[10, 0], [15, 2], [20, 4], [30, 4], [40, 4], [40, 4]]
    np.testing.assert_array_equal(between_nodes(image), [expected])
