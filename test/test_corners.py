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
"""Corners of rendered boards: exact places, honest standard deviations."""

from color_stereo_ros.calibration import charuco
from color_stereo_ros.calibration.bending import bends
from color_stereo_ros.calibration.boards import Board
from color_stereo_ros.calibration.circles import eccentricity
from color_stereo_ros.calibration.corner_kernels import COUNT, fit_corners
from color_stereo_ros.calibration.corners import refined
from color_stereo_ros.calibration.gray import channel_gains, gray_of
from color_stereo_ros.errors import InstallationError
from color_stereo_ros.evaluation.corners import CASES, facing, measured, rig
from color_stereo_ros.sim.boards import board_pair

import cv2
import naive_corners
import numpy as np
import pytest

BARS = {('chessboard', 'usual'): 0.03, ('chessboard', 'steep'): 0.03, ('charuco', 'usual'): 0.05,
        ('charuco', 'steep'): 0.05, ('circles', 'usual'): 0.06}
ELECTRONICS = {'noise': {'full_well': 2000.0}, 'no mosaic': {'bayer': 'none'},
               'blurred': {'lens_blur': 1.0}, 'gamma': {'response': 2.2},
               'edge-aware': {'demosaicing': 'edge_aware'}}
VALUES = np.array([15.3, 14.6, 0.2, 1.9, np.log(0.8), np.log(1.1), 60.0, 120.0, 0.02, -0.03])


def patch(values=VALUES, noise=1.0, seed=1, size=31):
    """Return an image of one corner, uint8 (size, size)."""
    image = [[naive_corners.model(values, x, y) for x in range(size)] for y in range(size)]
    image = np.array(image) + np.random.default_rng(seed).normal(0, noise, (size, size))
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def squares(values=VALUES, side=20.0):
    """Return px per square (1, 2, 2) whose sides lie along the edges of a corner."""
    along = [(np.cos(angle), np.sin(angle)) for angle in values[2:4]]
    return side * np.array(along).T[None]


@pytest.mark.parametrize('gap, bend', [(10.0, (0.0, 0.0)), (0.3, (2e-3, -1e-3))])
def test_the_fit_equals_its_twin(gap, bend):
    image, side = patch(), 16.0
    inverse = np.linalg.inv(squares(side=side))
    start, black = np.array([[15.0, 15.0]]), np.array([1.0])
    found = np.empty((1, COUNT + 4))
    fit_corners(image, start, inverse, black, np.array([bend]), 0.5, gap, 1.5, 14, True, found)
    pixels = naive_corners.window(image, start[0], inverse[0], 0.5, gap, 1.5, black[0], 14)
    twin = naive_corners.fitted(found[0, :COUNT] + 0.02, pixels, bend)
    assert found[0, :2] == pytest.approx(twin[:2], abs=2e-4)
    assert found[0, 2:COUNT] == pytest.approx(twin[2:], rel=2e-2, abs=2e-2)
    residual = [value - naive_corners.model(twin, x, y, bend) for x, y, value in zip(*pixels)]
    assert found[0, COUNT] == pytest.approx(
        np.sqrt(np.square(residual).sum() / (len(residual) - COUNT)), rel=1e-3)
    assert found[0, COUNT + 1:] == pytest.approx(naive_corners.spread(twin, pixels, bend),
                                                 rel=2e-2)


def test_known_corners_come_back():
    generator = np.random.default_rng(2)
    errors, sigmas = [], []
    for seed in range(60):
        values = VALUES + 0.0
        values[:2] += generator.uniform(-0.5, 0.5, 2)
        values[2:4] += generator.uniform(-0.3, 0.3, 2)
        good, pixels, sigma = refined(patch(values, 2.0, seed), values[None, :2] + 0.6,
                                      squares(values), np.array([True]))
        assert good.all()
        errors.append(pixels[0] - values[:2])
        sigmas.append(sigma[0])
    ratio = np.abs(errors) / np.array(sigmas)[:, None]
    assert np.sqrt(np.square(errors).mean()) < 0.02
    assert 0.8 < np.percentile(ratio, 68) < 1.25
    assert 0.8 < np.sqrt(np.square(errors).mean() / np.square(sigmas).mean()) < 1.25


def test_the_bend_of_a_line_is_seen_in_its_corners():
    row, column = np.indices((6, 8))
    x, y = 25.0 * column - 90, 25.0 * row - 60
    bend = 1e-4  # 1 / px, of the lines along x
    pixels = np.stack([x, y + bend / 2 * x ** 2], axis=2).reshape(-1, 2)
    ids = np.delete(np.arange(48), [9, 20])  # two were not found
    found = bends((6, 8), ids, pixels[ids])
    np.testing.assert_allclose(found[:, 0], bend, rtol=0.1)
    np.testing.assert_allclose(found[:, 1], 0.0, atol=1e-9)
    np.testing.assert_array_equal(bends((6, 8), ids[:1], pixels[ids[:1]]), 0.0)


