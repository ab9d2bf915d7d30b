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
"""`color_stereo pattern`: write the image that the projector must show."""

SUMMARY = 'write the image that the projector must show'
NEEDS = ''


def add_arguments(parser):
    """Declare the arguments."""
    from ..core.patterns.frames import FRAMES, PATTERN
    from .arguments import add_settings_arguments
    parser.add_argument('output', help='image file, for example pattern.png; a format without '
                        'loss, for JPEG changes the colors')
    parser.add_argument('--overwrite', action='store_true', help='replace a file of that name')
    parser.add_argument('--frame', choices=FRAMES.names, default=PATTERN,
                        help='what is shown instead of the pattern, as pattern.frame of '
                        'pattern_node (default pattern)')
    add_settings_arguments(parser, groups=('pattern',))


def run(args):
    """Write the pattern of the command line's settings."""
    from ..core.patterns.frames import make_frame, PATTERN
    from ..files.atomic import check_free
    from ..files.image import write_image
    from ..patience import patience
    from .arguments import settings_from
    settings = settings_from(args).pattern
    if not args.overwrite:
        check_free(args.output)
    with patience('making the pattern'):
        pattern = make_frame(args.frame, settings)
    write_image(args.output, pattern, replace=args.overwrite)
    what = settings.type if args.frame == PATTERN else args.frame
    print(f'{args.output}: {what}, {settings.width} x {settings.height} px')
