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
"""Calibration boards: what is drawn is what is found, and the PDF has the right size."""

import functools
import re

from color_stereo_ros.calibration import charuco
from color_stereo_ros.calibration.board_pdf import layout, paper_size, pdf
from color_stereo_ros.calibration.boards import Board, BOARDS, default_kind
from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import CalibrationError, ImageError
from color_stereo_ros.errors import InstallationError

import cv2
import numpy as np
import pytest

KINDS = [kind for kind in BOARDS if kind != 'charuco' or charuco.is_available()]
each_kind = pytest.mark.parametrize('kind', KINDS)
MARGIN = 0.02  # m around the pictures
PITCH = 4000.0  # px per m


def with_aruco(test):
    """Run a test where OpenCV knows markers; elsewhere test that the board is refused."""
    @functools.wraps(test)
    def either(*args, **kwargs):
        if charuco.is_available():
            test(*args, **kwargs)
        else:
            with pytest.raises(InstallationError, match='cv2.aruco'):
                Board('charuco')
    return either


def picture(board):
    """Return a flat picture of a board, uint8 (H, W), and the exact pixels of its corners."""
    shape = [round((side + 2 * MARGIN) * PITCH) for side in board.size_m[::-1]]
    image = np.full(shape, 255, np.uint8)
    for x, y, width, height in board.drawing.rectangles():
        ends = [round((value + MARGIN) * PITCH) for value in (y, y + height, x, x + width)]
        image[ends[0]:ends[1], ends[2]:ends[3]] = 0
    y, x = (np.indices(shape) + 0.5) / PITCH - MARGIN
    for center_x, center_y, radius in board.drawing.disks:
        image[np.hypot(x - center_x, y - center_y) < radius] = 0
    image = cv2.GaussianBlur(image, (0, 0), 0.7)
    return image, (board.corners[:, :2] + MARGIN) * PITCH - 0.5


@each_kind
@pytest.mark.parametrize('turns', range(4))
def test_a_board_is_found_in_every_orientation_with_the_right_ids(kind, turns):
    board = Board.usual(kind)
    image, pixels = picture(board)
    shape = image.shape
    for _ in range(turns):
        pixels = np.column_stack([pixels[:, 1], shape[1] - 1 - pixels[:, 0]])
        shape = shape[::-1]
    found = board.detect(np.rot90(image, turns))
    assert np.array_equal(found.ids, board.ids)
    assert np.abs(found.pixels - pixels).max() < 0.05
    assert found.sigma.shape == found.ids.shape and (found.sigma > 0).all()


@with_aruco
def test_the_drawing_is_that_of_opencv():
    board = Board.usual('charuco')
    shape = tuple(round(side * PITCH) for side in board.size_m)
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    if hasattr(cv2.aruco, 'CharucoDetector'):
        theirs = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m,
                                        board.marker_m, known)
        corners, image = theirs.getChessboardCorners(), theirs.generateImage(shape)
    else:
        theirs = cv2.aruco.CharucoBoard_create(board.columns, board.rows, board.square_m,
                                               board.marker_m, known)
        corners, image = theirs.chessboardCorners, theirs.draw(shape)
    assert np.allclose(corners, board.corners, atol=1e-7)
    x, y = (np.arange(side) + 0.5 for side in shape)
    columns = np.searchsorted(board.drawing.x, x / PITCH, side='right') - 1
    rows = np.searchsorted(board.drawing.y, y / PITCH, side='right') - 1
    assert np.array_equal(board.drawing.dark[rows][:, columns], image < 128)


@with_aruco
def test_a_part_of_a_charuco_board_is_enough():
    board = Board.usual('charuco')
    image, pixels = picture(board)
    found = board.detect(image[:400, 300:])
    assert 20 < len(found) < len(board.ids)
    assert np.abs(found.pixels + (300, 0) - pixels[found.ids]).max() < 0.05


@each_kind
def test_other_images_show_no_board(kind):
    board = Board.usual(kind)
    noise = np.random.default_rng(1).integers(0, 256, (480, 640)).astype(np.uint8)
    assert board.detect(noise) is None
    assert board.detect(np.full((480, 640), 128, np.uint8)) is None


