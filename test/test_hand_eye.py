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
"""Hand-eye calibration: how exact, how honest, and what it says about wrong input."""

from dataclasses import replace

from color_stereo_ros.calibration.board_pose import board_pose, project, Seen
from color_stereo_ros.calibration.flange_poses import matched, read_flange_poses
from color_stereo_ros.calibration.hand_eye import hand_eye, IN_HAND, MOUNTINGS, TO_HAND
from color_stereo_ros.calibration.hand_eye_text import account, static_transform
from color_stereo_ros.calibration.rigid import (
    exp, inverse, log, moved, product, quaternions_of, rotations_of)
from color_stereo_ros.cli.main import main
from color_stereo_ros.core import CalibrationError
from color_stereo_ros.files.image import read_image, write_image
from color_stereo_ros.messages.contents import (
    Header, Quaternion, TFMessage, Transform, TransformStamped, Vector3)
from color_stereo_ros.recordings.writing import write_recording
import cv2
from hand_eye_rig import (
    BAR_NOISE, corners, photographs, rig, session, straight_rig, views)
import numpy as np
import pytest
import yaml

POSITION, ANGLE = 0.3, 0.1  # mm, degrees: the goals with twelve poses


def error_of(found, truth):
    """Return the error of the camera's pose: a rotation vector, rad, and a shift, m; (6,)."""
    return np.concatenate([log(found[0] @ truth[0].T), found[1] - truth[1]])


def with_flange(poses, flange):
    return replace(poses, flange=flange)


@pytest.mark.parametrize('mounting, count', [(IN_HAND, (40, 200)), (TO_HAND, (10, 200))])
def test_twelve_poses_give_the_camera_and_claims_that_hold(mounting, count, effort, figures):
    seeds = effort.seeds(*count)
    errors, claims = [], []
    for seed in seeds:
        poses, truth = session(seed, mounting=mounting)
        found = hand_eye(poses, mounting)
        errors.append(error_of(found.camera, truth.camera))
        claims.append(np.sqrt(np.diag(found.covariance)))
        assert found.used.all()
    errors, ratios = np.array(errors), np.abs(errors) / claims
    name = f'hand-eye, {mounting}, 12 poses, .1 mm and .05 degrees: '
    figures(f'{name}position', 1e3 * np.sqrt(np.mean(np.sum(errors[:, 3:] ** 2, axis=1))), 'mm',
            over=seeds, at_most=POSITION)
    figures(f'{name}rotation', np.degrees(np.sqrt(np.mean(np.sum(errors[:, :3] ** 2, axis=1)))),
            'degrees', over=seeds, at_most=ANGLE)
    figures(f'{name}within 3 sigma', 100 * np.mean(ratios < 3), '%', over=seeds, at_least=95)
    figures(f'{name}z68', np.percentile(ratios, 68.27), '', over=seeds, at_most=1.25,
            at_least=0.8)


def test_the_noise_of_the_robot_is_estimated(effort, figures):
    seeds = effort.seeds(10, 200)
    factor = 3.0
    found = np.array([hand_eye(session(seed, noise=np.multiply(factor, BAR_NOISE))[0]).robot_noise
                      for seed in seeds])
    for name, ratio in zip(('position', 'rotation'), (np.sqrt(np.mean(found ** 2, axis=0))
                                                      / np.multiply(factor, BAR_NOISE))):
        figures(f'hand-eye: estimated over true noise of the robot, {name}', ratio, '',
                over=seeds, at_most=1.15, at_least=0.85)


def test_without_noise_the_truth_comes_back():
    for mounting in MOUNTINGS:
        poses, truth = session(3, mounting=mounting, noise=(0.0, 0.0), corner=0.0)
        found = hand_eye(poses, mounting)
        assert np.abs(error_of(found.camera, truth.camera)).max() < 1e-6
        assert np.abs(error_of(found.board, truth.board)).max() < 1e-6


