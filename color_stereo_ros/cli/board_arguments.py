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
"""The options that describe a calibration board, for all commands that see or print one."""


def add_board_arguments(parser):
    """Add `--kind`, `--columns`, `--rows`, `--square-mm`, `--marker-mm`, `--dictionary`."""
    from ..calibration.boards import Board, BOARDS, default_kind
    section = parser.add_argument_group('board', 'the same for printing it and for finding it')
    kinds = '; '.join(f'{name}: {kind.summary}' for name, kind in BOARDS.items())
    section.add_argument('--kind', choices=BOARDS.names, default=default_kind(),
                         help=f'{kinds} (default {default_kind()})')
    usual = ', '.join(f'{name} {kind.usual[0]} x {kind.usual[1]} of {1e3 * kind.usual[2]:g} mm'
                      for name, kind in BOARDS.items())
    section.add_argument('--columns', type=int, metavar='N', help='squares along a row, not inner '
                         f'corners; circles in a row (default: {usual})')
    section.add_argument('--rows', type=int, metavar='N', help='rows of squares or of circles')
    section.add_argument('--square-mm', type=float, metavar='X', help='side of a square as '
                         'measured on the print, or distance from row to row of circles')
    section.add_argument('--marker-mm', type=float, metavar='X', default=0.0,
                         help='side of a ChArUco marker or diameter of a circle (default 0: the '
                         'usual share of the square)')
    section.add_argument('--dictionary', metavar='NAME', default=Board.dictionary,
                         help="of the ChArUco markers, OpenCV's name without DICT_ (default "
                         f'{Board.dictionary})')


def board_from(args):
    """Return the Board that a command line describes."""
    from ..calibration.boards import Board, BOARDS
    columns, rows, square = BOARDS[args.kind].usual
    return Board(args.kind, columns if args.columns is None else args.columns,
                 rows if args.rows is None else args.rows,
                 square if args.square_mm is None else args.square_mm / 1e3,
                 args.marker_mm / 1e3, args.dictionary)


def options_of(board):
    """Return the options that describe a board to another command, a str."""
    text = (f'--kind {board.kind} --columns {board.columns} --rows {board.rows} '
            f'--square-mm {1e3 * board.square_m:g}')
    if board.kind != 'chessboard':
        text += f' --marker-mm {1e3 * board.marker_m:g}'
    return text + (f' --dictionary {board.dictionary}' if board.kind == 'charuco' else '')
