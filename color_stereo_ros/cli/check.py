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
"""`color_stereo check`: how good a sensor is, on a flat board or a sphere bar."""

SUMMARY = 'check a sensor on a flat board or a sphere bar, and say what to change'
NEEDS = 'with a recording or `--report` [tools]'
MOST = 20  # pairs; chosen: they tell the noise to 16 %


def add_arguments(parser):
    """Declare the arguments."""
    from .arguments import add_settings_arguments
    parser.add_argument('images', nargs='+', metavar='IMAGES', help='two image files; or a folder '
                        'of pairs (left.png and right.png, or many); or a folder for each camera; '
                        'or a recording (extra [tools])')
    parser.add_argument('--calibration', nargs=2, metavar=('LEFT', 'RIGHT'),
                        help='the camera_info YAML files of both cameras (default: left.yaml and '
                        'right.yaml in the folder, or the camera_info of the recording)')
    parser.add_argument('--distance', type=float, metavar='MM', help='true distance of the board '
                        'from the left camera along its optical axis: shows the bias')
    parser.add_argument('--sphere-bar', type=float, metavar='MM', help='check on two spheres '
                        'whose centers are so far apart, instead of a board')
    parser.add_argument('--radius', type=float, metavar='MM', help='with --sphere-bar: radius of '
                        'the spheres')
    parser.add_argument('--pairs', type=int, default=MOST, metavar='N', help='use so many pairs '
                        f'at most (default {MOST})')
    parser.add_argument('--json', metavar='FILE', help='write the figures, too')
    parser.add_argument('--report', metavar='FILE', help='write a page with pictures, too '
                        '(extra [tools])')
    parser.add_argument('--overwrite', action='store_true', help='replace these files')
    parser.add_argument('--rectified', action='store_true', help='the images are rectified '
                        'already: only P of the calibration is used')
    add_settings_arguments(parser)


def run(args):
    """Check with the pairs of the command line; return 1 where the sensor is not in order."""
    from ..calibration.check_text import check_json, check_text
    from ..calibration.checking import check, POOR
    from ..core import ColorStereo
    from ..files.atomic import check_free, write_text
    from ..patience import patience
    from .arguments import settings_from
    from .main import FAILURE
    bar = _bar(args)
    if not args.overwrite:
        for path in filter(None, (args.json, args.report)):
            check_free(path)
    calibration, pairs, config = _pairs(args)
    args.config = args.config or config
    settings = settings_from(args)
    with patience():
        stereo = ColorStereo(calibration, settings, rectified_input=args.rectified)
    with patience('measuring'):
        results = [stereo.process(*pair) for pair in pairs]
    distance = None if args.distance is None else args.distance / 1e3
    found = check(pairs, results, settings, distance, bar)
    print(check_text(found))
    if args.json:
        write_text(args.json, check_json(found), replace=args.overwrite)
    if args.report:
        from ..calibration.check_report import check_page
        title = f'{" ".join(args.images)}: {len(pairs)} pairs'
        write_text(args.report, check_page(found, *pairs[-1], results[-1], title),
                   replace=args.overwrite)
    return FAILURE if found.level == POOR else None


def _bar(args):
    """Return distance and radius of the spheres in m, or None; refuse impossible numbers."""
    from ..core import SettingsError
    if (args.sphere_bar is None) != (args.radius is None):
        raise SettingsError('--sphere-bar and --radius belong together')
    for name in ('distance', 'sphere_bar', 'radius'):
        value = getattr(args, name)
        if value is not None and not value > 0:
            raise SettingsError(f'--{name.replace("_", "-")} {value:g}: expected millimeters '
                                'above 0')
    if args.pairs < 1:
        raise SettingsError(f'--pairs {args.pairs}: expected 1 or more')
    return None if args.radius is None else (args.sphere_bar / 1e3, args.radius / 1e3)


def _pairs(args):
    """Return the calibration, at most `--pairs` pairs of RGB images, and a settings file."""
    from pathlib import Path

    from ..calibration.pairs import find_pairs
    from ..core import SettingsError, StereoCalibration
    from ..files.image import read_image
    first = Path(args.images[0])
    config = None
    if _is_recording(first):
        if len(args.images) > 1:
            raise SettingsError('name one recording')
        return (*_recorded(args), None)
    if first.is_dir():
        found = find_pairs(*args.images[:2]).pairs[:args.pairs]
        pairs = [pair.images() for pair in found]
        names = [first / f'{side}.yaml' for side in ('left', 'right')]
        config = first / 'settings.yaml'
        args.calibration = args.calibration or (names if all(
            name.exists() for name in names) else None)
    elif len(args.images) == 2:
        pairs = [tuple(read_image(path) for path in args.images)]
    else:
        raise SettingsError('name two image files, a folder, or a recording')
    if args.calibration is None:
        raise SettingsError('name --calibration LEFT RIGHT')
    return (StereoCalibration.from_yaml(*args.calibration), pairs,
            str(config) if config is not None and config.exists() else None)


def _is_recording(path):
    """Return whether a path is a recording: a folder of rosbag2, or a file of one."""
    return (path.is_dir() and (path / 'metadata.yaml').exists()) or path.suffix in (
        '.mcap', '.db3', '.bag')


def _recorded(args):
    """Return the calibration and the first pairs of a recording."""
    from ..core import RecordingError, StereoCalibration
    from ..recordings.pairs import recorded_pairs
    from ..recordings.reading import Recording
    from .main import warn
    with Recording(args.images[0]) as recording:
        topics = recording.stereo_topics()
        calibration = None if args.calibration is None else StereoCalibration.from_yaml(
            *args.calibration)
        if calibration is None:
            infos = {}
            for message in recording.messages({topics.left_info, topics.right_info}):
                infos[message.topic] = recording.decoded(message)
                if len(infos) == 2:
                    break
            if len(infos) < 2:
                raise RecordingError(f'{args.images[0]}: holds no camera_info of both cameras; '
                                     'name --calibration LEFT RIGHT')
            calibration = StereoCalibration.from_camera_info(infos[topics.left_info],
                                                             infos[topics.right_info])
        pairs = []
        for pair in recorded_pairs(recording, topics.left_image, topics.right_image, warn):
            pairs.append((pair.left, pair.right))
            if len(pairs) == args.pairs:
                break
    if not pairs:
        raise RecordingError(f'{args.images[0]}: holds no pair of images')
    return calibration, pairs
