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
"""`color_stereo demo`: recordings in, range images and point clouds out, over real topics."""

SUMMARY = 'play the sample recordings through both nodes and show what comes out'
NEEDS = '[tools], [ros]; on a terminal [view]'


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument('--samples', default='sample', metavar='FOLDER',
                        help='folder of samples, as `color_stereo sample` makes them (default '
                             'sample)')
    parser.add_argument('--output', default='demo_output', metavar='FOLDER',
                        help='folder to fill; only the output of an earlier demo is replaced '
                        '(default demo_output)')
    parser.add_argument('--wait', type=float, default=120.0, metavar='S',
                        help='give up on a sample if range_node, once it is ready, has given no '
                             'complete output after so many seconds; the time in which it starts '
                             'and compiles its kernels does not count (default 120)')
    parser.add_argument('--port', type=int, default=8080, metavar='N', help='on a terminal it '
                        'ends with the first sample in the browser (color_stereo view), at this '
                        'port or the next free one (default 8080)')


def run(args):
    """Measure every sample, write the results and the page, print where it is."""
    import os
    from pathlib import Path

    from ..nodes.domains import own_domain

    # Chosen before ROS is imported. The nodes of the demo and other nodes must not connect.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    if 'ROS_DOMAIN_ID' not in os.environ:
        os.environ['ROS_DOMAIN_ID'] = str(own_domain())
    from ..demo.run import Demo
    demo = Demo(Path(args.samples), Path(args.output), args.wait)
    page = demo.run()
    print(f'\nThe page is ready: {page.resolve()}')
    if somebody_sits_there():
        look_at(demo.first, args.port)


def somebody_sits_there():
    """Return whether a person has started the command on a terminal."""
    import os
    import sys
    return sys.stdin.isatty() and sys.stdout.isatty() and not os.environ.get('CI')


def look_at(sample, port):
    """Show the recording of a sample in the browser until somebody interrupts."""
    from importlib.util import find_spec

    from ..demo.layout import RECORDING, SETTINGS
    from ..demo.run import settings_of
    from ..errors import pip_install
    from ..recordings.reading import Recording
    from .view import recorded, serve
    if find_spec('viser') is None:
        print(f'To look at every pixel: {pip_install("view")}, then\n'
              f'  color_stereo view {sample / RECORDING} --config {sample / SETTINGS}')
        return
    with Recording(sample / RECORDING) as recording:
        serve('127.0.0.1', port, recorded(recording, recording.stereo_topics(),
                                          settings_of(sample)))
