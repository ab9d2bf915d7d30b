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
"""`color_stereo replay`: publish a recording on real topics, where rosbag2 is not installed."""

SUMMARY = 'publish a recording on real topics'
NEEDS = '[tools], [ros]'


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument('recording', help='rosbag2 folder, a single .mcap or .db3 file, or a '
                        'ROS 1 bag')
    parser.add_argument('--rate', type=float, default=1.0, metavar='FACTOR',
                        help='speed, 1 = as recorded (default)')
    parser.add_argument('--loop', action='store_true', help='start again at the end')
    parser.add_argument('--stamps', choices=('original', 'now'), default='original',
                        help='stamps of the messages: as recorded (default), or shifted to the '
                             'time of replay')
    parser.add_argument('--namespace', default='', metavar='NAME',
                        help='put a namespace before every topic')
    parser.add_argument('--topics', nargs='+', metavar='TOPIC', help='only these topics')
    parser.add_argument('--wait', type=float, default=5.0, metavar='S',
                        help='wait so long for a subscriber before the first message (default 5)')


def run(args):
    """
    Publish until the end, or until SIGINT or SIGTERM; both are a good end.

    Returns
    -------
    status : int or None
        PARTLY if a message was refused.

    """
    from ..errors import SettingsError
    from ..nodes.live import ros_node
    from ..recordings.reading import Recording
    from ..recordings.refusals import Refusals
    from .main import PARTLY, warn
    if not args.rate > 0:
        raise SettingsError(f'--rate = {args.rate} is not larger than 0')
    with Recording(args.recording) as recording, ros_node('color_stereo_replay') as node:
        from ..nodes.replay import Player
        refusals = Refusals(warn)
        player = Player(node, recording, args.topics, args.namespace, args.stamps == 'now',
                        say=warn, refuse=refusals.add)
        if not player.wait_for_subscriber(args.wait):
            warn(f'nobody listens to any of the topics after {args.wait:g} s; publishing all the '
                 'same. Topics, namespace and ROS_DOMAIN_ID of the listener must be the same')
        print(f'{args.recording}: {sum(recording.counts.values())} messages, '
              f'{recording.duration:.1f} s, on {", ".join(sorted(player.publishers))}', flush=True)
        try:
            player.play(args.rate)
            while args.loop:
                player.play(args.rate, again=True)
            player.finish()
        except KeyboardInterrupt:
            print('stopped')
        if refusals:
            warn(f'{refusals}; the first: {refusals.first}')
        return PARTLY if refusals else None
