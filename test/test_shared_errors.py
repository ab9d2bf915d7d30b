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
"""Errors of slow colors that whole windows share: found across the slope, known in the std."""

from types import SimpleNamespace

from color_stereo_ros.core.surface.grid import HalfGrid
from color_stereo_ros.core.surface.grid_kernels import F4, SILENT_VARIANCE
from color_stereo_ros.core.surface.shared import SharedErrors, slope
from color_stereo_ros.core.surface.tuning import TUNING
import numpy as np
import pytest

HEIGHT, WIDTH = 120, 240
SLOPE = 0.01  # 1/px


def slow_pair(error, period=None):
    """Return errors, views, planes and pair: d = 20 px, the second component of the right off."""
    grid = HalfGrid(HEIGHT, WIDTH)
    rows, columns = grid.nodes
    frame = np.full((rows + 2 * grid.inner[0].start, columns + 2 * grid.inner[1].start), np.nan,
                    F4)
    at = SharedErrors(grid, TUNING.shared)

    def color(x):
        return SLOPE * x if period is None else np.sin(2 * np.pi * x / period)

    def view(x, offset, framed):
        planes = {'u': np.broadcast_to(color(x), (rows, x.size)), 'v': np.full(
            (rows, x.size), offset), 'variance': np.full((rows, x.size), 1e-4)}
        full = {name: np.full(frame.shape if framed else (frame.shape[0], x.size),
                              SILENT_VARIANCE if name == 'variance' else 0, F4)
                for name in planes}
        for name, plane in planes.items():
            full[name][grid.inner if framed else grid.inner[0]] = plane
        return SimpleNamespace(**full)

    views = SimpleNamespace(left=view(2.0 * np.arange(columns), 0.0, True),
                            right=view(np.arange(WIDTH) + 20.0, error, False))
    planes = SimpleNamespace(d=frame.copy(), variance=frame.copy())
    planes.d[grid.inner], planes.variance[grid.inner] = 20, 1e-6
    return at, views, planes, SimpleNamespace(matrix=np.eye(2, 3, dtype=F4), scale=F4(1))


@pytest.mark.parametrize('error', [0.002, 0.005])
def test_an_error_across_the_slope_widens_by_its_share_of_the_slope(error):
    at, views, planes, pair = slow_pair(error)
    assert at.widen(views, planes, pair, None)
    middle = planes.variance[at.grid.inner][20:40, 40:80]
    expected = np.sqrt(TUNING.shared.gain) * error / SLOPE
    np.testing.assert_allclose(np.sqrt(middle), expected, rtol=0.02)


def test_colors_that_agree_and_colors_that_change_fast_widen_nothing():
    at, views, planes, pair = slow_pair(0.0)
    assert at.widen(views, planes, pair, None)
    assert np.nanmax(planes.variance[at.grid.inner][20:40, 40:80]) < 2e-6
    at, views, planes, pair = slow_pair(0.005, period=16)
    assert not at.widen(views, planes, pair, None)
    assert np.nanmax(planes.variance) < 2e-6


def test_other_carriers_take_their_share_of_the_error():
    at, views, planes, pair = slow_pair(0.005)
    alone = slow_pair(0.005)[2]
    at.widen(views, alone, pair, None)
    own = SLOPE ** 2 / 2e-4
    at.widen(views, planes, pair, np.full(planes.d.shape, 4 * own, F4))
    ratio = planes.variance[at.grid.inner][30, 60] / alone.variance[at.grid.inner][30, 60]
    assert ratio == pytest.approx(1 / 16, rel=0.02)


def test_where_ranges_are_rough_brightness_holds_nothing():
    at, views, planes, pair = slow_pair(0.005)
    alone = slow_pair(0.005)[2]
    at.widen(views, alone, pair, None)
    weight = np.full(planes.d.shape, 4 * SLOPE ** 2 / 2e-4, F4)
    at.widen(views, planes, pair, weight, rough=1.0)
    assert planes.variance[at.grid.inner][30, 60] == pytest.approx(
        alone.variance[at.grid.inner][30, 60], rel=1e-3)


def test_ranges_are_rough_by_the_median_of_their_second_differences():
    at, _, planes, _ = slow_pair(0.0)
    low, high = TUNING.shared.rough
    ranges = np.full(planes.d.shape, -1, F4)
    ranges[at.grid.inner][:, :60] = 1
    uneven = np.full(at.grid.nodes, high + 1, F4)
    for value, rough in ((low - 0.1, 0), ((low + high) / 2, 0.5), (high + 0.1, 1)):
        uneven[:, :60] = value
        assert at.roughness(uneven, ranges) == pytest.approx(rough, abs=1e-3)
    assert at.roughness(uneven, np.full_like(ranges, -1)) == 0


def test_a_node_of_a_rough_pair_is_no_more_certain_than_the_usual_one():
    at = slow_pair(0.0)[0]
    verdict = SimpleNamespace(std=np.array([0.1, 1.0, 1.0], F4),
                              log_odds=np.array([9.0, 2.0, 2.0], F4))
    at.cap(verdict, rough=1.0)
    np.testing.assert_allclose(verdict.log_odds, 0.77)


def test_log_odds_do_not_exceed_those_of_a_normal_error():
    at = slow_pair(0.0)[0]
    verdict = SimpleNamespace(std=np.array([0.1, 0.5, 1.0, 5.0], F4),
                              log_odds=np.array([9.0, 9.0, 9.0, 0.5], F4))
    at.cap(verdict)
    np.testing.assert_allclose(verdict.log_odds, (9, 3.04, 0.77, 0.5))


def test_slopes_are_those_of_pixels():
    plane = np.broadcast_to(F4(SLOPE) * 2 * np.arange(40, dtype=F4), (9, 40))
    np.testing.assert_allclose(slope(plane, 4)[:, 8:-8], SLOPE, rtol=1e-4)
