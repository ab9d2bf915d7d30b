# SPDX-License-Identifier: Apache-2.0
"""`color_stereo pattern`: write the image that the projector must show."""

SUMMARY = 'write the image that the projector must show'


def add_arguments(parser):
    """Declare the arguments."""
    from .arguments import add_settings_arguments
    parser.add_argument('output', help='image file, for example pattern.png; a format without '
                        'loss, for JPEG changes the colors')
    add_settings_arguments(parser, groups=('pattern',))


def run(args):
    """Write the pattern of the command line's settings."""
    from ..core import make_pattern
    from ..files.image import write_image
    from .arguments import settings_from
    settings = settings_from(args).pattern
    write_image(args.output, make_pattern(settings))
    print(f'{args.output}: {settings.type}, {settings.width} x {settings.height} px')
