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
"""The contest: small windows tell which plane a node beside a step belongs to."""

from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.compiled import Arena
from color_stereo_ros.core.surface.contest import Contest
from color_stereo_ros.core.surface.contest_kernels import NEIGHBOR, OWN, SEED
from color_stereo_ros.core.surface.grid import HalfGrid
from color_stereo_ros.core.surface.grid_kernels import F4
from color_stereo_ros.core.surface.planes import PlaneField
from color_stereo_ros.core.surface.tuning import TUNING

import cv2

import naive_surface as naive

import numpy as np

import pytest

from surface_pairs import exposed, photographed, plane, rig, surface_settings

ROWS, COLUMNS = 40, 64
EDGE = 32  # column of the nodes at which the near surface begins
FAR, NEAR = 6.0, 18.0  # disparities, px
CONTEST, SEED_VARIANCE = TUNING.contest, TUNING.brightness.disputed_std ** 2


def light_of(shape, rng):
    """Return fine texture, uint8 (rows, columns, 3)."""
    light = cv2.GaussianBlur(rng.normal(size=(*shape, 3)), (0, 0), 1.2)
    return np.clip(120 + 160 * light, 0, 255).astype(np.uint8)


def step_pair(gain=1.0):
    """Return the images of a far surface and of a near one on its right, see `Contest.hold`."""
    rng = np.random.default_rng(3)
    width = 2 * COLUMNS
    far, near = (light_of((ROWS, width + 64), rng) for _ in range(2))
    left = np.where(np.arange(width)[:, None] < 2 * EDGE, far[:, 32:-32], near[:, 32:-32])
    place = np.arange(width)
    right = far[:, place + 32 + int(FAR)].copy()
    seen = (place + int(NEAR) >= 2 * EDGE) & (place + int(NEAR) < width)
    right[:, seen] = near[:, place[seen] + 32 + int(NEAR)]
    right = np.clip(right / gain, 0, 255).astype(np.uint8)
    return np.ascontiguousarray(left[:, ::2]), right


def truth():
    """Return the disparities of the nodes."""
    return np.broadcast_to(np.where(np.arange(COLUMNS) < EDGE, FAR, NEAR), (ROWS, COLUMNS))


def mixed_planes(shift=3):
    """Return planes whose step lies some nodes beside the true one."""
    grid = HalfGrid(2 * ROWS, 2 * COLUMNS)
    planes = PlaneField(grid, 1.0, True, Arena())
    planes.d[grid.inner] = np.roll(truth(), shift, axis=1)
    planes.d[grid.inner][:, :shift] = FAR
    for array, value in ((planes.a, 0), (planes.b, 0), (planes.variance, 0.04)):
        array[grid.inner] = value
    return planes


def held(planes, images, seed=None, balance=0.0):
    """Hold one contest; return the winners."""
    grid = planes.grid
    contest = Contest(grid, TUNING, Arena())
    contest.hold(planes, images, np.full(grid.nodes, balance, F4), seed)
    return contest.winner


def right_share(planes):
    """Return the share of nodes of the right surface, but those beside the border."""
    inner = np.s_[2:-2, 10:-2]
    return np.mean(np.abs(planes.d[planes.grid.inner] - truth())[inner] < 0.1)


def test_a_step_goes_where_small_windows_see_it():
    planes, images = mixed_planes(), step_pair()
    before = right_share(planes)
    for _ in range(3):  # a plane travels one node in each contest
        winner = held(planes, images)
    assert before < 0.95 and right_share(planes) > 0.99
    assert np.mean(winner == OWN) > 0.95


def test_seeds_win_at_once():
    planes = mixed_planes()
    seed = np.full(planes.grid.shape, np.nan, F4)
    seed[planes.grid.inner] = truth()
    winner = held(planes, step_pair(), seed)
    assert right_share(planes) > 0.99
    won = winner == SEED
    assert won.any() and (planes.variance[planes.grid.inner][won] == F4(SEED_VARIANCE)).all()


def test_a_surface_without_steps_keeps_its_planes():
    planes = mixed_planes()
    inner = planes.grid.inner
    planes.d[inner] = FAR + np.random.default_rng(1).normal(0, 0.1, planes.grid.nodes)
    kept = planes.d[inner].copy()
    assert (held(planes, step_pair()) == OWN).all()
    assert np.array_equal(planes.d[inner], kept)


@pytest.mark.parametrize('gain', [0.7, 1.4])
def test_light_of_which_one_camera_sees_more_is_evened_out(gain):
    planes, images = mixed_planes(), step_pair(gain)
    for _ in range(3):
        held(planes, images, balance=(gain - 1) / (gain + 1))
    assert right_share(planes) > 0.98


def test_what_is_unknown_takes_no_plane_that_fits_nowhere():
    """All candidates point outside the right view."""
    planes = mixed_planes()
    inner = planes.grid.inner
    planes.d[inner] = 900.0
    planes.d[inner][10:20, 20:30] = np.nan
    assert (held(planes, step_pair()) == OWN).all()
    assert np.isnan(planes.d[inner][10:20, 20:30]).all()