@pytest.mark.parametrize('mounting', MOUNTINGS)
def test_poses_that_do_not_fit_are_left_out_by_name(mounting):
    poses, truth = session(4, mounting=mounting)
    R, t = (part.copy() for part in poses.flange)
    t[2] += [0.006, 0, 0]
    R[7] = R[7] @ exp([0, np.radians(1.5), 0])
    found = hand_eye(with_flange(poses, (R, t)), mounting)
    assert found.dropped == ('view_02', 'view_07')
    error = error_of(found.camera, truth.camera)
    assert 1e3 * np.linalg.norm(error[3:]) < 2 * POSITION
    assert 'LEFT OUT' in account(found)


@pytest.mark.parametrize('count', [1, 3])
def test_too_few_poses_are_refused(count):
    with pytest.raises(CalibrationError, match=f'{count} poses are too few'):
        hand_eye(session(0, count=count)[0])


def turned_about_one_axis(angles, noise):
    """Return a session whose flange turns about one axis only."""
    rng = np.random.default_rng(2)
    poses, truth = session(2, count=len(angles))
    R = exp(np.outer(angles, [0, 0.6, 0.8])) @ exp(rng.normal(0, noise, (len(angles), 3)))
    return with_flange(poses, (R, poses.flange[1]))


def test_turns_about_one_axis_are_refused_with_the_axis():
    poses = turned_about_one_axis(np.radians(np.linspace(-40, 40, 12)), np.radians(0.05))
    with pytest.raises(CalibrationError, match='all poses turn about one axis.*0.60.*0.80'):
        hand_eye(poses)


def test_a_flange_that_does_not_turn_is_refused():
    with pytest.raises(CalibrationError, match='the flange turns by .* too little'):
        hand_eye(turned_about_one_axis(np.zeros(12), np.radians(0.05)))


def mistaken(mistake, poses):
    """Return poses of the flange after a usual mistake."""
    R, t = poses.flange
    if mistake == 'reverse order':
        return R[::-1], t[::-1]
    if mistake == 'the image after it':
        return np.roll(R, 1, axis=0), np.roll(t, 1, axis=0)
    if mistake == 'w x y z':
        return rotations_of(quaternions_of(R)[:, [3, 0, 1, 2]]), t
    if mistake == '--units mm':
        return R, 1e3 * t
    if mistake == 'in kilometers, or the size of the squares in millimeters':
        return R, 1e-3 * t
    if mistake == 'base in the flange':
        return inverse((R, t))
    return R[np.random.default_rng(0).permutation(len(R))], t


@pytest.mark.parametrize('mistake', [
    'reverse order', 'w x y z', '--units mm', 'base in the flange', 'do not belong to the images',
    'in kilometers, or the size of the squares in millimeters'])
def test_the_usual_mistakes_are_named(mistake):
    poses, _ = session(5)
    with pytest.raises(CalibrationError, match=mistake):
        hand_eye(with_flange(poses, mistaken(mistake, poses)))


def test_rows_that_are_off_by_one_are_named():
    poses, _ = session(6)
    R, t = (np.roll(part, -1, axis=0) for part in poses.flange)
    with pytest.raises(CalibrationError, match='belongs to the image'):
        hand_eye(with_flange(poses, (R, t)))


def test_the_wrong_mounting_is_named():
    with pytest.raises(CalibrationError, match='they fit with --mounting eye-to-hand'):
        hand_eye(session(7, mounting=TO_HAND)[0], IN_HAND)


def test_squares_of_another_size_are_a_doubt():
    poses, _ = session(8, scale=1.02, sides=1)
    assert any('squares are of another size' in doubt for doubt in hand_eye(poses).doubts)


def test_a_robot_worse_than_said_is_a_doubt():
    poses, _ = session(9, noise=np.multiply(4, BAR_NOISE))
    assert any('times as large as --robot-noise says' in doubt
               for doubt in hand_eye(poses, robot_noise=BAR_NOISE).doubts)


