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
"""
A board as a PDF at true scale, with rulers to check the print by.

The page is drawn in mm with y down. One matrix maps it to PDF's points, so that the numbers in the
file are those of the board.

"""

from dataclasses import dataclass
import re

import numpy as np

from ..errors import CalibrationError
from ..files.atomic import written_whole

POINTS_PER_MM = 72 / 25.4
PAPERS = {'A0': (841, 1189), 'A1': (594, 841), 'A2': (420, 594), 'A3': (297, 420),
          'A4': (210, 297), 'A5': (148, 210), 'letter': (215.9, 279.4),
          'legal': (215.9, 355.6), 'tabloid': (279.4, 431.8)}
"""Width and height upright, mm."""
EDGE = 5.0     # mm along each edge of the paper that printers leave white
STRIP = 13.0   # mm below and to the left of the board for rulers and text
QUIET = 0.5    # of a square, at least, is white around the board
LARGEST = 5000.0  # mm; PDF ends at 5080
TEXT = 3.0     # mm, height of the letters


@dataclass(frozen=True)
class Layout:
    """Where a board lies on its page, mm, y down."""

    page: tuple
    """Width and height."""
    left: float
    top: float
    ruler_x: float
    """Length of the ruler below the board; a multiple of 10."""
    ruler_y: float
    """Length of the ruler to the left of the board."""


def paper_size(name):
    """
    Return width and height of a paper, mm.

    Parameters
    ----------
    name : str
        A name in PAPERS in any case, or width and height in mm, such as '600x400'.

    Raises
    ------
    CalibrationError
        If the name is unknown or a length is not 50 .. 5000 mm.

    """
    known = {each.lower(): size for each, size in PAPERS.items()}
    if name.strip().lower() in known:
        return known[name.strip().lower()]
    sides = re.fullmatch(r'\s*([\d.]+)\s*x\s*([\d.]+)\s*(mm)?\s*', name)
    try:
        size = tuple(float(side) for side in sides.groups()[:2]) if sides else ()
    except ValueError:
        size = ()
    if not size or min(size) < 50 or max(size) > LARGEST:
        raise CalibrationError(f'paper {name!r} is none of {", ".join(PAPERS)}, and no width and '
                               f'height in mm of 50 .. {LARGEST:g}, such as 600x400')
    return size


def layout(board, paper):
    """
    Place a board on a page, upright or across.

    Parameters
    ----------
    board : Board
        The calibration board.
    paper : (float, float)
        Width and height, mm.

    Returns
    -------
    layout : Layout

    Raises
    ------
    CalibrationError
        If the paper is too small; says which square would fit.

    """
    width, height = (1e3 * side for side in board.size_m)
    quiet = QUIET * 1e3 * board.square_m
    needed = width + 2 * quiet + STRIP + 2 * EDGE, height + 2 * quiet + STRIP + 2 * EDGE
    pages = [page for page in (paper, paper[::-1])
             if page[0] >= needed[0] and page[1] >= needed[1]]
    if not pages:
        raise CalibrationError(
            f'{board.describe()}: needs paper of {needed[0]:.0f} x {needed[1]:.0f} mm, this one '
            f'has {paper[0]:g} x {paper[1]:g} mm; {_what_fits(board, paper)}')
    page = pages[0]
    free = page[0] - needed[0], page[1] - needed[1]
    return Layout(page, EDGE + STRIP + quiet + free[0] / 2, EDGE + quiet + free[1] / 2,
                  _ruler(width), _ruler(height))


def _what_fits(board, paper):
    """Return advice: the largest square, in steps of half a mm."""
    width, height = (side / board.square_m + 2 * QUIET for side in board.size_m)
    across, down = (side - STRIP - 2 * EDGE for side in paper)
    fits = max(min(across / width, down / height), min(down / width, across / height))
    fits = np.floor(2 * fits) / 2
    if fits < 1:
        return 'take fewer squares or larger paper'
    return f'squares of {fits:g} mm fit'


def _ruler(length):
    return max(10.0, 10.0 * np.floor(length / 10.0 + 1e-9))


def content(board, place, note=''):
    """
    Return the drawing of a page in PDF's language; lengths are mm.

    Parameters
    ----------
    board : Board
        The calibration board.
    place : Layout
        Where the board lies on the page.
    note : str
        Printed below the ruler.

    Returns
    -------
    text : str
        Lines `x y width height re` are the black rectangles.

    """
    lines = [f'{_number(POINTS_PER_MM)} 0 0 {_number(-POINTS_PER_MM)} 0 '
             f'{_number(place.page[1] * POINTS_PER_MM)} cm', '0 g 0 G']
    rectangles = 1e3 * board.drawing.rectangles()
    rectangles[:, :2] += place.left, place.top
    lines += [' '.join(map(_number, each)) + ' re' for each in rectangles]
    for x, y, radius in 1e3 * board.drawing.disks:
        lines += _disk(place.left + x, place.top + y, radius)
    lines += ['f'] if len(lines) > 2 else []
    return '\n'.join([*lines, *_rulers(board, place, note)]) + '\n'


