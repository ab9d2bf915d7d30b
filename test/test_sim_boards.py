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
"""Exact images of boards: areas, places and bows are those that were asked for."""

import math

from color_stereo_ros.calibration.boards import Board
from color_stereo_ros.evaluation.corners import facing, rig
from color_stereo_ros.sim import load_scene, Renderer
from color_stereo_ros.sim.board_kernels import board_means
from color_stereo_ros.sim.boards import bent, board_camera, board_pair, board_view
from color_stereo_ros.sim.electronics import expose, exposures_for

import cv2
import naive_corners
import numpy as np
import pytest

CALIBRATION = rig()
CLEAN = {'bayer': 'none', 'lens_blur': 0.0, 'full_well': 1e7, 'read_noise': 0.0, 'dark_level': 0.0,
         'sensitivity': [1.0, 1.0, 1.0], 'bits': 16}


@pytest.mark.parametrize('fine', [1, 3])
@pytest.mark.parametrize('kind', ['chessboard', 'circles'])
def test_the_kernel_equals_its_twin(kind, fine):
    board = Board.usual(kind)
    drawing = board.drawing
    generator = np.random.default_rng(3)
    row, column = np.indices((13, 17)) / 250.0
    grid = np.stack([column + 0.3 * row, row], axis=2) + generator.normal(0, 2e-4, (13, 17, 2))
    grid += 0.02 - 0.035 * (generator.random(2) < 0.5)
    grid[0, 0] = np.nan
    image = np.empty((12 * fine, 16 * fine), np.float32)
    levels = np.array([0.1, 0.9, 0.4])
    board_means(grid, drawing.x, drawing.y, drawing.dark, drawing.disks, 0.01, levels, image)
    for v in range(12 * fine):
        for u in range(16 * fine):
            row, column = v // fine, u // fine
            corners = grid[row:row + 2, column:column + 2].reshape(4, 2)
            cell = naive_corners.cell_of(corners, v % fine, u % fine, fine)
            expected = (levels[2] if np.isnan(corners).any() else
                        naive_corners.board_mean(cell, drawing, 0.01, levels))
            assert image[v, u] == pytest.approx(expected, abs=1e-6)


def test_the_blur_of_a_lens_is_smooth():
    # The profile of a Gaussian lens before square pixels (640 px, 0.32 m: 1 px is 0.5 mm).
    board, f, z, sigma = Board.usual('chessboard'), 640.0, 0.32, 0.5
    model = CALIBRATION.left.__class__('left', 640, 480, 'plumb_bob', [], [
        [f, 0, 319.5], [0, f, 239.5], [0, 0, 1]], np.eye(3), np.eye(3, 4))
    pose = facing(board, z)
    pose.position[:2] = ((200.3 - 319.5) * z / f, (100 - 239.5) * z / f)
    view = board_view(board_camera(model, **{**CLEAN, 'lens_blur': sigma}), board, pose,
                      levels=(0.0, 1.0, 1.0))
    away = np.arange(196, 206)[:, None] - 200.3 + np.linspace(-0.5, 0.5, 400)
    profile = 0.5 - 0.5 * np.vectorize(math.erf)(away / (math.sqrt(2) * sigma)).mean(axis=1)
    np.testing.assert_allclose(view.image[115:125, 196:206, 1].mean(axis=0) / 65535, profile,
                               atol=0.004)


@pytest.mark.parametrize('shift', [0.0, 0.2, 0.37, 0.5, 0.81])
def test_an_edge_covers_its_share_of_a_pixel(shift):
    # 640 px, 0.32 m: 1 px is 0.5 mm. The left edge of the top left square lies at column 200.
    board, f, z = Board.usual('chessboard'), 640.0, 0.32
    model = CALIBRATION.left.__class__('left', 640, 480, 'plumb_bob', [], [
        [f, 0, 319.5], [0, f, 239.5], [0, 0, 1]], np.eye(3), np.eye(3, 4))
    pose = facing(board, z)
    pose.position[:2] = ((200 + shift - 319.5) * z / f, (100 - 239.5) * z / f)
    view = board_view(board_camera(model, **CLEAN), board, pose, levels=(0.0, 1.0, 1.0))
    share = 1 - view.image[105:130, 200, 1] / 65535.0
    # The pixel reaches from 199.5 to 200.5.
    assert share == pytest.approx(np.clip(0.5 - shift, 0, 1), abs=0.006)
    next_one = 1 - view.image[105:130, 201, 1] / 65535.0
    assert next_one == pytest.approx(np.clip(1.5 - shift, 0, 1), abs=0.006)


