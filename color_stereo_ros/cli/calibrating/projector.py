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
"""`color_stereo calibrate projector`: the gamma of the projector, through a calibrated camera."""

SUMMARY = 'measure the gamma of the projector through a camera of known colors'
NEEDS = ''


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument('folder', help='images of a white card: left_white.png, left_black.png '
                        'and left_level_N.png, taken while `color_stereo project --level N` '
                        'shows gray N, for example 32, 64, 96, 128, 160, 192, 224')
    parser.add_argument('--color', required=True, metavar='FILE',
                        help='color calibration of the cameras, see `calibrate color`')
    parser.add_argument('--side', choices=('left', 'right'), default='left',
                        help='which camera took the images (default left)')
    parser.add_argument('-o', '--output', default='projector.yaml', metavar='FILE',
                        help='file for `color_stereo project --response` (default '
                        'projector.yaml)')
    parser.add_argument('--overwrite', action='store_true', help='replace a file of that name')


def run(args):
    """Measure, print and write."""
    from ...calibration.frame_files import read_frames
    from ...calibration.projector import calibrate_projector
    from ...core.color_calibration import ColorCalibration
    from ...files.atomic import check_free
    if not args.overwrite:
        check_free(args.output)
    colors = ColorCalibration.read(args.color)
    found = calibrate_projector(read_frames(args.folder, args.side), colors, args.side)
    found.response.write(args.output, replace=args.overwrite)
    red, green, blue = found.response.gamma
    print(f'gamma {red:.3f} red, {green:.3f} green, {blue:.3f} blue, from {len(found.levels)} '
          f'gray levels; they fit within {100 * found.error:.2f} % of white')
    print(f'{args.output}: written; use it by `color_stereo project --response {args.output}`')