def test_lines_may_bend_more_at_the_edge_of_a_board():
    row, column = np.indices((8, 11))
    x, y = 40.0 * column - 200, 40.0 * row - 140
    bend = 1e-4 + 3e-7 * x + 1e-9 * x * x  # 1 / px, along x
    pixels = np.stack([x, y + 5e-5 * x ** 2 + 5e-8 * x ** 3 + 1e-9 / 12 * x ** 4], axis=2)
    pixels[3, 4] += 0.5  # a wrong corner
    found = bends((8, 11), np.arange(88), pixels.reshape(-1, 2))
    np.testing.assert_allclose(found[:, 0], bend.ravel(), atol=4e-6)


@pytest.mark.parametrize('bend', [(3e-3, 0.0), (-2e-3, 2e-3)])
def test_bent_edges_do_not_move_a_corner(bend):
    image = np.round([[naive_corners.model(VALUES, x, y, bend) for x in range(31)]
                      for y in range(31)]).astype(np.uint8)
    straight, right = (refined(image, VALUES[None, :2] + 0.3, squares(), np.array([True]),
                               bends_of=lambda known, found: np.array([each]))[1][0] - VALUES[:2]
                       for each in ((0.0, 0.0), bend))
    assert np.abs(right).max() < 0.01 < np.abs(straight).max()


@pytest.mark.parametrize('image', [
    np.full((31, 31), 90, np.uint8), np.tile(np.uint8(8 * np.arange(31)), (31, 1)),
    np.random.default_rng(1).integers(0, 256, (31, 31)).astype(np.uint8)],
    ids=['flat', 'ramp', 'noise'])
def test_what_is_no_corner_is_left_out(image):
    good, pixels, sigma = refined(image, np.array([[15.0, 15.0]]), squares(), np.array([False]))
    assert not good.any() and np.isnan(pixels).all() and np.isnan(sigma).all()


def test_a_corner_of_the_wrong_colors_is_left_out():
    assert refined(patch(), VALUES[None, :2], squares(), np.array([True]))[0].all()
    assert not refined(patch(), VALUES[None, :2], squares(), np.array([False]))[0].any()


@pytest.mark.parametrize('kind, name', [
    case for case in CASES if case[0] != 'charuco' or charuco.is_available()])
def test_corners_of_rendered_boards_meet_their_bars(kind, name, effort, figures):
    rounds = effort.count(3, 40)
    found = measured(kind, CASES[kind, name], rounds, seed=5)['ours']
    figures(f'corner error, {kind}, {name} tilt', found.rms, 'px', over=rounds,
            at_most=BARS[kind, name])
    figures(f'z68 of corners, {kind}, {name} tilt', found.z68, '', over=rounds, at_least=0.8,
            at_most=1.25)


def test_sigmas_hold_for_other_cameras(effort, figures):
    rounds = effort.count(2, 20)
    for name in ELECTRONICS if effort.full else ('noise', 'gamma'):
        found = measured('chessboard', CASES['chessboard', 'usual'], rounds, seed=11,
                         **ELECTRONICS[name])['ours']
        figures(f'z68 of corners, {name}', found.z68, '', over=rounds, at_least=0.8, at_most=1.25)


@pytest.mark.parametrize('sensitivity', [(1.0, 1.0, 1.0), (1.0, 1.0, 0.5), (0.6, 1.0, 0.9)])
def test_a_mosaic_does_not_move_edges_along_the_pixels(sensitivity):
    board, errors = Board.usual('chessboard'), []
    for view in board_pair(rig(), board, facing(board, 0.4, (0, -7.5, 0.3)),
                           sensitivity=sensitivity):
        gains = channel_gains(view.image)
        np.testing.assert_allclose(gains, sensitivity / np.max(sensitivity), atol=0.06)
        found = board.detect(gray_of(view.image))
        errors.append(found.pixels - view.pixels[found.ids])
    assert np.sqrt(np.square(errors).mean()) < 0.02  # .06 with the usual weights of R, G and B


def test_a_gray_image_and_one_of_weak_channels_stay_what_they_are():
    gray = patch()
    np.testing.assert_array_equal(gray_of(np.repeat(gray[..., None], 3, axis=2)), gray)
    red = np.zeros((*gray.shape, 3), np.uint8)
    red[..., 0] = gray
    np.testing.assert_allclose(channel_gains(red), (1, 0.25, 0.25))


def test_a_board_that_reaches_beyond_the_image_keeps_its_ids():
    if not charuco.is_available():
        with pytest.raises(InstallationError):
            Board('charuco')
        return
    board = Board.usual('charuco')
    view = board_pair(rig(), board, facing(board, 0.24, (40, 0, 10), x=0.09))[0]
    found = board.detect(gray_of(view.image))
    assert not view.inside.all() and len(found) > 0.8 * view.inside.sum()
    assert np.abs(found.pixels - view.pixels[found.ids]).max() < 0.5


def test_the_center_of_an_ellipse_is_not_that_of_its_circle():
    homography = np.array([[900.0, 40, 100], [30, 800, 80], [0.4, 2.0, 1]])
    angles = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    center, radius = np.array([0.05, 0.08]), 0.02
    rim = center + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    seen = cv2.perspectiveTransform(rim[None], homography)[0].astype(np.float32)
    moments = cv2.moments(seen)
    middle = np.array([moments['m10'], moments['m01']]) / moments['m00']
    place = cv2.perspectiveTransform(center[None, None], homography)[0, 0]
    assert eccentricity(homography, [center], radius)[0] == pytest.approx(middle - place,
                                                                          abs=1e-3)
