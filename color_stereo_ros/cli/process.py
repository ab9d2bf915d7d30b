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
"""`color_stereo process`: one pair of image files in, depth and points out, without ROS."""

from pathlib import Path

SUMMARY = 'measure one pair of image files: depth, points and pictures into a folder'
NEEDS = ''

SAMPLE = Path(__file__).with_name('sample_pair')
"""The first pair of the recording sample/solids_hue2d, without loss."""


def add_arguments(parser):
    """Declare the arguments."""
    from ..parameters.groups import ProcessSettings
    from .arguments import add_settings_arguments
    parser.add_argument('left', nargs='?', help='image of the left camera: PNG, JPEG, TIFF or '
                        'the like, in color, as the camera took it')
    parser.add_argument('right', nargs='?', help='image of the right camera, taken at the same '
                        'moment')
    parser.add_argument('--calibration', nargs=2, metavar=('LEFT', 'RIGHT'),
                        help='the camera_info YAML files of both cameras, calibrated as a pair, '
                        'for example by camera_calibration')
    parser.add_argument('--sample', action='store_true', help='measure the pair that comes with '
                        'the package, with its calibration and settings')
    parser.add_argument('--output', default='process_output', metavar='FOLDER',
                        help='folder to fill; files of an earlier run are replaced (default '
                        'process_output)')
    parser.add_argument('--overwrite', action='store_true', help='replace files in FOLDER that '
                        'are not of an earlier run, too')
    parser.add_argument('--rectified', action='store_true', help='the images are rectified '
                        'already: only P of the calibration is used')
    add_settings_arguments(parser, settings=ProcessSettings())


def run(args):
    """Measure the pair of the command line."""
    from ..files.claim import claimed
    complete(args)
    with claimed(Path(args.output), 'process', CONTENT, overwrite=args.overwrite):
        measure(args)


def complete(args):
    """Put the sample of the package into the arguments, or check that a pair is named."""
    from ..core import SettingsError
    named = [args.left, args.right, args.calibration]
    if args.sample:
        if any(named):
            raise SettingsError('--sample has images and a calibration of its own; leave out '
                                'yours')
        args.left, args.right = (str(SAMPLE / name) for name in ('left.webp', 'right.webp'))
        args.calibration = [str(SAMPLE / name) for name in ('left.yaml', 'right.yaml')]
        args.config = args.config or str(SAMPLE / 'settings.yaml')
    elif not all(named):
        raise SettingsError('name two images and --calibration LEFT RIGHT, or --sample for the '
                            'pair that comes with the package')


def measure(args):
    """Measure, write and tell."""
    from ..core import ColorStereo, StereoCalibration
    from ..core.account import doubts_about_images, doubts_about_result
    from ..files.image import read_image
    from ..parameters.groups import ProcessSettings
    from ..patience import patience
    from .arguments import settings_from
    settings = settings_from(args, ProcessSettings())
    calibration = StereoCalibration.from_yaml(*args.calibration)
    left, right = read_image(args.left), read_image(args.right)
    warn_of(doubts_about_images(left, right))
    with patience():
        stereo = ColorStereo(calibration, settings.core, rectified_input=args.rectified)
    with patience('measuring'):
        result = stereo.process(left, right)
    output = Path(args.output)
    write_result(output, result, settings)
    write_page(output / PAGE, args, left, right, result, settings)
    print(account(result))
    if result.projector is not None:
        print(about_views(result))
    print(f'Written to {output}:')
    for name, content in CONTENT.items():
        print(f'  {name:18}{content}')
    warn_of(doubts_about_result(stereo, left, right, result))


def warn_of(doubts):
    """Print warnings on standard error."""
    import sys
    for doubt in doubts:
        print(f'color_stereo: warning: {doubt}', file=sys.stderr)


def account(result):
    """Return the shares of the pixels by status, and between which depths they lie, as text."""
    import numpy as np

    from ..core.account import status_shares
    from ..core.status import Status
    shares = status_shares(result.status)
    lines = [f'{100 * shares[code.label]:9.1f} %  {code.label:15}{code.meaning}'
             for code in sorted(Status, key=lambda code: (code != Status.VALID,
                                                          -shares[code.label]))
             if code == Status.VALID or shares[code.label]]
    known = result.depth[np.isfinite(result.depth)]
    if known.size:
        near, middle, far = np.percentile(known, (1, 50, 99))
        lines.append(f'Depths: median {middle:.4g} m, nearly all within {near:.4g} .. {far:.4g} m')
    return '\n'.join(['Pixels by status:', *lines])


def about_views(result):
    """Return what is known of the projector, and what it adds, as text."""
    import numpy as np
    share = np.mean(result.views == 2)
    text = f'Third view: {result.projector.sentence()}'
    return text + (f'; {share:.1%} of the pixels have a range by it alone' if share else '')


PAGE = 'index.html'
CONTENT = {
    'depth_mm.png': '16 bit, millimeters, 0 = unknown',
    'depth.tiff': '32 bit float, meters, NaN = unknown',
    'depth_std.tiff': '32 bit float, standard deviation of the depth in meters',
    'confidence.png': '8 bit, 255 = 1',
    'status_codes.png': '8 bit, 0 = valid, otherwise the code of the reason (docs/nodes.md)',
    'status.png': 'the same for people: one color for each reason, with a legend',
    'views.png': 'who saw a pixel beside the left camera: right camera, projector, both',
    'range_image.png': 'false colors of the depth with a scale bar, black = unknown',
    'points.ply': 'colored points in meters, rectified left camera',
    PAGE: 'page for a browser: the pictures, and the points to be turned',
}


def write_result(folder, result, settings):
    """
    Write a result into a folder, the files of `CONTENT` but for the page.

    Parameters
    ----------
    folder : Path
        Where the files are written; it is there.
    result : RangeResult
        Of the pair.
    settings : ProcessSettings
        Colors and limits of the range image.

    """
    import numpy as np

    from ..core.false_color import (
        false_color, range_limits, status_picture, views_picture)
    from ..core.legends import with_scale_bar, with_status_legend, with_views_legend
    from ..files.cloud import save_cloud
    from ..files.image import write_image
    from ..messages.outputs import millimeters
    picture = settings.output
    limits = range_limits(result.depth, settings.range, picture.range_limits)
    colors = false_color(result.depth, *limits, picture.range_colors)
    images = {
        'depth_mm.png': millimeters(result.depth),
        'depth.tiff': result.depth,
        'depth_std.tiff': result.depth_std,
        'confidence.png': np.rint(255 * result.confidence).astype(np.uint8),
        'status_codes.png': result.status,
        'status.png': with_status_legend(status_picture(result.status)),
        'views.png': with_views_legend(views_picture(result.views)),
        'range_image.png': with_scale_bar(colors, *limits, picture.range_colors)}
    for name, image in images.items():
        write_image(folder / name, image)
    save_cloud(folder / 'points.ply', result.points(), result.image)


def write_page(path, args, left, right, result, settings):
    """Write the page about a pair; its colors have the limits of the range image."""
    from ..core.false_color import range_limits
    from ..demo.page import make_pair_page
    from ..files.atomic import write_text
    limits = range_limits(result.depth, settings.range, settings.output.range_limits)
    write_text(path, make_pair_page((Path(args.left).name, Path(args.right).name), left, right,
                                    result, limits))