def _number(value):
    """Return a length to 1e-6 mm: printers resolve 1e-2."""
    return f'{value:.6f}'.rstrip('0').rstrip('.')


def _disk(x, y, radius, arcs=8):
    """Return the path of a disk, by arcs of Bezier curves; off by 4e-6 of the radius."""
    step = 2 * np.pi / arcs
    handle = 4 / 3 * np.tan(step / 4) * radius
    lines = [f'{_number(x + radius)} {_number(y)} m']
    for angle in step * np.arange(arcs):
        first, last = (np.array([np.cos(each), np.sin(each)]) for each in (angle, angle + step))
        points = (radius * first + handle * np.array([-first[1], first[0]]),
                  radius * last - handle * np.array([-last[1], last[0]]), radius * last)
        lines.append(' '.join(_number(value) for point in points
                              for value in point + (x, y)) + ' c')
    return [*lines, 'h']


def _rulers(board, place, note):
    """Return two rulers with a mark each mm, and the text."""
    width, height = (1e3 * side for side in board.size_m)
    quiet = QUIET * 1e3 * board.square_m
    below, beside = place.top + height + quiet + 1, place.left - quiet - 1
    lines = ['0.1 w']
    for index in range(round(place.ruler_x) + 1):
        x = place.left + index
        lines.append(_line(x, below, x, below + _mark(index)))
    for index in range(round(place.ruler_y) + 1):
        y = place.top + index
        lines.append(_line(beside, y, beside - _mark(index), y))
    text = (f'{place.ruler_x:g} mm below, {place.ruler_y:g} mm at the left: measure both rulers. '
            'Print at 100 % ("actual size").')
    for row, each in enumerate((text, f'{board.describe()}. {note}'.strip())):
        lines.append(_text(place.left, below + 4 + TEXT * (1 + 1.2 * row), each))
    return lines


def _mark(index):
    return 4.0 if index % 10 == 0 else 3.0 if index % 5 == 0 else 2.0


def _line(*ends):
    x0, y0, x1, y1 = map(_number, ends)
    return f'{x0} {y0} m {x1} {y1} l S'


def _text(x, y, text):
    escaped = re.sub(r'([()\\])', r'\\\1', text)
    return f'BT /F1 {TEXT:g} Tf 1 0 0 -1 {_number(x)} {_number(y)} Tm ({escaped}) Tj ET'


def pdf(board, paper, note=''):
    """
    Return a PDF file with a board.

    Parameters
    ----------
    board : Board
        The calibration board.
    paper : (float, float)
        Width and height, mm; turned where the board fits better.
    note : str
        Printed below the ruler, ASCII.

    Returns
    -------
    file : bytes

    Raises
    ------
    CalibrationError
        If the paper is too small.

    """
    place = layout(board, paper)
    stream = content(board, place, note).encode('ascii')
    width, height = (_number(side * POINTS_PER_MM) for side in place.page)
    objects = [
        # Viewers must not shrink the page to what the printer can reach.
        b'<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>',
        b'<< /Type /Pages /Kids [3 0 R] /Count 1 >>',
        f'<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R '
        '/Resources << /Font << /F1 5 0 R >> >> >>'.encode(),
        f'<< /Length {len(stream)} >>\nstream\n'.encode() + stream + b'endstream',
        b'<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>']
    return _assembled(objects)


def _assembled(objects):
    """Return the file of PDF objects 1, 2, ..., the first one being the catalog."""
    file, starts = b'%PDF-1.7\n', []
    for number, each in enumerate(objects, 1):
        starts.append(len(file))
        file += f'{number} 0 obj\n'.encode() + each + b'\nendobj\n'
    table = ''.join(f'{start:010d} 00000 n \n' for start in starts)
    return file + (f'xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}trailer\n'
                   f'<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{len(file)}\n'
                   '%%EOF\n').encode()


def write_pdf(path, board, paper, note='', replace=True):
    """Write a PDF file with a board, whole or not at all; see `pdf` for the arguments."""
    made = pdf(board, paper, note)
    with written_whole(path, replace=replace) as partial:
        partial.write_bytes(made)