def test_a_neighbor_hands_over_its_slope_and_its_variance():
    planes = mixed_planes(1)
    inner = planes.grid.inner
    planes.a[inner], planes.b[inner] = 0.02, 0.01
    planes.variance[inner] = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    before = [each[inner].copy() for each in (planes.d, planes.a, planes.b, planes.variance)]
    winner = held(planes, step_pair())
    changed = np.argwhere(winner == NEIGHBOR)
    assert changed.size
    for y, x in changed[1:-1]:
        sources = [(y + j, x + i, j, i) for j, i in ((1, 0), (-1, 0), (0, 1), (0, -1))
                   if 0 <= y + j < ROWS and 0 <= x + i < COLUMNS]
        assert any(np.allclose(
            (planes.d[inner][y, x], planes.variance[inner][y, x]),
            (before[0][v, u] - before[1][v, u] * i - before[2][v, u] * j, before[3][v, u]))
            for v, u, j, i in sources)


@pytest.mark.parametrize('weak', [True, False])
def test_weak_pairs_hold_the_contest_and_winners_are_not_sure(monkeypatch, weak):
    width, height = 320, 240
    truth = plane(width, height, 22.0, 0.0)
    truth[:, width // 2:] += 8
    rng = np.random.default_rng(5)
    images = [exposed(photographed(shift), rng) for shift in (-truth, 0 * truth)]
    stereo = ColorStereo(rig(width, height), surface_settings(15, 35), rectified_input=True)
    method = stereo._method
    stereo.process(*images)
    method.contest.winner[:] = SEED  # of no pair
    monkeypatch.setattr(type(method.steps), 'weakness', lambda *rest: float(weak))
    bounded = []
    monkeypatch.setattr(type(method.steps), 'bound', lambda steps, verdict, nodes, bound=type(
        method.steps).bound: (bound(steps, verdict, nodes), bounded.append((
            nodes.copy(), verdict.log_odds[method.views.grid.inner].copy()))))
    result = stereo.process(*images)
    assert np.nanmedian(np.abs(result.disparity - truth)) < 0.1
    if not weak:
        assert not bounded and (method.contest.winner == SEED).all()
        return
    (winners, odds), = bounded
    assert winners.any() and (odds[winners] <= F4(TUNING.steps.kept_odds)).all()
    assert np.median(odds) > TUNING.steps.kept_odds
    assert set(np.unique(method.contest.winner)) == {OWN, NEIGHBOR}


def test_winners_of_pairs_whose_planes_seeds_hold_are_not_sure():
    width, height = 320, 240
    truth = plane(width, height, 22.0, 0.0)
    truth[:, width // 2:] += 8
    rng = np.random.default_rng(5)
    gray = [np.repeat(exposed(photographed(shift), rng)[..., :1], 3, axis=2)
            for shift in (-truth, 0 * truth)]
    stereo = ColorStereo(rig(width, height), surface_settings(15, 35), rectified_input=True)
    stereo.process(*gray)
    method = stereo._method
    winners = method.contest.changed
    odds = method.trust.verdict.log_odds[method.views.grid.inner]
    assert winners.any() and (odds[winners] <= F4(TUNING.steps.kept_odds)).all()


def test_the_kernel_agrees_with_its_naive_twin():
    rng = np.random.default_rng(8)
    left, right = step_pair()
    planes = mixed_planes()
    grid, inner = planes.grid, planes.grid.inner
    planes.d[inner] += rng.normal(0, 2, grid.nodes)
    planes.d[inner][rng.random(grid.nodes) < 0.05] = np.nan
    planes.a[inner], planes.b[inner] = rng.normal(0, 0.1, (2, *grid.nodes))
    planes.variance[inner] = rng.uniform(0.01, 1, grid.nodes)
    seed = np.full(grid.shape, np.nan, F4)
    seed[inner] = np.where(rng.random(grid.nodes) < 0.5, truth(), np.nan)
    balance = rng.uniform(-0.2, 0.2, grid.nodes).astype(F4)
    old = [each.copy() for each in (planes.d, planes.a, planes.b, planes.variance)]
    contest = Contest(grid, TUNING, Arena())
    wanted = contest.wanted(planes.d, seed)
    contest.hold(planes, (left, right), balance, seed)
    cap, margin = 3 * CONTEST.cap, 27 * CONTEST.margin
    gain = (1 + balance) / (1 - balance)
    for y, x in zip(*(rng.integers(0, count, 400) for count in grid.nodes)):
        expected = naive.contest(left, right, gain, wanted, seed, SEED_VARIANCE, cap, margin, old,
                                 y, x)
        got = [each[inner][y, x] for each in (planes.d, planes.a, planes.b, planes.variance)]
        np.testing.assert_allclose(got, expected[:4], rtol=1e-5, atol=1e-5)
        assert contest.winner[y, x] == expected[4]
