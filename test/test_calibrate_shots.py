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
"""Pairs of files, what is seen in them, and the sentences about what is wrong with them."""

from dataclasses import replace

from board_shots import BOARD, images, SIZE

from color_stereo_ros.calibration.boards import Board
from color_stereo_ros.calibration.edge_width import edge_width
from color_stereo_ros.calibration.gray import gray_of
from color_stereo_ros.calibration.pairs import find_pairs, ImagePair
from color_stereo_ros.calibration.shots import check_sizes, detect_shot, without_blurred
from color_stereo_ros.calibration.still import moved, PAIRS, StillWatch
from color_stereo_ros.calibration.suspicions import check_shots
from color_stereo_ros.errors import CalibrationError, RecordingError

import cv2

import numpy as np

import pytest

COUNT = 8


def touched(folder, *names):
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).touch()
    return folder


def names_of(found):
    return [(pair.left.name, pair.right.name) for pair in found.pairs]


def test_files_of_one_folder_pair_by_what_is_beside_left_and_right(tmp_path):
    found = find_pairs(touched(tmp_path, 'left_10.png', 'left_9.png', 'right_9.png', 'notes.txt',
                               'right_10.png', 'right_11.png'))
    assert names_of(found) == [('left_9.png', 'right_9.png'), ('left_10.png', 'right_10.png')]
    assert found.alone == ['right_11.png']


def test_two_folders_pair_by_number(tmp_path):
    found = find_pairs(touched(tmp_path / 'a', 'cam_a_001.png', 'cam_a_002.png'),
                       touched(tmp_path / 'b', 'other2.png', 'other1.png'))
    assert names_of(found) == [('cam_a_001.png', 'other1.png'), ('cam_a_002.png', 'other2.png')]


def test_the_folders_left_and_right_in_a_folder_are_those_of_the_cameras(tmp_path):
    touched(tmp_path / 'left', '1.png')
    touched(tmp_path / 'right', '1.png')
    assert names_of(find_pairs(tmp_path)) == [('1.png', '1.png')]


def test_stamps_pair_with_the_nearest_one_and_keep_their_difference(tmp_path):
    found = find_pairs(touched(tmp_path / 'a', '1700000000.100.png', '1700000000.200.png'),
                       touched(tmp_path / 'b', '1700000000.203.png', '1700000000.101.png'))
    assert [pair.skew for pair in found.pairs] == [1_000_000, 3_000_000]


@pytest.mark.parametrize('left, right', [('100', '250'), ('100', '121')])
def test_stamps_too_far_apart_do_not_pair(tmp_path, left, right):
    with pytest.raises(RecordingError, match='no two images belong together'):
        find_pairs(touched(tmp_path / 'a', f'1700000000.{left}.png'),
                   touched(tmp_path / 'b', f'1700000000.{right}.png'))


def test_a_folder_without_images_is_refused_with_what_is_expected(tmp_path):
    with pytest.raises(RecordingError, match='expected files such as left_001.png'):
        find_pairs(touched(tmp_path, 'img_1.png'))
    with pytest.raises(RecordingError, match='there is no such folder'):
        find_pairs(tmp_path / 'nowhere')


@pytest.fixture(scope='module')
def shots():
    return [detect_shot(BOARD, ImagePair(f'view {index}', *images(index)))
            for index in range(COUNT)]


def reopened(place):
    return [gray_of(image) for image in images(place)]


def with_side(shot, side, detection):
    return replace(shot, **{side: detection})


def test_good_shots_pass(shots):
    check_shots(BOARD, shots, SIZE, reopened)
    assert check_sizes(shots) == SIZE
    assert all(shot.problem is None for shot in without_blurred(shots))


def test_mixed_resolutions_are_refused_by_name(shots):
    small = (320, 240)
    odd = [*shots, replace(shots[0], name='the odd one', sizes=(SIZE, small))]
    with pytest.raises(CalibrationError, match='right image of the odd one has 320 x 240 px'):
        check_sizes(odd)
    with pytest.raises(CalibrationError, match='left images have 640 x 480 px, right images 320'):
        check_sizes([replace(shot, sizes=(SIZE, small)) for shot in shots])


def test_too_few_views_are_refused_with_the_counts(shots):
    with pytest.raises(CalibrationError, match='left 3, right 3, both 3 of 3 views'):
        check_shots(BOARD, shots[:3], SIZE, reopened)


def test_a_board_in_no_image_is_refused_with_its_description(shots):
    empty = [replace(shot, left=None, right=None) for shot in shots]
    gray = np.full(SIZE[::-1], 90, np.uint8)
    with pytest.raises(CalibrationError, match=f'no image shows the {BOARD.describe()[:10]}'):
        check_shots(BOARD, empty, SIZE, lambda place: (gray, gray))


def test_a_board_seen_by_one_camera_only_is_refused_with_its_name(shots):
    alone = [with_side(shot, 'left', None) for shot in shots]
    gray = np.full(SIZE[::-1], 90, np.uint8)
    with pytest.raises(CalibrationError, match='seen by the right camera only'):
        check_shots(BOARD, alone, SIZE, lambda place: (gray, reopened(place)[1]))


