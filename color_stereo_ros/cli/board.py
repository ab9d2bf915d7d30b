# SPDX-License-Identifier: Apache-2.0
"""`color_stereo board`: write a calibration board for the printer."""

SUMMARY = 'write a calibration board as a PDF at true scale'
NEEDS = ''


def add_arguments(parser):
    """Declare the arguments."""
    from .board_arguments import add_board_arguments
    parser.add_argument('output', help='PDF file, for example board.pdf')
    parser.add_argument('--paper', metavar='SIZE', default='A4', help='A0 .. A5, letter, legal, '
                        'tabloid, or width and height in mm, such as 600x400 (default A4)')
    parser.add_argument('--overwrite', action='store_true', help='replace a file of that name')
    add_board_arguments(parser)


def run(args):
    """Write the board that the command line describes."""
    from ..calibration.board_pdf import layout, paper_size, write_pdf
    from .board_arguments import board_from, options_of
    board, paper = board_from(args), paper_size(args.paper)
    write_pdf(args.output, board, paper, options_of(board), replace=args.overwrite)
    place = layout(board, paper)
    print(f'{args.output}: {board.describe()}, page {place.page[0]:g} x {place.page[1]:g} mm\n'
          f'Print at 100 %. The rulers must measure {place.ruler_x:g} mm and '
          f'{place.ruler_y:g} mm. Glue the print on a flat, stiff plate.\n'
          f'Then calibrate with {options_of(board)}')
