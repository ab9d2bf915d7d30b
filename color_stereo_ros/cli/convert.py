# SPDX-License-Identifier: Apache-2.0
"""`color_stereo convert`: a recording of pairs in, a recording of depth and points out."""

SUMMARY = 'measure every pair of a recording and write the outputs as a recording'
NEEDS = '[tools]'


def add_arguments(parser):
    """Declare the arguments."""
    from ..messages.outputs import OUTPUTS
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.offline import DEFAULT_TOPICS, VIEWS
    from ..recordings.topics import OPTIONS
    from .arguments import add_settings_arguments
    parser.add_argument('recording', help='rosbag2 folder, a single .mcap or .db3 file, or a '
                        'ROS 1 bag')
    parser.add_argument('result', help='rosbag2 folder to make; it appears when it is complete')
    parser.add_argument('--namespace', metavar='NAME', help='namespace of the cameras, needed '
                        'where a recording has several pairs; the outputs get it, too')
    for option, what in zip(OPTIONS, ('images of the left camera', 'images of the right camera',
                                      'camera_info of the left camera',
                                      'camera_info of the right camera')):
        parser.add_argument(option, metavar='TOPIC', help=f'topic of the {what}, where the '
                            'recording has another name than range_node expects')
    parser.add_argument('--topics', nargs='+', choices=list(OUTPUTS), metavar='TOPIC',
                        help=f'outputs of range_node to write, of {", ".join(OUTPUTS)} (default '
                        f'{" ".join(DEFAULT_TOPICS)}; {VIEWS} where the projector may be a third '
                        'view). projector/camera_info is written where the projector is found')
    parser.add_argument('--overwrite', action='store_true',
                        help='replace RESULT if it is a recording')
    add_settings_arguments(parser, settings=RangeNodeSettings())


def run(args):
    """Convert the recording of the command line; return PARTLY if something was refused."""
    from pathlib import Path

    from ..core import SettingsError
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.offline import OfflineSensor
    from ..recordings.reading import Recording
    from ..recordings.topics import StereoTopics
    from ..recordings.writing import write_recording
    from .arguments import settings_from
    from .main import PARTLY, warn
    from .progress import Progress
    settings = settings_from(args, RangeNodeSettings())
    if Path(args.recording).resolve() == Path(args.result).resolve():
        raise SettingsError(f'{args.result}: is the recording itself; name another folder for '
                            'the result')
    with Recording(args.recording) as recording:
        topics = recording.stereo_topics(args.namespace, StereoTopics(
            args.left_image, args.right_image, args.left_info, args.right_info),
            settings.input.transport == 'compressed')
        with write_recording(args.result, overwrite=args.overwrite) as writer, \
                Progress(total=recording.counts[topics.left_image], unit='pair') as progress:
            sensor = OfflineSensor(recording, writer, topics, settings, args.topics,
                                   args.namespace, say=progress.say)
            for message in recording.messages(topics.names):
                sensor.take(message)
                progress.update(message.topic == topics.left_image)
            sensor.finish()
    print(f'{args.result}: {sensor.measured} pairs measured, {sensor.failed} refused, '
          f'{sensor.unpaired} images without partner or calibration')
    if sensor.failed:
        warn(f'{sensor.failed} pairs refused; the first: {sensor.first_failure}')
    if sensor.refusals:
        warn(f'{sensor.refusals}; the first: {sensor.refusals.first}')
    return None if sensor.complete else PARTLY
