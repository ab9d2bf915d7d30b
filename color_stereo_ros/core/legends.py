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
"""Strips that explain the colors of a picture, added to the right of it."""

from functools import lru_cache
import textwrap

import cv2
import numpy as np

from .false_color import false_color, RANGE_COLORS, STATUS_COLORS, VIEW_COLORS

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_SCALE = 0.38
_LINE = 13            # px from one line of text to the next
_MARGIN = 6           # px
_SWATCH = 14          # px, width of a scale bar and of the color beside a name
_BACKGROUND = 40      # DN: darker than each color of a depth, brighter than "unknown"
_INK = (255, 255, 255)
_LEAST_MARKED = 96    # px: a scale bar of this height has room for "unknown" below it
_MEANING_WIDTH = 36   # characters of a line


def with_scale_bar(picture, near, far, colors=RANGE_COLORS[0]):
    """
    Return a picture of depth with a bar of its colors, labeled in m, to the right of it.

    The pixels of the picture keep their coordinates. Near is at the bottom.

    Parameters
    ----------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB, as `false_color` draws it.
    near, far : float
        m, as `false_color` got them.
    colors : str
        One of `RANGE_COLORS`.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W', 3), W' > W
        RGB.

    """
    strip = _scale_bar(picture.shape[0], float(near), float(far), colors)
    return np.concatenate((picture, strip), axis=1)


def with_status_legend(picture):
    """
    Return a picture of the status with the meaning of its colors to the right of it.

    The pixels of the picture keep their coordinates. A high picture has room for the whole
    meanings, a low one for the names, in several columns if needed.

    Parameters
    ----------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB, as `status_picture` draws it.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W', 3), W' > W
        RGB.

    """
    return np.concatenate((picture, _status_legend(picture.shape[0])), axis=1)


def with_views_legend(picture):
    """
    Return a picture of `views_picture` with the names of its colors to the right of it.

    Parameters
    ----------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W', 3), W' > W
        RGB.

    """
    return np.concatenate((picture, _views_legend(picture.shape[0])), axis=1)


@lru_cache(maxsize=8)
def _views_legend(height):
    """Return the colors of who saw a pixel with their names, RGB."""
    strip = _names(height, [(color, name) for name, color in VIEW_COLORS.values()])
    strip.setflags(write=False)
    return strip


@lru_cache(maxsize=8)
def _scale_bar(height, near, far, colors):
    """Return the bar with its labels, RGB."""
    marked = height >= _LEAST_MARKED
    rows = height - 2 * _LINE if marked else height
    labels = np.linspace(near, far, int(np.clip(rows // 48 + 1, 2, 11)))
    texts = _label_texts(labels)
    strip = _empty(height, 2 * _MARGIN + _SWATCH + _text_width([*texts, 'unknown']))
    bar = slice(_MARGIN, _MARGIN + _SWATCH)
    depth = np.linspace(far, near, rows, dtype=np.float32)[:, None]
    strip[:rows, bar] = false_color(depth, near, far, colors)
    for label, text in zip(labels, texts):
        row = round((rows - 1) * (far - label) / (far - near))
        strip[row, bar.stop:bar.stop + 3] = _INK
        _write(strip, text, bar.stop + 4, int(np.clip(row + 4, _LINE - 4, max(rows - 3, 1))))
    if marked:
        _entry(strip, _MARGIN, rows + _LINE // 2, (0, 0, 0), 'unknown')
    strip.setflags(write=False)
    return strip


def _label_texts(labels):
    """Return depths in m as text, with as many digits as they need to differ."""
    step = labels[1] - labels[0]
    digits = int(np.clip(np.ceil(1.0 - np.log10(step)), 0, 4))
    return [f'{label:.{digits}f} m' for label in labels]


@lru_cache(maxsize=8)
def _status_legend(height):
    """Return the colors of the status with their meanings, RGB."""
    whole = [(color, code.label, textwrap.wrap(code.meaning, _MEANING_WIDTH))
             for code, color in STATUS_COLORS.items()]
    if sum(1 + len(meaning) for _, _, meaning in whole) * _LINE + 2 * _MARGIN <= height:
        strip = _column(height, whole)
    else:
        strip = _names(height, [(color, label) for color, label, _ in whole])
    strip.setflags(write=False)
    return strip


def _names(height, entries):
    """Return (color, name) in as many columns as the height asks for, RGB."""
    most = max((height - _MARGIN) // _LINE, 1)
    names = [(color, name, []) for color, name in entries]
    return np.concatenate([_column(height, names[first:first + most])
                           for first in range(0, len(names), most)], axis=1)


def _column(height, entries):
    """Return one column of (color, name, lines of the meaning), RGB."""
    texts = [text for _, name, meaning in entries for text in (name, *meaning)]
    column = _empty(height, 2 * _MARGIN + _SWATCH + _text_width(texts))
    row = _MARGIN // 2
    for color, name, meaning in entries:
        _entry(column, _MARGIN, row, color, name)
        for line in meaning:
            row += _LINE
            _write(column, line, _MARGIN + _SWATCH + 4, row + 9, ink=(185, 185, 185))
        row += _LINE
    return column


def _entry(strip, left, top, color, text):
    """Draw a color and its name."""
    strip[top:top + _LINE - 2, left:left + _SWATCH] = 150
    strip[top + 1:top + _LINE - 3, left + 1:left + _SWATCH - 1] = color
    _write(strip, text, left + _SWATCH + 4, top + 9)


def _empty(height, width):
    return np.full((height, width, 3), _BACKGROUND, np.uint8)


def _text_width(texts):
    """Return the width of the longest text with its distances, px."""
    return max(cv2.getTextSize(text, _FONT, _FONT_SCALE, 1)[0][0] for text in texts) + 4


def _write(strip, text, left, baseline, ink=_INK):
    cv2.putText(strip, text, (left, baseline), _FONT, _FONT_SCALE, ink, 1, cv2.LINE_AA)
