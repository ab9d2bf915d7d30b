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
"""`color_stereo calibrate update`: the calibration of moved cameras, as new files."""

SUMMARY = 'write the calibration of cameras that have moved, as a new pair of files'
NEEDS = 'with `--recording` [tools]'
FILES = 'left.yaml', 'right.yaml'
COVARIANCE = 'stereo_covariance.yaml'
WITHOUT = (f'no {COVARIANCE} is written: how exact the calibration was is not known; name its '
           'covariance by --health.covariance')


def add_arguments(parser):
    """Declare the arguments."""
    from ...parameters.groups import RangeNodeSettings
    from ...recordings.topics import OPTIONS
    from ..arguments import add_settings_arguments
    parser.add_argument('result', help='folder to make; it gets left.yaml, right.yaml and, with '
                        '--health.covariance, stereo_covariance.yaml; it appears when it is '
                        'complete')
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--recording', help='rosbag2 folder, .mcap, .db3 or ROS 1 bag of pairs '
                        'under the pattern, with their camera_info (extra [tools])')
    source.add_argument('--health', metavar='FILE', help='what `ros2 topic echo --once '
                        'calibration_health` has printed')
    parser.add_argument('--left', metavar='FILE', help='with --health: camera_info of the left '
                        'camera in use')
    parser.add_argument('--right', metavar='FILE', help='with --health: camera_info of the right '
                        'camera in use')
    parser.add_argument('--namespace', metavar='NAME', help='namespace of the cameras, needed '
                        'where a recording has several pairs')
    for option in OPTIONS:
        parser.add_argument(option, metavar='TOPIC', help='with --recording: topic where it has '
                            'another name than range_node expects')
    add_settings_arguments(parser, settings=RangeNodeSettings())


def run(args):
    """Write the calibration of the command line; refuse a drift that nothing has shown."""
    from pathlib import Path

    from ...core.health.drift import corrected
    from ...core.health.posterior import corrected_covariance
    from ...errors import CalibrationError
    from ...files.atomic import folder_written_whole
    if Path(args.result).exists():
        raise CalibrationError(f'{args.result}: is there already; name a folder that is not')
    calibration, covariance, known = (from_recording if args.recording else from_file)(args)
    fixed = corrected(calibration, known.drift)
    if covariance is not None:
        covariance = corrected_covariance(calibration, covariance, known)
    with folder_written_whole(args.result) as folder:
        folder.mkdir()
        fixed.to_yaml(*(folder / name for name in FILES))
        if covariance is not None:
            covariance.write(folder / COVARIANCE)
    print(f'{args.result}: {told(known.drift)}')
    print(WITHOUT if covariance is None else f'{COVARIANCE} belongs to the new files')


def told(drift):
    """Return what was changed as one sentence."""
    from ...core.health.drift import NAMES, SHOWN, UNITS
    return 'calibration changed by ' + ', '.join(
        f'{name} {value:.4f} {unit}' for name, value, unit in zip(NAMES, drift * SHOWN, UNITS))


def from_file(args):
    """Return calibration, its covariance or None, and KnownDrift of a health file."""
    from ...core import StereoCalibration
    from ...errors import SettingsError
    from ...messages.health import read_drift
    from ...parameters.groups import RangeNodeSettings
    from ..arguments import settings_from
    if not (args.left and args.right):
        raise SettingsError('--health needs --left and --right, the calibration in use')
    settings = settings_from(args, RangeNodeSettings())
    calibration = StereoCalibration.from_yaml(args.left, args.right)
    return calibration, settings.health.read_covariance(), read_drift(args.health, calibration)


def from_recording(args):
    """Return calibration, its covariance or None, and KnownDrift of the pairs of a recording."""
    from ...core.health.posterior import KnownDrift
    from ...errors import CalibrationError
    from ...parameters.groups import RangeNodeSettings
    from ...recordings.drift import DriftSensor
    from ...recordings.reading import Recording
    from ..arguments import settings_from
    from ..progress import Progress
    from ..recorded import topics_of
    settings = settings_from(args, RangeNodeSettings())
    with Recording(args.recording) as recording:
        topics = topics_of(args, recording, settings)
        with Progress(total=recording.counts[topics.left_image], unit='pair') as progress:
            sensor = DriftSensor(recording, topics, settings, say=progress.say)
            for message in recording.messages(topics.names):
                sensor.take(message)
                progress.update(message.topic == topics.left_image)
            sensor.finish()
    health = sensor.health
    if health is None or not health.pairs:
        reason = 'its rows were not measured' if health is None else health.sentence()
        raise CalibrationError(f'{args.recording}: no calibration is written: {reason}')
    print(health.sentence())
    return sensor.calibration, settings.health.read_covariance(), KnownDrift.of(health)
