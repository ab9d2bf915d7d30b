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
"""What the page says, as Markdown."""

import math

import numpy as np

from .frame import STEP
from ..core.account import rows_in_words, status_shares
from ..core.status import Status

SEEN_BY = {0: 'nobody else', 1: 'the right camera', 2: 'the projector',
           3: 'the right camera and the projector'}
"""Values of `RangeResult.views` to words."""
HOW_TO = ('Click on a point or on a picture. Ctrl and click: distance from the last point. '
          'Shift and drag: plane through a box. Shift and click: through a polygon.')


def table(rows):
    """Return (name, text) rows as a table."""
    return '\n'.join(['| | |', '|---|---|', *(f'| {name} | {text} |' for name, text in rows)])


def about_frame(frame):
    """Return what a frame is and how much of it has a range; a part of the pixels tells."""
    result = frame.result
    part = np.s_[::STEP, ::STEP]
    shares = status_shares(result.status[part])
    lines = [f'**{frame.name}**',
             f'{100 * shares[Status.VALID.label]:.1f} % of the pixels have a range']
    depth = result.depth[part]
    known = depth[np.isfinite(depth)]
    if known.size:
        near, middle, far = np.percentile(known, (1, 50, 99))
        lines.append(f'depth: median {middle:.4g} m, nearly all {near:.4g} .. {far:.4g} m')
    reasons = sorted((code for code in Status if code != Status.VALID),
                     key=lambda code: -shares[code.label])
    lines.append('without a range: ' + ', '.join(
        f'{100 * shares[code.label]:.1f} % {code.label}' for code in reasons[:3]
        if shares[code.label] >= 0.0005))
    if result.projector is not None:
        lines.append(result.projector.sentence())
    if result.alignment is not None and result.alignment.sentence():
        lines.append(result.alignment.sentence())
    return '  \n'.join(line for line in lines if line)


def about_pixel(frame, column, row, curve=None):
    """
    Return what is known of a pixel of the rectified left image.

    Parameters
    ----------
    frame : Frame
        The measured pair that is shown.
    column, row : int
        px.
    curve : CostCurve, optional
        Of the pixel.

    """
    result = frame.result
    status = Status(int(result.status[row, column]))
    place, match = frame.raw_place(0, column, row), frame.match(column, row)
    rows = [('left, rectified', f'column {column}, row {row}'),
            ('left, raw', f'{place[0]:.1f}, {place[1]:.1f} px')]
    if match is None:
        rows.append(('range', f'none: **{status.label}**, {status.meaning}'))
    else:
        other = frame.raw_place(1, *match)
        rows += [('right, rectified', f'column {match[0]:.2f}, row {match[1]:.2f}'),
                 ('right, raw', f'{other[0]:.1f}, {other[1]:.1f} px'),
                 *_about_range(frame, column, row)]
    rows += _evidence(frame, column, row, match)
    if curve is not None:
        rows += _about_curve(curve, result.disparity[row, column])
    return table(rows)


def _about_range(frame, column, row):
    """Return the rows about depth and place of a pixel with a range."""
    result, point = frame.result, frame.points[row, column]
    depth, std = float(result.depth[row, column]), float(result.depth_std[row, column])
    shift = f' ± {result.disparity_std[row, column]:.3f}' if math.isfinite(std) else ''
    spread = f' ± {1e3 * std:.3f} mm' if math.isfinite(std) else ''
    rows = [('**depth**', f'**{1e3 * depth:.2f}**{spread or " mm"}'),
            ('disparity', f'{result.disparity[row, column]:.3f}{shift} px'),
            ('x, y, z', ', '.join(f'{1e3 * at:.1f}' for at in point) + ' mm')]
    normal = result.normals()[row, column]
    if np.isfinite(normal).all():
        rows.append(('surface', f'leans by {math.degrees(math.acos(min(1, -normal[2]))):.0f} '
                     'degrees from the optical axis'))
    return rows


def _evidence(frame, column, row, match):
    """Return the rows about what the confidence of a pixel rests on."""
    result = frame.result
    status = Status(int(result.status[row, column]))
    rows = [('**confidence**', f'**{result.confidence[row, column]:.3f}** '
             'that the disparity is right within 1 px'),
            ('status', status.label)]
    if match is not None:
        rows.append(('seen by', f'left camera and {SEEN_BY[int(result.views[row, column])]}'))
        rows.append(('neighbors', _neighbors(result, column, row)))
    color, brightness = result.image[row, column], int(result.image[row, column].max())
    rows.append(('color', f'{color[0]}, {color[1]}, {color[2]} DN; brightest {brightness}'))
    alignment = result.alignment
    if alignment is not None and match is not None:
        left, spread = alignment.rest(*match), alignment.error_std(*match)
        rows.append(('rows here', f'corrected by {frame.row_error(*match):+.2f} px; '
                     f'{float(left):+.2f} ± {float(spread):.2f} px left'))
    if alignment is not None:
        rows.append(('rows of the pair', rows_in_words(result) or (
            'views agree' if alignment.agreeing else 'views do not agree')))
    if result.rival_share:
        rows.append(('repetitions', f'{100 * result.rival_share:.0f} % of the lit surface '
                     'matches at several places'))
    return rows


def _neighbors(result, column, row, half=2):
    """Say how many of the pixels around have a range that is nearly the same."""
    part = result.disparity[max(row - half, 0):row + half + 1,
                            max(column - half, 0):column + half + 1]
    with np.errstate(invalid='ignore'):
        near = np.abs(part - result.disparity[row, column]) < 1
    return f'{np.count_nonzero(near) - 1} of {part.size - 1} agree within 1 px'


def _about_curve(curve, disparity):
    """Return the rows about the coarse search at a pixel."""
    best = int(np.argmin(curve.path))
    step = curve.disparity[1] - curve.disparity[0]
    others = np.abs(np.arange(len(curve.path)) - best) > 1
    rows = [('coarse search', f'{curve.disparity[best]:.1f} px (steps of {step:.0f} px)')]
    if others.any():
        second = int(np.flatnonzero(others)[np.argmin(curve.path[others])])
        rows.append(('next best', f'{curve.disparity[second]:.1f} px, costs '
                     f'{curve.path[second]:.3f} more'))
    if np.isfinite(disparity) and abs(curve.disparity[best] - disparity) > 1.5 * step:
        rows.append(('moved', f'later steps went {disparity - curve.disparity[best]:+.1f} px away '
                     'from the coarse search'))
    return rows


def about_distance(found):
    """Return a Distance as text."""
    spread = f' ± {1e3 * found.std:.3f}' if math.isfinite(found.std) else ''
    return f'**{1e3 * found.value:.2f}{spread} mm** between the last two points'


def about_plane(plane):
    """Return a FittedPlane as text."""
    return table([('points', plane.count), ('**RMS**', f'**{1e3 * plane.rms:.4f} mm**'),
                  ('largest', f'{1e3 * plane.largest:.3f} mm'),
                  ('tilt', f'{plane.tilt:.2f} degrees from the optical axis'),
                  ('center', ', '.join(f'{1e3 * at:.1f}' for at in plane.center) + ' mm')])