def test_the_samples_of_a_pixel_have_no_side():
    board, errors = Board.usual('chessboard'), []
    for turn in (13, -17, 28):
        view = board_view(board_camera(CALIBRATION.left, **{**CLEAN, 'lens_blur': 0.5, 'bits': 8}),
                          board, facing(board, 0.4, (0, -7.5, turn)))
        found = board.detect(view.image[..., 1])
        errors.append(found.pixels - view.pixels[found.ids])
    assert np.abs(np.concatenate(errors).mean(axis=0)).max() < 0.001


def test_the_truth_is_the_projection_of_opencv():
    board = Board.usual('chessboard')
    pose = facing(board, 0.4, tilt=(20, 15, 5))
    for view, model, motion in zip(board_pair(CALIBRATION, board, pose),
                                   (CALIBRATION.left, CALIBRATION.right),
                                   ((np.eye(3), np.zeros(3)), CALIBRATION.right_from_left)):
        points = pose.to_parent(board.corners) @ motion[0].T + motion[1]
        pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), model.K, model.D)[0][:, 0]
        assert np.allclose(view.pixels, pixels, atol=1e-9)
        assert view.inside.all()


def test_the_noise_has_a_seed():
    board = Board.usual('chessboard')
    pose = facing(board, 0.4)
    first, again, other = (board_pair(CALIBRATION, board, pose, seed=seed)[0].image
                           for seed in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_corners_move_with_the_bow_of_the_board():
    board = Board.usual('chessboard')
    pose = facing(board, 0.35, tilt=(40, 0, 0))
    bow = (0.002, -0.001)
    view = board_pair(CALIBRATION, board, pose, bend=bow)[0]
    found = board.detect(cv2.cvtColor(view.image, cv2.COLOR_RGB2GRAY))
    error = found.pixels - view.pixels[found.ids]
    flat = board_pair(CALIBRATION, board, pose)[0]
    assert np.abs(view.pixels - flat.pixels).max() > 1.5
    assert np.sqrt((error ** 2).mean()) < 0.05


def test_the_bow_is_zero_at_the_edges_and_full_in_the_middle():
    size, bow = (0.2, 0.1), (0.003, 0.001)
    assert bent([(0.1, 0.05)], size, bow) == pytest.approx(0.004)
    assert bent([(0.0, 0.0), (0.2, 0.1)], size, bow) == pytest.approx(0.0)
    assert bent([(0.0, 0.05)], size, bow) == pytest.approx(0.001)


def test_the_renderer_shows_the_same_board():
    kind = 'chessboard'
    scene = load_scene({'rig': {'base': 'effector', 'cameras': {'speckle': 0.0}}, 'objects': [
        {'shape': 'board', 'kind': kind, 'columns': 7, 'rows': 6, 'square': 0.016,
         'position': [0, 0, 0.4], 'rotation': [20, 10, 5]}]})
    board = Board(kind, 7, 6, 0.016)
    white = np.full((480, 640, 3), 255, np.uint8)
    camera = scene.rig.left
    light = Renderer(scene, samples=4, indirect=False).radiance(camera, white)
    image = expose(light, camera, *exposures_for([light], [camera]), seed=0)
    place = scene.objects[0].pose
    local = place.to_parent(board.corners - (board.size_m[0] / 2, board.size_m[1] / 2, 0.0))
    seen = camera.pose.to_child(local)
    pixels = np.column_stack(camera.pixels(camera.lens.distort(seen[:, :2] / seen[:, 2:],
                                                               camera.D)))
    found = board.detect(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
    assert len(found) == len(board.ids)
    assert np.sqrt(((found.pixels - pixels) ** 2).mean()) < 0.05
