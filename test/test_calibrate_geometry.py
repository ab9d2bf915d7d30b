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
"""`color_stereo calibrate geometry`: folders and recordings in, a calibrated pair out, or none."""

import sys

from board_shots import BASELINE, BOARD, images, rig

from color_stereo_ros.calibration.capture import Capture, FIRST, picture, pose_in_words
from color_stereo_ros.calibration.geometry import CALIBRATION, REPORT
from color_stereo_ros.calibration.pairs import ImagePair
from color_stereo_ros.calibration.still import PAIRS
from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import StereoCalibration
from color_stereo_ros.core.cameras.covariance import StereoCovariance
from color_stereo_ros.core.cameras.parameters import StereoParameters
from color_stereo_ros.recordings.writing import write_recording

import cv2

import numpy as np

import pytest

COUNT = 10
OPTIONS = ['--kind', 'chessboard', '--columns', '9', '--rows', '6', '--square-mm', '25']


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder of image pairs of a board."""
    folder = tmp_path_factory.mktemp('views')
    for index in range(COUNT):
        for side, image in zip(('left', 'right'), images(index)):
            cv2.imwrite(str(folder / f'{side}_{index:02d}.png'), image[..., ::-1])
    return folder


def calibrate(source, output, *options):
    words = [source] if not isinstance(source, (list, tuple)) else source
    return cli.main(['calibrate', 'geometry', *map(str, words), '--output', str(output),
                     *OPTIONS, *options])


@pytest.fixture(scope='module')
def result(folder, tmp_path_factory):
    """Return the folder of a good calibration."""
    output = tmp_path_factory.mktemp('result') / 'calibration'
    assert calibrate(folder, output, '--model', 'plumb_bob', '--baseline-mm', '201') == 0
    return output


def test_a_folder_of_pairs_becomes_a_calibration_as_near_the_truth_as_it_says(result):
    found = StereoCalibration.from_yaml(result / 'left.yaml', result / 'right.yaml')
    assert found.geometry.baseline == pytest.approx(BASELINE, rel=1e-3)
    std = StereoCovariance.read(result / 'stereo_covariance.yaml').std
    parameters, truth = map(StereoParameters.from_calibration, (found, rig()))
    assert (np.abs(parameters.vector - truth.vector) < 5 * std).all()
    assert std[0] < 0.3  # px, of the focal length


def test_the_covariance_belongs_to_the_files_beside_it(result):
    found = StereoCalibration.from_yaml(result / 'left.yaml', result / 'right.yaml')
    covariance = StereoCovariance.read(result / 'stereo_covariance.yaml')
    covariance.check(found)
    assert (covariance.std > 0).all()


def test_the_report_shows_every_chapter_without_network(result):
    text = (result / REPORT).read_text()
    for anchor in ('summary', 'depth', 'rows', 'residuals', 'coverage', 'views', 'parameters'):
        assert f'<section id="{anchor}">' in text
    assert 'left_03' in text and 'left.fx' in text
    assert text.count('<figure>') >= 7
    assert 'src="http' not in text


def test_a_bad_result_replaces_nothing_and_the_wrong_square_is_named(folder, result, capsys):
    before = {name: (result / name).read_bytes() for name in (*CALIBRATION, REPORT)}
    assert calibrate(folder, result, '--model', 'plumb_bob', '--baseline-mm', '173') == 1
    said = capsys.readouterr().err
    assert 'baseline 0.200 m, you said 0.173: is the square 21.6 mm?' in said
    assert {name: (result / name).read_bytes() for name in before} == before
    assert {path.name for path in result.iterdir()} == set(before)


def test_a_foreign_file_is_not_replaced(folder, tmp_path, capsys):
    (tmp_path / 'left.yaml').write_text('mine')
    assert calibrate(folder, tmp_path) == 1
    assert '--overwrite replaces it' in capsys.readouterr().err
    assert (tmp_path / 'left.yaml').read_text() == 'mine'


def test_exchanged_folders_end_with_one_sentence(folder, tmp_path, capsys):
    for side, other in (('left', 'right'), ('right', 'left')):
        (tmp_path / side).mkdir()
        for index in range(6):
            name = f'{side}_{index:02d}.png'
            (tmp_path / side / name).write_bytes(
                (folder / name.replace(side, other)).read_bytes())
    assert calibrate(tmp_path, tmp_path / 'out') == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert 'exchange the images of the two cameras' in said
    assert not (tmp_path / 'out').exists()


def test_a_bad_view_is_dropped_by_name(folder, tmp_path, capsys):
    bad = tmp_path / 'views'
    bad.mkdir()
    for path in folder.iterdir():
        (bad / path.name).write_bytes(path.read_bytes())
    (bad / 'right_04.png').write_bytes((folder / 'right_05.png').read_bytes())
    assert calibrate(bad, tmp_path / 'out', '--model', 'plumb_bob') == 0
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith('Not used')]
    assert len(told) == 1 and 'left_04' in told[0]
    assert 'left_04' in (tmp_path / 'out' / REPORT).read_text()


def test_a_recording_is_calibrated_as_its_images_are(tmp_path, capsys):
    with write_recording(tmp_path / 'recorded') as writer:
        for index in range(COUNT):
            writer.write_pair((index + 1) * 10**9, *images(index), rig())
    assert calibrate(tmp_path / 'recorded', tmp_path / 'out', '--model', 'plumb_bob') == 0
    assert f'Views: {COUNT} used, 0 not' in capsys.readouterr().out


@pytest.mark.parametrize('words, told', [
    ([], '0 sources, expected a folder'),
    (['a', 'b', 'c'], '3 sources'),
    (['a', '--live'], 'leave out a'),
    (['a', '--baseline-mm', '0.2'], '--baseline-mm = 0.2 mm is outside'),
    (['--live', '--views', '2'], '--views = 2'),
    (['--live', '--target-mm', '0'], '--target-mm = 0.0 mm')])
def test_wrong_arguments_end_with_status_2(words, told, capsys):
    assert cli.main(['calibrate', 'geometry', *words]) == 2
    assert told in capsys.readouterr().err


def test_a_capture_takes_still_views_and_expects_each_to_help():
    capture = Capture(BOARD, target=1e-9, most=6)
    for index in range(6):
        pair = ImagePair(f'{index}', *images(index))
        taken = [capture.look(pair)[1] for _ in range(PAIRS)]
        assert taken == [False] * (PAIRS - 1) + [True]
        assert (capture.advice is None) == (index + 1 < FIRST)
    advice = capture.advice
    assert capture.done and capture.depth_std == advice.depth_std
    assert advice.expected_depth_std < advice.depth_std < 0.01
    shown = picture(images(5), capture.shots[-1], advice)
    assert shown.shape == (480, 1280, 3)
    assert '6 views: depth' in capture.account()


@pytest.mark.parametrize('turn, words', [
    ((0, 0, 0), 'facing the camera'), ((0, 40, 0), 'tilted by 40 degrees, right edge nearer'),
    ((40, 0, 0), 'upper edge nearer'), ((-40, 0, 0), 'lower edge nearer')])
def test_a_pose_is_told_in_words(turn, words):
    class Pose:
        rotation = cv2.Rodrigues(np.radians(np.array(turn, float)))[0]
        translation = np.array([0.0, 0.0, 0.3]) - rotation @ BOARD.corners.mean(axis=0)
        outlines = {'left': np.array([[10, 10], [110, 10], [110, 90], [10, 90.0]])}

    told = pose_in_words(Pose, BOARD, (640, 480))
    assert told.startswith('hold the board 30 cm before the left camera, in the upper left of')
    assert told.endswith(words)


def test_a_page_without_its_extra_is_refused_with_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'viser', None)
    output = tmp_path / 'out'
    assert cli.main(['calibrate', 'geometry', '--live', '--page', '0', '--output',
                     str(output)]) == 1
    assert 'pip install "color_stereo_ros[view]"' in capsys.readouterr().err
    assert not output.exists()
