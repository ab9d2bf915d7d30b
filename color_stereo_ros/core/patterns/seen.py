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
"""Which kind of pattern an image shows: whether its colors change along rows only."""

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from .feature_size import channel_sum, LEAST_LIGHT, LEAST_VARIANCE
from .making import make_pattern
from .registry import makable
from ..settings import PatternSettings

CELL = 4  # px; chosen: the noise of a pixel is averaged, structures of 6 px remain
LAGS = 1, 2, 3  # cells; chosen: a repeating pattern has no period that divides all of them
LEAST_CELLS = 100  # chosen: a fiftieth of 320 x 240 px
# chosen: stripes give .0 to .3, fields .8 to 1.2 (test_patterns.py); noise and texture add to both
STRIPES = 0.5
GRAY = 0.002  # chosen: noise and JPEG of gray images give less, patterns .06 to .4
# chosen: a tilted plane, median error of Z .14 %; hue_field and wave_field .20 to .21, lines .38
FOR_GRAY = 'pseudo_noise'
REFERENCE = PatternSettings(width=512, height=512)


@dataclass(frozen=True)
class Seen:
    """What an image shows of a pattern."""

    sentence: str
    """For people."""
    agrees: bool | None
    """With the pattern of the settings; None: that cannot be told."""
    kind: str
    """Type of the pattern that was expected."""
    gray: bool = False
    """Neither camera sees colors: the brightness of the pattern is matched."""


def pattern_seen(image, settings, gray=False):
    """
    Return what an image shows of a pattern.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        Rectified, RGB.
    settings : PatternSettings
        The pattern that is expected.
    gray : bool
        Neither camera sees colors.

    Returns
    -------
    seen : Seen

    """
    kind, spread = settings.type, steps(image)
    if spread is None:
        return Seen('too little light to see a pattern', None, kind)
    if gray:
        return Seen(in_gray(kind), None, kind, gray=True)
    if spread.of_pixels < GRAY:
        return Seen('no colors of a pattern are seen: gray cameras, no pattern, or one of '
                    'brightness alone', False if kind in makable() else None, kind)
    if spread.variance < LEAST_VARIANCE:
        return Seen('colors are too weak or too fine to tell the pattern', None, kind)
    found = spread.stripes
    alike = types(found)
    way = 'along rows only' if found else 'along rows and columns'
    if kind not in makable():
        return Seen(f'colors change {way}, as those of {alike} do', None, kind)
    if own_stripes(kind) == found:
        return Seen(f'colors change {way}, as those of {kind} do', True, kind)
    return Seen(f'{kind} is set, but colors change {way}: the image looks like {alike}', False,
                kind)


def in_gray(kind):
    """Return what gray cameras make of a type of pattern, with advice, as text."""
    text = 'both cameras are gray: the brightness of the pattern is matched'
    if kind not in makable() or kind == FOR_GRAY:
        return text
    return (f'{text}, which is less precise than its colors; {FOR_GRAY} suits gray cameras '
            f'better than {kind}')


@dataclass(frozen=True)
class Steps:
    """How much chromaticities change over some pixels."""

    variance: float
    """Of the chromaticities of cells, sum over the channels."""
    of_pixels: float
    """The same of single pixels."""
    along_rows: float
    """Median change from column to column."""
    along_columns: float
    """Median change from row to row."""

    @property
    def stripes(self):
        """Return whether colors change along rows only."""
        return self.along_columns < STRIPES * self.along_rows


def steps(image):
    """Return the Steps of an image, uint8 (H, W, 3); None where too little is lit."""
    height, width = (count // CELL for count in image.shape[:2])
    if not (height and width):
        return None
    cells = cv2.resize(image[:height * CELL, :width * CELL], (width, height),
                       interpolation=cv2.INTER_AREA)
    color, lit = chromaticity(cells)
    if np.count_nonzero(lit) < LEAST_CELLS:
        return None
    pixels, bright = chromaticity(image[CELL // 2::CELL, CELL // 2::CELL])
    return Steps(variance(color, lit), variance(pixels, bright), change(color, lit),
                 change(color.swapaxes(0, 1), lit.swapaxes(0, 1)))


def chromaticity(image):
    """Return the chromaticities of an image, float32 (H, W, 3), and what is lit, bool (H, W)."""
    light = image.astype(np.float32)
    total = channel_sum(light)
    return light / np.maximum(total, 1)[..., None], total >= LEAST_LIGHT


def variance(color, lit):
    """Return the variance of the lit colors, sum over the channels."""
    return float(color[lit].var(axis=0).sum()) if lit.any() else 0.0


def change(color, lit):
    """Return the largest median step of colors, (h, w, 3), along the second axis."""
    largest = 0.0
    for lag in LAGS:
        both = lit[:, lag:] & lit[:, :-lag]
        if both.any():
            step = channel_sum(np.abs(color[:, lag:] - color[:, :-lag]))[both]
            largest = max(largest, float(np.median(step)))
    return largest


@lru_cache
def own_stripes(kind):
    """Return whether the colors of a type of pattern change along rows only."""
    found = steps(make_pattern(replace(REFERENCE, type=kind)))
    return found is not None and found.stripes


@lru_cache
def types(stripes):
    """Return the names of the types whose colors change so, as text."""
    *names, last = [kind for kind in makable() if own_stripes(kind) == stripes]
    return f'{", ".join(names)} or {last}' if names else last