@with_aruco
def test_a_mirrored_board_is_not_found():
    # Chessboards and grids of circles look like themselves in one of two mirrors.
    board = Board.usual('charuco')
    assert board.detect(np.ascontiguousarray(picture(board)[0][:, ::-1])) is None


@pytest.mark.parametrize('kind, changes, message', [
    ('chessboard', {'columns': 10, 'rows': 8}, 'upside down'),
    ('circles', {'rows': 8}, 'upside down'),
    ('chessboard', {'columns': 1}, r'columns = 1 .*2 \.\. 200'),
    ('chessboard', {'square_m': 20.0}, r'square of a board = 20.0 m, expected 0.0001 \.\. 1.0'),
    ('circles', {'rows': 9, 'marker_m': 0.1}, 'circles of 100 mm'),
    ('hexagons', {}, "unknown kind of board 'hexagons'"),
])
def test_boards_that_are_of_no_use_are_refused(kind, changes, message):
    usual = dict(zip(('columns', 'rows', 'square_m'), (11, 8, 0.02)))
    with pytest.raises(CalibrationError if kind in BOARDS else ValueError, match=message):
        Board(kind, **{**usual, **changes})


@with_aruco
@pytest.mark.parametrize('changes, message', [
    ({'columns': 30, 'rows': 30}, 'needs 450 markers, 4X4_250 has 250'),
    ({'dictionary': '4X4_251'}, "unknown dictionary of markers '4X4_251'; did you mean"),
    ({'marker_m': 0.025}, 'markers of 25 mm in squares of 20 mm'),
])
def test_charuco_boards_that_are_of_no_use_are_refused(changes, message):
    with pytest.raises(CalibrationError, match=message):
        Board('charuco', **changes)


def test_without_aruco_the_chessboard_is_the_default_and_the_message_names_what_is_missing(
        monkeypatch):
    monkeypatch.delattr(cv2, 'aruco', raising=False)
    assert default_kind() == 'chessboard' and Board().kind == 'chessboard'
    with pytest.raises(InstallationError, match='opencv-contrib-python-headless.*chessboard'):
        Board('charuco')


def test_an_image_of_another_type_is_refused():
    with pytest.raises(ImageError, match=r'uint16 of shape \(8, 8\), expected uint8'):
        Board.usual('chessboard').detect(np.zeros((8, 8), np.uint16))


def drawn(file):
    """Return the rectangles (N, 4) of a PDF file, mm as they are printed, y down, and its text."""
    text = file.decode('ascii')
    number = r'(-?[\d.]+)'
    width, height = map(float, re.search(rf'MediaBox \[0 0 {number} {number}\]', text).groups())
    a, d, f = map(float, re.search(rf'^{number} 0 0 {number} 0 {number} cm$', text,
                                   re.M).groups())
    rectangles = np.array(re.findall(rf'^{number} {number} {number} {number} re$', text, re.M),
                          np.float64).reshape(-1, 4)
    points = rectangles * [a, d, a, d] + [0, f, 0, 0]
    points[:, 1] = height - points[:, 1]
    points[:, 3] *= -1
    return points * 25.4 / 72, text, (width * 25.4 / 72, height * 25.4 / 72)


@pytest.mark.parametrize('kind', [kind for kind in KINDS if kind != 'circles'])
def test_the_pdf_has_the_true_scale(kind):
    board = Board.usual(kind)
    rectangles, _, page = drawn(pdf(board, paper_size('A4')))
    known = 1e3 * board.drawing.rectangles()
    # The vectors are exact. What a picture of them shows beside it (2.7e-4 along y once) is the
    # rasterizer, which rounds edges and the size of the page to its dots.
    assert np.abs(rectangles[:, 2:] / known[:, 2:] - 1).max() < 1e-6
    moved = rectangles[:, :2] - known[:, :2]
    assert np.abs(moved - moved[0]).max() < 1e-4
    assert np.allclose(page, (297, 210), atol=1e-3)
    place = layout(board, paper_size('A4'))
    assert np.allclose(moved[0], (place.left, place.top), atol=1e-3)


