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
"""`color_stereo calibrate hand-eye`: where the camera sits on the flange, or beside the robot."""

SUMMARY = 'where the camera is on a robot, from views of a board and the poses of the flange'
NEEDS = 'with a recording [tools]'
FRAMES = 'physical', 'rectified'
MOUNTINGS = 'eye-in-hand', 'eye-to-hand'
MISSED = 0.5  # px; chosen: good corners miss by 0.1


def add_arguments(parser):
    """Declare the arguments."""
    from ...calibration.flange_poses import UNITS
    from ..board_arguments import add_board_arguments
    parser.add_argument('images', nargs='+', metavar='IMAGES', help='folder of the image pairs, '
                        'or a folder for each camera, or a recording that holds /tf, too '
                        '(extra [tools])')
    parser.add_argument('--calibration', nargs=2, metavar=('LEFT', 'RIGHT'), required=True,
                        help='the camera_info YAML files of both cameras')
    parser.add_argument('--poses', metavar='FILE', help='CSV or YAML of the poses of the flange '
                        'in the base: x, y, z, qx, qy, qz, qw, and name where an image has it; '
                        'not with a recording')
    parser.add_argument('--units', choices=list(UNITS), default='m',
                        help='of the positions in FILE (default m)')
    parser.add_argument('--base', default='base_link', metavar='FRAME',
                        help='frame of the base of the robot (default base_link)')
    parser.add_argument('--flange', default='tool0', metavar='FRAME',
                        help='frame of the flange (default tool0)')
    parser.add_argument('--camera', default='left_camera_optical_frame', metavar='FRAME',
                        help='frame of the left camera (default left_camera_optical_frame)')
    parser.add_argument('--frame', choices=FRAMES, default='physical', help='which left camera '
                        'the result is about: the physical one (default), whose rectified frame '
                        'range_node publishes itself, or the rectified one')
    parser.add_argument('--mounting', choices=MOUNTINGS, default=MOUNTINGS[0],
                        help='eye-in-hand: the camera is on the flange (default); eye-to-hand: '
                        'the board is')
    parser.add_argument('--robot-noise', nargs=2, type=float, metavar=('MM', 'DEGREES'),
                        help='standard deviations of a coordinate of a pose of the flange '
                        '(default: estimated)')
    parser.add_argument('--output', default='hand_eye.yaml', metavar='FILE',
                        help='YAML file to write (default hand_eye.yaml)')
    parser.add_argument('--overwrite', action='store_true', help='replace FILE')
    add_board_arguments(parser)


def run(args):
    """Calibrate with the views and poses of the command line."""
    from pathlib import Path

    import numpy as np

    from ...calibration.hand_eye import hand_eye, in_rectified
    from ...calibration.hand_eye_text import account, hand_eye_yaml, static_transform
    from ...core import StereoCalibration
    from ...files.atomic import check_free, write_text
    from ..board_arguments import board_from
    from ..main import warn
    noise = _noise_of(args)
    if not args.overwrite:
        check_free(Path(args.output))
    board = board_from(args)
    calibration = StereoCalibration.from_yaml(*args.calibration)
    calibration.check_raw()
    views, refused = _views(args, calibration, board)
    for sentence in refused:
        warn(sentence)
    poses = _together(views)
    missed = float(np.median([pose.rms for _, _, pose in views]))
    if missed > MISSED:
        warn(f'the corners miss their places by {missed:.2f} px: are the squares '
             f'{1e3 * board.square_m:g} mm? otherwise the calibration is not that of these '
             'cameras, or the board is not flat')
    found = hand_eye(poses, args.mounting, noise)
    parent = args.flange if args.mounting == MOUNTINGS[0] else args.base
    camera = found.camera
    if args.frame == 'rectified':
        camera = in_rectified(camera, calibration)
    write_text(args.output, hand_eye_yaml(found, camera, parent, args.camera, args.frame),
               replace=args.overwrite)
    print(account(found))
    for doubt in found.doubts:
        warn(doubt)
    print(f'Written to {args.output}. For TF:\n'
          f'{static_transform(camera, parent, args.camera)}')


