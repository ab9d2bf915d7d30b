# SPDX-License-Identifier: Apache-2.0
"""`color_stereo pattern`: write the image that the projector must show."""

SUMMARY = 'write the image that the projector must show'
NEEDS = ''


def add_arguments(parser):
    """Declare the arguments."""
    from .arguments import add_settings_arguments
    parser.add_argument('output', help='image file, for example pattern.png; a format without '
                        'loss, for JPEG changes the colors')
    parser.add_argument('--overwrite', action='store_true', help='replace a file of that name')
    add_settings_arguments(parser, groups=('pattern',))


def run(args):
    """Write the pattern of the command line's settings."""
    from ..core import make_pattern
    from ..files.atomic import check_free
    from ..files.image import write_image
    from ..patience import patience
    from .arguments import settings_from
    settings = settings_from(args).pattern
    if not args.overwrite:
        check_free(args.output)
    with patience('making the pattern'):
        pattern = make_pattern(settings)
    write_image(args.output, pattern, replace=args.overwrite)
    print(f'{args.output}: {settings.type}, {settings.width} x {settings.height} px')
