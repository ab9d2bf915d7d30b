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
"""What commands about recordings share: arguments, and the account of what was lost."""


def add_recording_arguments(parser, about_namespace=''):
    """Declare the recording, and its topics."""
    parser.add_argument('recording', help='rosbag2 folder, a single .mcap or .db3 file, or a '
                        'ROS 1 bag')
    add_topic_arguments(parser, about_namespace)


def add_topic_arguments(parser, about_namespace=''):
    """Declare the topics of the pair, of a recording or of running cameras."""
    from ..recordings.topics import OPTIONS
    topics = parser.add_argument_group('topics', 'where there are several pairs, or other names '
                                       'than range_node expects')
    topics.add_argument('--namespace', metavar='NAME', help='namespace of the cameras'
                        + about_namespace)
    for option, what in zip(OPTIONS, (
            'topic of the images of the left camera', 'topic of the images of the right camera',
            'with --left-image: topic of the camera_info of the left camera',
            'with --right-image: topic of the camera_info of the right camera')):
        topics.add_argument(option, metavar='TOPIC', help=what)


def add_work_arguments(parser):
    """Declare who works; return the group."""
    work = parser.add_argument_group('work', 'the result does not depend on who works')
    work.add_argument('--workers', type=int, metavar='N', help='processes on this machine, each '
                      'with one thread (default: one for each core)')
    work.add_argument('--scheduler', metavar='ADDRESS', help='address of a Dask scheduler, such '
                      'as tcp://host:8786: its workers measure; all of them must see the '
                      'recording and the folder of the result under the same names '
                      '(docs/scale.md)')
    return work


def workers_of(args):
    """Return how many processes a command line asks for."""
    import os

    from ..core import SettingsError
    if args.workers is not None and args.workers < 1:
        raise SettingsError(f'--workers {args.workers}: expected 1 or more')
    return args.workers or len(os.sched_getaffinity(0))


def check_apart(recording, result):
    """
    Refuse a result that is the recording itself, or a folder that holds it.

    Raises
    ------
    SettingsError

    """
    from pathlib import Path

    from ..core import SettingsError
    own = {Path(recording).resolve(), Path(recording).absolute()}
    if any(path.is_relative_to(Path(result).resolve()) for path in own):
        raise SettingsError(f'{result}: is the recording itself, or holds it; name another '
                            'folder for the result')


def damaged(loss):
    """Return what the last line of a command says of a damaged recording, or nothing."""
    return '; a damaged recording, read as far as it is whole' if loss else ''


def named_topics(args):
    """Return the StereoTopics that a command line names; None where it names none."""
    from ..recordings.topics import StereoTopics
    return StereoTopics(args.left_image, args.right_image, args.left_info, args.right_info)


def topics_of(args, recording, settings):
    """Return the StereoTopics of a command line in a recording."""
    return recording.stereo_topics(args.namespace, named_topics(args),
                                   settings.input.transport == 'compressed')


def warn_of_losses(fared, plan, loss):
    """
    Warn of what was refused; what cannot be read was told when it was found.

    Parameters
    ----------
    fared : Tally
        How many pairs failed, and why the first one did.
    plan : Plan
        What is planned, and what it should give.
    loss : str or None
        What cannot be read of a damaged recording.

    Returns
    -------
    status : int or None
        PARTLY, if there was anything.

    """
    from .main import PARTLY, warn
    if fared.failed:
        warn(f'{fared.failed} pairs refused; the first: {fared.first_failure}')
    if plan.refusals:
        warn(f'{plan.refusals}; the first: {plan.refusals.first}')
    return PARTLY if fared.failed or plan.refusals or loss else None