def _noise_of(args):
    """Return the noise of the robot, m and rad, or None."""
    import math

    from ...core import SettingsError
    if args.robot_noise is None:
        return None
    if not all(0 < value < 100 for value in args.robot_noise):
        raise SettingsError(f'--robot-noise {args.robot_noise[0]:g} {args.robot_noise[1]:g}: '
                            'expected millimeters and degrees above 0')
    return args.robot_noise[0] * 1e-3, math.radians(args.robot_noise[1])


def _views(args, calibration, board):
    """Return (name, flange pose, BoardPose) of the usable views, and sentences on the others."""
    from pathlib import Path

    from ...calibration.flange_poses import matched, read_flange_poses
    from ...calibration.pairs import find_pairs
    from ...core import SettingsError
    folder = Path(args.images[0])
    if args.poses is None:
        if len(args.images) > 1 or (folder.is_dir() and not (folder / 'metadata.yaml').exists()):
            raise SettingsError('name --poses FILE with the poses of the flange; only a recording '
                                'has them inside, in /tf')
        return _recorded(args, calibration, board)
    found = find_pairs(*args.images[:2])
    names, poses = read_flange_poses(args.poses, args.units)
    rows = matched(names, poses, [pair.name for pair in found.pairs])
    kept, refused = [], [f'{name}: has no partner' for name in found.alone]
    for pair, row in zip(found.pairs, rows):
        if row is None:
            refused.append(f'{pair.name}: has no pose of the flange')
            continue
        problem, pose = _seen(board, calibration, pair.images())
        if problem:
            refused.append(f'{pair.name}: {problem}')
        else:
            kept.append((pair.name, (poses[0][row], poses[1][row]), pose))
    return kept, refused


def _seen(board, calibration, images):
    """Return (None, BoardPose) of a pair of RGB images, or (why not, None)."""
    from ...calibration.board_pose import board_pose, Seen
    from ...calibration.gray import gray_of
    from ...core import ColorStereoError
    sides = []
    for image in images:
        found = board.detect(gray_of(image))
        sides.append(None if found is None else
                     Seen(board.corners[found.ids], found.pixels, found.sigma))
    if not any(sides):
        return 'the board is found in neither image', None
    size = (calibration.left.width, calibration.left.height)
    if images[0].shape[1::-1] != size or images[1].shape[1::-1] != size:
        return (f'the images have {images[0].shape[1]} x {images[0].shape[0]} pixels, the '
                f'calibration {size[0]} x {size[1]}'), None
    try:
        return None, board_pose(calibration, *sides)
    except ColorStereoError as error:
        return str(error), None


def _recorded(args, calibration, board):
    """Return the views of a recording in which board and flange stand still."""
    from ...recordings.moments import still_moments
    from ...recordings.reading import Recording
    kept, refused = [], []
    with Recording(args.images[0]) as recording:
        for name, images, flange in still_moments(recording, args.base, args.flange,
                                                  refused.append):
            problem, pose = _seen(board, calibration, images)
            if problem:
                refused.append(f'{name}: {problem}')
            else:
                kept.append((name, flange, pose))
    return kept, refused


def _together(views):
    """Return the Poses of some views."""
    import numpy as np

    from ...calibration.hand_eye import Poses
    from ...core import CalibrationError
    if not views:
        raise CalibrationError('no view shows the board; is it the board of the options --kind, '
                               '--columns, --rows and --square-mm?')
    names, flange, boards = zip(*views)
    return Poses(names, tuple(np.array(part) for part in zip(*flange)),
                 (np.array([pose.rotation for pose in boards]),
                  np.array([pose.translation for pose in boards])),
                 np.array([pose.covariance for pose in boards]))
