# SPDX-License-Identifier: Apache-2.0
"""`color_stereo convert`: a recording of pairs in, a recording of depth and points out."""

SUMMARY = 'measure every pair of a recording and write the outputs as a recording'
NEEDS = '[tools]'


def add_arguments(parser):
    """Declare the arguments."""
    from ..messages.outputs import OUTPUTS
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.measuring import DEFAULT_TOPICS, VIEWS
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
    add_work_arguments(parser)
    add_settings_arguments(parser, settings=RangeNodeSettings())


def add_work_arguments(parser):
    """Declare who works, and what becomes of a run that was stopped."""
    work = parser.add_argument_group('work', 'the result does not depend on who works')
    work.add_argument('--workers', type=int, metavar='N', help='processes on this machine, each '
                      'with one thread (default: one for each core)')
    work.add_argument('--scheduler', metavar='ADDRESS', help='address of a Dask scheduler, such '
                      'as tcp://host:8786: its workers measure; all of them must see RECORDING '
                      'and the folder of RESULT under the same names (docs/scale.md)')
    left = work.add_mutually_exclusive_group()
    left.add_argument('--resume', action='store_true', help='go on with a run that was stopped')
    left.add_argument('--restart', action='store_true', help='forget a run that was stopped')


def run(args):
    """Convert the recording of the command line; return PARTLY if something was refused."""
    from pathlib import Path

    from ..core import SettingsError
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.converting import Conversion
    from ..recordings.reading import open_readable
    from ..recordings.topics import StereoTopics
    from .arguments import settings_from
    from .main import warn
    from .progress import Progress
    settings = settings_from(args, RangeNodeSettings())
    if Path(args.recording).resolve() == Path(args.result).resolve():
        raise SettingsError(f'{args.result}: is the recording itself; name another folder for '
                            'the result')
    with open_readable(args.recording, warn) as recording:
        topics = recording.stereo_topics(args.namespace, StereoTopics(
            args.left_image, args.right_image, args.left_info, args.right_info),
            settings.input.transport == 'compressed')
        conversion = Conversion(recording, args.result, topics, settings, args.topics,
                                args.namespace, work_of(args))
        with Progress(total=sum(recording.counts[topic] for topic in topics.names),
                      unit='message', desc='pairing', leave=False) as progress:
            conversion.pair(progress.say, lambda message: progress.update())
        with Progress(total=len(conversion.plan.rows), unit='pair') as progress:
            conversion.measure(progress.say, progress.update)
    return told(args.result, conversion)


def work_of(args):
    """Return the Work of a command line."""
    import os

    from ..core import SettingsError
    from ..recordings.converting import Work
    if args.workers is not None and args.workers < 1:
        raise SettingsError(f'--workers {args.workers}: expected 1 or more')
    return Work(args.workers or len(os.sched_getaffinity(0)), args.scheduler, args.overwrite,
                args.resume, args.restart)


def told(result, conversion):
    """Print how a conversion went; return PARTLY if something was refused."""
    from .main import PARTLY, warn
    plan, tally = conversion.plan, conversion.tally
    print(f'{result}: {tally.measured} pairs measured, {tally.failed} refused, '
          f'{plan.unpaired} images without partner or calibration')
    if tally.failed:
        warn(f'{tally.failed} pairs refused; the first: {tally.first_failure}')
    if plan.refusals:
        warn(f'{plan.refusals}; the first: {plan.refusals.first}')
    return PARTLY if tally.failed or plan.refusals or conversion.loss else None