def test_few_poses_are_a_doubt():
    assert any('poses are few' in doubt for doubt in hand_eye(session(10, count=6)[0]).doubts)


def test_the_pose_of_a_board_has_the_covariance_of_its_corners(effort, figures):
    rounds = effort.count(60, 1000)
    rng = np.random.default_rng(1)
    calibration, board = rig(), corners()
    R, t = (part[0] for part in views(1, rng))
    points = board @ R.T + t
    right = calibration.right_from_left
    sides = [project(calibration.left, points),
             project(calibration.right, points @ right[0].T + right[1])]
    ratios = []
    for _ in range(rounds):
        found = board_pose(calibration, *(
            Seen(board, pixels + rng.normal(0, 0.1, pixels.shape), np.full(len(board), 0.1))
            for pixels in sides))
        error = error_of((found.rotation, found.translation), (R, t))
        ratios.append(error @ np.linalg.solve(found.covariance, error) / 6)
    figures('pose of a board: squared error over its covariance', np.mean(ratios), '',
            over=rounds, at_most=1.25, at_least=0.8)


def test_one_camera_suffices_for_the_pose_of_a_board():
    calibration, board = rig(), corners()
    R, t = exp([0.3, -0.4, 0.1]), np.array([0.0, 0.0, 0.4])
    seen = Seen(board, project(calibration.left, board @ R.T + t), np.full(len(board), 0.1))
    found = board_pose(calibration, left=seen)
    assert np.abs(error_of((found.rotation, found.translation), (R, t))).max() < 1e-8
    with pytest.raises(CalibrationError, match='no camera sees'):
        board_pose(calibration)


def test_rotations_of_any_angle_come_back():
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(6, 3))
    vectors = axes / np.linalg.norm(axes, axis=1)[:, None] * np.array(
        [[0.0], [1e-12], [1e-7], [0.3], [2.0], [3.14159]])
    assert np.abs(log(exp(vectors)) - vectors).max() < 1e-12
    assert np.abs(exp(vectors)[4] - cv2.Rodrigues(vectors[4])[0]).max() < 1e-14
    motion = exp(vectors), vectors
    back = product(motion, inverse(motion))
    assert np.abs(back[0] - np.eye(3)).max() < 1e-14 and np.abs(back[1]).max() < 1e-14
    assert np.allclose(moved(motion, np.zeros(6))[0], motion[0], atol=1e-15)


CSV = """name, x, y, z, qx, qy, qz, qw
view_001, 0.4, -0.1, 0.5, 0, 0.6, 0, 0.8
view_002, 1, 2, 3, 0, 0, 0, 1
"""
YAML = """
- {name: view_001, translation: {x: 0.4, y: -0.1, z: 0.5}, rotation: {x: 0, y: 0.6, z: 0, w: 0.8}}
- {name: view_002, x: 1, y: 2, z: 3, qx: 0, qy: 0, qz: 0, qw: 1}
"""


@pytest.mark.parametrize('name, text', [
    ('a.csv', CSV), ('a.yaml', YAML), ('a.txt', CSV.replace(',', '')),
    ('a.csv', CSV.replace(',', ';').partition('\n')[2])])
