# SPDX-License-Identifier: Apache-2.0
"""`color_stereo demo`: recordings in, range images and point clouds out, over real topics."""

SUMMARY = 'play the sample recordings through both nodes and show what comes out'
NEEDS = '[tools], [ros]'


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
    page = Demo(Path(args.samples), Path(args.output), args.wait).run()
    print(f'\nThe page is ready: {page.resolve()}')