def test_parallel_boards_are_refused(shots):
    same = [shots[0]] * 5
    with pytest.raises(CalibrationError, match='nearly parallel for the left camera'):
        check_shots(BOARD, same, SIZE, reopened)


def test_exchanged_cameras_are_refused(shots):
    exchanged = [replace(shot, left=shot.right, right=shot.left) for shot in shots]
    with pytest.raises(CalibrationError, match=r'about 0\.(19|20|21) m to the left of the left '
                       'one: exchange the images of the two cameras'):
        check_shots(BOARD, exchanged, SIZE)


def mirrored(image):
    return np.ascontiguousarray(image[:, ::-1])


@pytest.mark.parametrize('side', [0, 1])
def test_one_mirrored_camera_is_named(side):
    pairs = [[mirrored(image) if place == side else image
              for place, image in enumerate(images(index))] for index in range(COUNT)]
    shots = [detect_shot(BOARD, ImagePair(f'view {index}', *pair))
             for index, pair in enumerate(pairs)]
    with pytest.raises(CalibrationError, match=f'{("left", "right")[side]} camera are mirrored'):
        check_shots(BOARD, shots, SIZE,
                    lambda place: [gray_of(image) for image in pairs[place]])


def test_mirrored_images_of_a_charuco_board_are_told_from_missing_boards():
    pytest.importorskip('cv2.aruco')
    board = Board('charuco', 9, 6, 0.025)
    pairs = [[mirrored(image) for image in images(index, 0.45, board)] for index in range(4)]
    shots = [detect_shot(board, ImagePair(f'{index}', *pair)) for index, pair in enumerate(pairs)]
    with pytest.raises(CalibrationError, match='left and the right images only when they are mir'):
        check_shots(board, shots, SIZE, lambda place: [gray_of(image) for image in pairs[place]])


def test_pairs_that_are_one_view_off_are_refused_with_the_shift(shots):
    late = [with_side(first, 'right', second.right) for first, second in zip(shots[1:], shots)]
    with pytest.raises(CalibrationError, match='image of the left camera belongs to the right one '
                       '1 view before it|image of the right camera belongs'):
        check_shots(BOARD, late, SIZE)


def test_unsynchronized_pairs_are_refused_with_their_skew(shots):
    order = np.random.default_rng(5).permutation(COUNT)
    mixed = [replace(shot, right=shots[other].right, skew=int(4e6))
             for shot, other in zip(shots, order)]
    with pytest.raises(CalibrationError) as refusal:
        check_shots(BOARD, mixed, SIZE)
    assert 'not taken at the same moment' in str(refusal.value)
    assert '4.0 ms' in str(refusal.value)


def test_a_camera_that_was_moved_between_views_is_found(shots):
    turn = cv2.Rodrigues(np.radians([0.0, 4.0, 1.0]))[0]
    camera = np.array([[640.0, 0, 319.5], [0, 640.0, 239.5], [0, 0, 1]])
    moves = camera @ turn @ np.linalg.inv(camera)

    def turned(shot):
        pixels = cv2.perspectiveTransform(shot.right.pixels[None], moves)[0]
        return with_side(shot, 'right', replace(shot.right, pixels=pixels))

    with pytest.raises(CalibrationError, match='moved between view 3 and view 4'):
        check_shots(BOARD, [*shots[:4], *map(turned, shots[4:])], SIZE)


def test_motion_blur_is_measured_and_the_view_named(shots):
    kernel = np.full((1, 9), 1 / 9, np.float32)
    blurred = [cv2.filter2D(image, -1, kernel) for image in images(0)]
    shot = detect_shot(BOARD, ImagePair('shaken', *blurred))
    assert min(shot.widths) > 6.0
    judged = without_blurred([*shots, shot])
    assert 'blurred: edges of the left image are' in judged[-1].problem
    assert all(each.problem is None for each in judged[:-1])


def test_the_width_of_an_edge_is_its_contrast_over_its_slope():
    shot = detect_shot(BOARD, ImagePair('sharp', *images(1)))
    gray = cv2.GaussianBlur(gray_of(images(1)[0]), (0, 0), 2.0)
    # sqrt(2 pi) sigma for a blurred step
    assert edge_width(BOARD, shot.left, gray) == pytest.approx(np.sqrt(2 * np.pi) * 2.1, rel=0.08)


def test_a_view_is_taken_once_when_the_board_stands_still(shots):
    watch = StillWatch()
    moving = [watch.look(shot) for shot in shots]
    still = [watch.look(shots[0]) for _ in range(PAIRS)]
    again = [watch.look(shots[0]) for _ in range(PAIRS)]
    other = [watch.look(shots[1]) for _ in range(PAIRS)]
    assert not any(moving) and not any(again)
    assert still == other == [False] * (PAIRS - 1) + [True]


def test_views_without_common_corners_are_infinitely_far_apart(shots):
    assert moved(shots[0], with_side(with_side(shots[0], 'left', None), 'right', None)) == np.inf
