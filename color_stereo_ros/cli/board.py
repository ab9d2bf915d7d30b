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
