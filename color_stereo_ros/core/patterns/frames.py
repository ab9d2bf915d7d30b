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
"""What a projector shows instead of its pattern: even light and masks, for calibrations."""

from dataclasses import dataclass
from typing import Callable

import numpy as np

from .making import make_pattern
from ..registry import Registry

PATTERN = 'pattern'
MASK_CELL = 24
"""Width and height of the squares of the mask, px of the projector."""
_BRIGHT, _SEED = 255, 18
_DITHER = np.array([[0, 2], [3, 1]], np.uint8)  # in this order pixels become white


@dataclass(frozen=True)
class Frame:
    """One image that a projector shows; an entry of `FRAMES`."""

    summary: str
    """What it shows and what for."""
    make: Callable
    """PatternSettings in, uint8 out that broadcasts to (height, width, 3), RGB."""


def make_frame(name, settings):
    """
    Return what the projector must show for a frame.

    Parameters
    ----------
    name : str
        A name in `FRAMES`.
    settings : PatternSettings
        Size and pattern.

    Returns
    -------
    image : numpy.ndarray, uint8, shape (height, width, 3)
        RGB, linear light.

    Raises
    ------
    ColorStereoError
        For an unknown name, or a pattern that cannot be made.

    """
    frame = FRAMES[name].make(settings)
    shape = settings.height, settings.width, 3
    if frame.shape == shape:
        return frame
    image = np.empty(shape, np.uint8)
    image[...] = frame
    return image


def _even(*color):
    return lambda settings: np.array(color, np.uint8)


def _blank(settings):
    return np.rint(make_pattern(settings).mean(axis=(0, 1))).astype(np.uint8)


def _mask(settings):
    """
    Return squares of five brightnesses, made of black and white pixels, uint8 (h, w, 1).

    Within a square, 2 x 2 pixels repeat, of which none to all are white. Cameras blur these, so
    that they see brightnesses in between without steep edges.

    """
    shape = settings.height, settings.width
    rows, columns = (-(-count // MASK_CELL) for count in shape)
    cells = np.random.default_rng(_SEED).integers(0, _DITHER.size + 1, (rows, columns), np.uint8)
    share = np.repeat(np.repeat(cells, MASK_CELL, axis=0), MASK_CELL, axis=1)
    order = np.tile(_DITHER, (rows * MASK_CELL // 2, columns * MASK_CELL // 2))
    mask = np.where(share > order, np.uint8(_BRIGHT), np.uint8(0))
    return np.ascontiguousarray(mask[:shape[0], :shape[1], None])


FRAMES = Registry('frame', Frame, {
    PATTERN: Frame('the pattern', make_pattern),
    'blank': Frame('even light of the mean color of the pattern, for pairs without it', _blank),
    'white': Frame('full light', _even(_BRIGHT, _BRIGHT, _BRIGHT)),
    'black': Frame('no light', _even(0, 0, 0)),
    'red': Frame('full light of one channel', _even(_BRIGHT, 0, 0)),
    'green': Frame('full light of one channel', _even(0, _BRIGHT, 0)),
    'blue': Frame('full light of one channel', _even(0, 0, _BRIGHT)),
    'mask': Frame('squares of black, white and both in turn', _mask),
    'complement': Frame('the mask with black and white exchanged',
                        lambda settings: _BRIGHT - _mask(settings)),
})
"""Frame by name: the choices of `pattern.frame`."""