def test_circles_in_the_pdf_have_their_centers_and_diameters():
    board = Board.usual('circles')
    text = drawn(pdf(board, paper_size('A4')))[1]
    place = layout(board, paper_size('A4'))
    six = ' '.join(6 * [r'([-\d.]+)'])
    curves = np.array(re.findall(rf'^{six} c$', text, re.M), np.float64)
    ends = curves[:, 4:].reshape(len(board.corners), -1, 2)
    centers = 1e3 * board.corners[:, :2] + (place.left, place.top)
    assert np.allclose(ends.mean(axis=1), centers, atol=1e-5)
    assert np.allclose(np.linalg.norm(ends - centers[:, None], axis=2), 500 * board.marker_m,
                       atol=1e-5)
    middle = (np.roll(curves[:, 4:], 1, axis=0) + 3 * curves[:, :2] + 3 * curves[:, 2:4]
              + curves[:, 4:])[1:8] / 8  # of each Bezier curve, all on the first disk
    assert np.allclose(np.linalg.norm(middle - centers[0], axis=1), 500 * board.marker_m,
                       rtol=1e-5)


def test_the_rulers_of_the_pdf_have_the_length_that_they_say():
    board = Board.usual('chessboard')
    text = drawn(pdf(board, paper_size('A4')))[1]
    below, beside = map(int, re.search(r'(\d+) mm below, (\d+) mm at the left', text).groups())
    marks = np.array(re.findall(r'^([\d.]+) ([\d.]+) m ([\d.]+) ([\d.]+) l S$', text, re.M),
                     np.float64)
    upright = marks[marks[:, 0] == marks[:, 2]][:, 0]
    level = marks[marks[:, 1] == marks[:, 3]][:, 1]
    assert np.allclose(np.diff(upright), 1) and np.allclose(np.diff(level), 1)
    assert np.ptp(upright) == pytest.approx(below, abs=1e-5)
    assert np.ptp(level) == pytest.approx(beside, abs=1e-5)


def test_the_pdf_is_well_formed():
    file = pdf(Board.usual('chessboard'), paper_size('letter'))
    table = int(re.search(rb'startxref\n(\d+)\n', file).group(1))
    assert file[table:].startswith(b'xref\n')
    for number, start in enumerate(re.findall(rb'(\d{10}) 00000 n', file), 1):
        assert file[int(start):].startswith(b'%d 0 obj\n' % number)
    length, stream = re.search(rb'/Length (\d+) >>\nstream\n(.*?)endstream', file,
                               re.DOTALL).groups()
    assert int(length) == len(stream)
    assert b'/PrintScaling /None' in file


@pytest.mark.parametrize('name, size', [('A4', (210, 297)), ('a3', (297, 420)),
                                        ('Letter', (215.9, 279.4)), ('600x400', (600, 400)),
                                        ('300 x 200.5 mm', (300, 200.5))])
def test_papers_have_names_or_sizes(name, size):
    assert paper_size(name) == size


@pytest.mark.parametrize('name', ['A7', '10x10', '600x', '1..2x300', '6000x400', ''])
def test_other_papers_are_refused(name):
    with pytest.raises(CalibrationError, match='is none of A0, A1'):
        paper_size(name)


def test_a_board_larger_than_the_paper_is_refused_with_what_fits():
    board = Board.usual('chessboard')
    with pytest.raises(CalibrationError, match='squares of 13.5 mm fit'):
        layout(board, paper_size('A5'))
    layout(Board('chessboard', 11, 8, 0.0135), paper_size('A5'))


def test_the_command_writes_the_board_and_does_not_replace_a_file(tmp_path, capsys):
    path = tmp_path / 'board.pdf'
    words = ['board', str(path), '--kind', 'chessboard', '--square-mm', '15', '--paper', 'letter']
    assert cli.main(words) == 0
    assert '--kind chessboard --columns 11 --rows 8 --square-mm 15' in capsys.readouterr().out
    rectangles = drawn(path.read_bytes())[0]
    assert rectangles[0, 2] == pytest.approx(15.0, rel=2e-4)
    assert cli.main(words) == 1 and 'exists already' in capsys.readouterr().err
    assert cli.main([*words, '--overwrite']) == 0
