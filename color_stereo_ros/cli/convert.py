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
"""`color_stereo convert`: a recording of pairs in, a recording of depth and points out."""

SUMMARY = 'measure every pair of a recording and write the outputs as a recording'
NEEDS = '[tools]'


def add_arguments(parser):
    """Declare the arguments."""
    from ..messages.outputs import OUTPUTS
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.mcap_writing import COMPRESSIONS, DEFAULT_COMPRESSION
    from ..recordings.measuring import DEFAULT_TOPICS, VIEWS
    from .arguments import add_settings_arguments
    from .recorded import add_recording_arguments, add_work_arguments
    add_recording_arguments(parser, ', which the outputs get, too')
    parser.add_argument('result', help='rosbag2 folder to make; it appears when it is complete')
    parser.add_argument('--topics', nargs='+', choices=list(OUTPUTS), metavar='TOPIC',
                        help=f'outputs of range_node to write, of {", ".join(OUTPUTS)} (default '
                        f'{" ".join(DEFAULT_TOPICS)}; {VIEWS} where the projector may be a third '
                        'view). projector/camera_info is written where the projector is found')
    parser.add_argument('--compression', choices=COMPRESSIONS, metavar='HOW',
                        default=DEFAULT_COMPRESSION,
                        help=f'of the result: {" or ".join(COMPRESSIONS)}; small takes a tenth '
                        'more time, and a tenth to a fifth less disk (default %(default)s)')
    parser.add_argument('--overwrite', action='store_true',
                        help='replace RESULT if it is a recording')
    work = add_work_arguments(parser)
    left = work.add_mutually_exclusive_group()
    left.add_argument('--resume', action='store_true', help='go on with a run that was stopped')
    left.add_argument('--restart', action='store_true', help='forget a run that was stopped')
    add_settings_arguments(parser, settings=RangeNodeSettings())


def run(args):
    """Convert the recording of the command line; return PARTLY if something was refused."""
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.converting import Conversion
    from ..recordings.reading import open_readable
    from .arguments import settings_from
    from .main import warn
    from .progress import Progress
    from .recorded import check_apart, topics_of
    settings = settings_from(args, RangeNodeSettings())
    check_apart(args.recording, args.result)
    with open_readable(args.recording, warn) as recording:
        topics = topics_of(args, recording, settings)
        conversion = Conversion(recording, args.result, topics, settings, args.topics,
                                args.namespace, work_of(args), args.compression)
        with Progress.pairing(recording, topics) as (say, tick):
            conversion.pair(say, tick)
        with Progress(total=len(conversion.plan.rows), unit='pair') as progress:
            conversion.measure(progress.say, progress.update)
    return told(args.result, conversion)


def work_of(args):
    """Return the Work of a command line."""
    from ..recordings.converting import Work
    from .recorded import workers_of
    return Work(workers_of(args), args.scheduler, args.overwrite, args.resume, args.restart)


def told(result, conversion):
    """Print how a conversion went; return PARTLY if something was refused."""
    from .recorded import damaged, warn_of_losses
    plan, tally = conversion.plan, conversion.tally
    print(f'{result}: {tally.measured} pairs measured, {tally.failed} refused, '
          f'{plan.unpaired} images without partner or calibration{damaged(conversion.loss)}')
    return warn_of_losses(tally, plan, conversion.loss)
