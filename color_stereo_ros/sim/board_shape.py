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
"""The shape `board` of a scene: a calibration board, its edges the edges of triangles."""

import numpy as np

from .errors import SceneError
from ..calibration.boards import Board, BOARDS
from ..errors import ColorStereoError

SIDES = 128      # corners of a disk; its edge is off by 3e-4 of the radius
LIFT = 5e-6      # m from the board to its disks, which overlie it
INK = 0.04       # albedo of the black parts


def read_board(node):
    """
    Return the checked fields of a board: kind, columns, rows, square, marker, dictionary, border.

    Lengths are in m; `border` is the width of the white paper around the squares.

    """
    kind = node.get('kind', 'chessboard').choice(BOARDS.names)
    columns, rows, square = BOARDS[kind].usual
    form = {'kind': kind, 'columns': node.get('columns', columns).integer(2, 200),
            'rows': node.get('rows', rows).integer(2, 200),
            'square': node.get('square', square).number(1e-4, 1.0),
            'marker': node.get('marker', 0.0).number(0.0, 1.0),
            'dictionary': node.get('dictionary', Board.dictionary).text(),
            'border': node.get('border', 0.01).number(1e-4, 1.0)}
    try:
        board_of(form)
    except ColorStereoError as error:
        raise SceneError(f'{node.path}: {error}') from error
    return form


def board_of(form):
    """Return the Board of the fields of a scene."""
    return Board(form['kind'], form['columns'], form['rows'], form['square'], form['marker'],
                 form['dictionary'])


def board_meshes(form):
    """
    Return the white and the black triangles of a board whose middle is the origin.

    Returns
    -------
    white, black : (vertices, faces)
        float64 (V, 3), m, z = 0, normals towards -z; int32 (F, 3).

    """
    board = board_of(form)
    drawing, border = board.drawing, form['border']
    middle = np.array(board.size_m) / 2
    x = np.concatenate([[drawing.x[0] - border], drawing.x, [drawing.x[-1] + border]])
    y = np.concatenate([[drawing.y[0] - border], drawing.y, [drawing.y[-1] + border]])
    columns, rows = np.meshgrid(x - middle[0], y - middle[1])
    vertices = np.column_stack([columns.ravel(), rows.ravel(), np.zeros(columns.size)])
    dark = np.pad(drawing.dark, 1).ravel()
    index = np.arange(columns.size).reshape(columns.shape)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    white, black = (np.concatenate([np.column_stack([a, c, b])[chosen],
                                    np.column_stack([b, c, d])[chosen]]).astype(np.int32)
                    for chosen in (~dark, dark))
    return (vertices, white), _with_disks(vertices, black, drawing.disks, middle)


def _with_disks(vertices, faces, disks, middle):
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(SIDES)])
    corner = np.arange(SIDES)
    for x, y, radius in disks:
        center = np.array([x - middle[0], y - middle[1], -LIFT])
        first = len(vertices)
        vertices = np.concatenate([vertices, center + radius * circle, center[None]])
        fan = np.column_stack([first + corner, np.full(SIDES, first + SIDES),
                               first + (corner + 1) % SIDES])
        faces = np.concatenate([faces, fan.astype(np.int32)])
    return vertices, faces
