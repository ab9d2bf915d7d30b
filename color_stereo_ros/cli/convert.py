# SPDX-License-Identifier: Apache-2.0
"""`color_stereo convert`: a recording of pairs in, a recording of depth and points out."""

SUMMARY = 'measure every pair of a recording and write the outputs as a recording'

DEFAULT_TOPICS = ('points', 'depth/image', 'depth/camera_info')


def add_arguments(parser):
    """Declare the arguments."""
    from ..nodes.parameters import RangeNodeSettings
    from ..nodes.sensor.outputs import TOPICS
    from .arguments import add_settings_arguments
    parser.add_argument('recording', help='rosbag2 folder, or a single .mcap or .db3 file')
    parser.add_argument('result', help='rosbag2 folder to make; it appears when it is complete')
    parser.add_argument('--namespace', metavar='NAME', help='namespace of the cameras, needed '
                        'where a recording has several pairs')
    parser.add_argument('--topics', nargs='+', choices=list(TOPICS), default=list(DEFAULT_TOPICS),
                        metavar='TOPIC', help=f'outputs of range_node to write, of '
                        f'{", ".join(TOPICS)} (default {" ".join(DEFAULT_TOPICS)})')
    parser.add_argument('--overwrite', action='store_true',
                        help='replace RESULT if it is a recording')
    add_settings_arguments(parser, settings=RangeNodeSettings())


def run(args):
    """Convert the recording of the command line."""
    from pathlib import Path

    from tqdm import tqdm

    from ..core import SettingsError
    from ..nodes.parameters import RangeNodeSettings
    from ..recordings.offline import OfflineNode
    from ..recordings.recording import Recording, write_recording
    from .arguments import settings_from
    settings = settings_from(args, RangeNodeSettings())
    if Path(args.recording).resolve() == Path(args.result).resolve():
        raise SettingsError(f'{args.result}: is the recording itself; name another folder for '
                            'the result')
    with Recording(args.recording) as recording:
        topics = recording.stereo_topics(args.namespace)
        with write_recording(args.result, overwrite=args.overwrite) as writer, \
                tqdm(total=recording.counts[topics.left_image], unit='pair') as progress:
            node = OfflineNode(writer, topics, settings, args.topics, say=progress.write)
            for message in recording.messages(topics.names):
                node.take(message)
                progress.update(message.topic == topics.left_image)
            node.finish(recording)
    print(f'{args.result}: {node.measured} pairs measured, {node.failed} refused, '
          f'{node.unpaired} images without partner or calibration')