def test_files_of_poses_are_read(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    names, (R, t) = read_flange_poses(tmp_path / name)
    assert names == ['view_001', 'view_002']
    assert np.allclose(t, [[0.4, -0.1, 0.5], [1, 2, 3]])
    assert np.allclose(R[0] @ [0, 0, 1], [0.96, 0, 0.28]) and np.allclose(R[1], np.eye(3))
    assert np.allclose(read_flange_poses(tmp_path / name, 'mm')[1][1], 1e-3 * t)


@pytest.mark.parametrize('text, message', [
    ('1,2,3,0,0,0\n', 'line 1: has 6 columns'),
    ('1,2,3,10,20,30,1\n', 'line 1: .*no unit quaternion'),
    ('1,2,3,0,0,0,1\n1,2,x,0,0,0,1\n', "line 2, z: 'x' is no number"),
    ('1,2,3,0,0,0,nan\n', "line 1, qw: 'nan' is no number"),
    ('', 'holds no pose')])
def test_damaged_files_of_poses_are_refused_by_line(tmp_path, text, message):
    (tmp_path / 'poses.csv').write_text(text)
    with pytest.raises(CalibrationError, match=message):
        read_flange_poses(tmp_path / 'poses.csv')


def test_poses_belong_to_images_by_name_or_by_order():
    poses = np.zeros((2, 3, 3)), np.zeros((2, 3))
    assert matched(['b', 'a.png'], poses, ['left_a', 'b', 'c']) == [1, 0, None]
    assert matched([None, None], poses, ['x', 'y']) == [0, 1]
    with pytest.raises(CalibrationError, match='2 flange poses and 3 pairs'):
        matched([None, None], poses, ['x', 'y', 'z'])
    with pytest.raises(CalibrationError, match='no flange pose belongs to an image'):
        matched(['p', 'q'], poses, ['x', 'y'])


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    """Return a folder with images, calibration and poses of the flange, and the Truth."""
    from color_stereo_ros.calibration.boards import Board
    from hand_eye_rig import Truth
    folder = tmp_path_factory.mktemp('hand_eye')
    rng = np.random.default_rng(1)
    calibration, board = straight_rig(), Board('chessboard', 9, 6, 0.02)
    calibration.to_yaml(folder / 'left.yaml', folder / 'right.yaml')
    (folder / 'images').mkdir()
    R, t = views(8, rng)
    t = t - np.einsum('nij,j->ni', R, [0.09, 0.06, 0]) + [0.03, 0, 0.05]
    truth = Truth((exp([0.1, -0.2, 1.2]), np.array([0.05, -0.03, 0.08])),
                  (exp([3.0, 0.1, 0.2]), np.array([0.5, 0.1, -0.2])))
    flange = product(truth.board, inverse(product(truth.camera, (R, t))))
    lines = ['name,x,y,z,qx,qy,qz,qw']
    for k in range(len(t)):
        for side, image in zip(('left', 'right'), photographs(calibration, board, (R[k], t[k]))):
            write_image(folder / 'images' / f'{side}_{k:03d}.png', image)
        values = [*flange[1][k], *quaternions_of(flange[0][k])]
        lines.append(f'{k:03d},' + ','.join(f'{value:.9f}' for value in values))
    (folder / 'poses.csv').write_text('\n'.join(lines))
    return folder, truth


def command(folder, *more):
    return main(['calibrate', 'hand-eye', str(folder / 'images'), '--calibration',
                 str(folder / 'left.yaml'), str(folder / 'right.yaml'), '--poses',
                 str(folder / 'poses.csv'), '--kind', 'chessboard', '--columns', '9', '--rows',
                 '6', '--square-mm', '20', *more])


def test_the_command_calibrates_from_images(recorded, tmp_path, capsys):
    folder, truth = recorded
    assert command(folder, '--output', str(tmp_path / 'found.yaml')) == 0
    found = yaml.safe_load((tmp_path / 'found.yaml').read_text())
    turn, place = found['rotation'], found['translation']
    camera = rotations_of([turn[axis] for axis in 'xyzw']), np.array([place[a] for a in 'xyz'])
    error = error_of(camera, truth.camera)
    assert 1e3 * np.linalg.norm(error[3:]) < POSITION
    assert np.degrees(np.linalg.norm(error[:3])) < ANGLE
    assert (found['frame_id'], found['mounting']) == ('tool0', IN_HAND)
    assert len(found['poses']) == 8 and np.shape(found['covariance']) == (6, 6)
    printed = capsys.readouterr().out
    assert static_transform(camera, 'tool0', 'left_camera_optical_frame')[:60] in printed
    assert '8 of 8 poses' in printed and 'degrees' in printed


def transforms_at(stamp, pose):
    """Return the messages of /tf that put the flange, below a link, at a pose (R, t)."""
    def entry(parent, child, turn, move):
        return TransformStamped(Header.at(stamp, parent), child, Transform(
            Vector3(*map(float, move)), Quaternion(*map(float, turn))))

    return TFMessage((entry('base_link', 'link', quaternions_of(pose[0]), pose[1]),))


def robot_recording(path, calibration, images, poses):
    """Write a recording of a robot that stands still for half a second at each pose."""
    second = 1_000_000_000
    with write_recording(path) as writer:
        writer.write_content('/tf_static', second, TFMessage((TransformStamped(
            Header.at(second, 'link'), 'tool0', Transform(
                Vector3(0.0, 0.0, 0.1), Quaternion(0.0, 0.0, 0.0, 1.0))),)), latched=True)
        lifted = product(poses, (np.eye(3), np.array([0.0, 0.0, -0.1])))
        for at, pair in enumerate(images):
            for tick in range(11):
                stamp = (at + 1) * second + tick * second // 20
                writer.write_content('/tf', stamp, transforms_at(
                    stamp, (lifted[0][at], lifted[1][at])))
                if tick == 5:
                    writer.write_pair(stamp, *pair, calibration)


def test_poses_of_the_flange_come_from_the_transforms_of_a_recording(recorded, tmp_path):
    folder, truth = recorded
    calibration = straight_rig()
    _, poses = read_flange_poses(folder / 'poses.csv')
    images = [tuple(read_image(folder / 'images' / f'{side}_{k:03d}.png')
                    for side in ('left', 'right')) for k in range(len(poses[1]))]
    robot_recording(tmp_path / 'robot', calibration, images, poses)
    output = tmp_path / 'found.yaml'
    arguments = ['calibrate', 'hand-eye', str(tmp_path / 'robot'), '--calibration',
                 str(folder / 'left.yaml'), str(folder / 'right.yaml'), '--kind', 'chessboard',
                 '--columns', '9', '--rows', '6', '--square-mm', '20', '--output', str(output)]
    assert main(arguments) == 0
    place = yaml.safe_load(output.read_text())['translation']
    assert np.allclose([place[axis] for axis in 'xyz'], truth.camera[1], atol=POSITION / 1e3)
    assert main([*arguments, '--overwrite', '--flange', 'gripper']) == 1


def test_the_command_replaces_no_file_unasked(recorded, tmp_path, capsys):
    folder, _ = recorded
    (tmp_path / 'found.yaml').write_text('mine')
    assert command(folder, '--output', str(tmp_path / 'found.yaml')) == 1
    assert 'exists already' in capsys.readouterr().err
    assert (tmp_path / 'found.yaml').read_text() == 'mine'


def test_corners_that_miss_their_places_are_a_warning(recorded, tmp_path, capsys):
    folder, _ = recorded
    command(folder, '--output', str(tmp_path / 'found.yaml'), '--square-mm', '21')
    assert 'are the squares 21 mm?' in capsys.readouterr().err


def test_the_command_writes_nothing_where_the_poses_do_not_fit(recorded, tmp_path, capsys):
    folder, _ = recorded
    lines = (folder / 'poses.csv').read_text().splitlines()
    rows = [f'{k:03d},{line.partition(",")[2]}' for k, line in enumerate(lines[:0:-1])]
    (tmp_path / 'reversed.csv').write_text('\n'.join([lines[0], *rows]))
    output = tmp_path / 'found.yaml'
    assert command(folder, '--poses', str(tmp_path / 'reversed.csv'), '--output',
                   str(output)) == 1
    assert 'reverse order' in capsys.readouterr().err and not output.exists()
