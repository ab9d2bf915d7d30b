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
The row alignment as a value: by how much the rows of the two views disagree over the image.

What the left view shows in row y, the right view shows in row y + r(x, y), where x and y are the
column and the row of the rectified right image that should show it. r is a sum of seven terms:

    r = c0 + c1 u + c2 v + c3 u u + c4 u v + c5 v v + c6 v (u u + v v)

u and v are x and y from the center of the image, in half widths of it. c0 is an offset, c1 a
roll of one camera about its axis, c2 a difference of the scales. A pitch adds c5, a yaw c4, and an
error of the radial distortion c6.

"""

from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .tuning import TUNING
from ..arrays import Doubles, Size
from ..frozen import constant_array

NAMES = 'offset', 'roll', 'scale', 'x x', 'x y', 'y y', 'radial'
COUNT = len(NAMES)
TURNS = TUNING.estimate.turns
"""A pair is asked a share of its cells only: the errors of a cell come again in the next pair."""
PLACES = (('top left', 'top', 'top right'), ('left', 'center', 'right'),
          ('bottom left', 'bottom', 'bottom right'))


def terms(x, y, size):
    """
    Return the seven terms of the row error at some places.

    Parameters
    ----------
    x, y : numpy.ndarray
        Column and row in the rectified right image, px; they broadcast.
    size : (int, int)
        Width and height of the image, px.

    Returns
    -------
    terms : numpy.ndarray, float64, shape (..., 7)

    """
    width, height = size
    half = width / 2
    u = (np.asarray(x, np.float64) - (width - 1) / 2) / half
    v = (np.asarray(y, np.float64) - (height - 1) / 2) / half
    squares = u * u + v * v
    found = np.empty((*squares.shape, COUNT))
    for at, values in enumerate((1, u, v, u * u, u * v, v * v, v * squares)):
        found[..., at] = values
    return found


@dataclass(frozen=True, eq=False)
class RowEvidence:
    """Where the rows were compared; a cell of matched nodes, or one match of the search, each."""

    x: np.ndarray
    """float32 (N,), column in the rectified right image, px."""
    y: np.ndarray
    """float32 (N,), row, px."""
    dy: np.ndarray
    """float32 (N,), row in the right image minus row in the left image, px."""
    sigma: np.ndarray
    """float32 (N,), standard deviation of dy, px; outliers have a larger one."""
    disparity: np.ndarray
    """float32 (N,), px: rows that disagree more where disparities are larger tell of a shift."""

    def __post_init__(self):
        """Keep the arrays from being written."""
        for name, values in vars(self).items():
            values = np.array(values, np.float32)
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @classmethod
    def none(cls) -> Self:
        """Return that nothing was compared."""
        return cls(*np.zeros((5, 0), np.float32))


@dataclass(frozen=True, eq=False)
class Alignment:
    """
    By how much the rows of the right view lie off those of the left one; immutable.

    `ColorStereo.process` returns it in `RangeResult.alignment` and takes it for the next pair.

    """

    size: Size
    """Width and height of the rectified images, px."""
    coefficients: Doubles
    """float64 (7,), px, of the terms `NAMES`; see `terms`."""
    covariance: Doubles
    """float64 (7, 7), px^2, of the coefficients."""
    applied: Doubles
    """float64 (7,), px: by these the rows of the right view were corrected in this pair."""
    observable: bool = False
    """Whether the pattern of this pair shows rows; a sweep along them does not."""
    agreeing: bool = False
    """Whether the views of this pair agree at their matches once the rows are corrected."""
    misfit: float = float('nan')
    """Median misfit of the cells of this pair, about 1 where the views agree; inf: no matches."""
    scatter: float = float('nan')
    """Of the cells of this pair around the coefficients that it shows alone, px; robust."""
    searched: str = ''
    """What a search has found that cannot be corrected, as a sentence; '' if nothing."""
    evidence: RowEvidence = field(default_factory=RowEvidence.none)
    wait: int = 0
    """Pairs that do not agree before the next search."""
    tries: int = 0
    """Searches without success since the views agreed."""
    turn: int = 0
    """Which cells this pair was asked; the next pair is asked the next ones, see `next_turn`."""

    def __post_init__(self):
        """Keep the arrays from being written."""
        for name in ('coefficients', 'covariance', 'applied'):
            object.__setattr__(self, name, constant_array(getattr(self, name)))

    @classmethod
    def unknown(cls, size: Size) -> Self:
        """Return what is known before the first pair: rows may disagree by any amount."""
        spread = np.square(TUNING.estimate.prior_std)
        return cls(tuple(size), np.zeros(COUNT), np.diag(spread), np.zeros(COUNT))

    def next_turn(self) -> int:
        """Return which cells the next pair is asked: all were asked after TURNS pairs."""
        return (self.turn + 1) % TURNS

    @property
    def std(self) -> Doubles:
        """Return the standard deviations of the coefficients, float64 (7,), px."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def due(self) -> bool:
        """Return whether a search from nothing may help: the views do not agree as they are."""
        return not self.agreeing and self.wait == 0

    @property
    def known(self) -> bool:
        """Return whether any pair has shown the rows so far."""
        return bool(self.covariance[0, 0] < TUNING.estimate.vague ** 2)

    def error(self, x: ArrayLike, y: ArrayLike) -> Doubles:
        """Return the row error at places in the right image, float64, px; see `terms`."""
        return terms(x, y, self.size) @ self.coefficients

    def error_std(self, x: ArrayLike, y: ArrayLike) -> Doubles:
        """Return the standard deviation of `error`, float64, px."""
        there = terms(x, y, self.size)
        return np.sqrt(np.einsum('...i,ij,...j', there, self.covariance, there))

    def rest(self, x: ArrayLike, y: ArrayLike) -> Doubles:
        """Return the row error that was left in this pair, float64, px."""
        return terms(x, y, self.size) @ (self.coefficients - self.applied)

    def largest(self) -> tuple[float, str]:
        """
        Return the largest known row error of the image and where it is.

        Returns
        -------
        error : float
            px; 0 if nothing is known.
        place : str
            Such as 'bottom right'.

        """
        width, height = self.size
        x, y = np.meshgrid((np.arange(3) + 0.5) / 3 * width, (np.arange(3) + 0.5) / 3 * height)
        errors, spread = self.error(x, y), self.error_std(x, y)
        errors[~(spread < np.maximum(TUNING.estimate.useful, np.abs(errors) / 4))] = 0
        at = np.unravel_index(np.argmax(np.abs(errors)), errors.shape)
        return float(errors[at]), PLACES[at[0]][at[1]]

    def sentence(self) -> str:
        """Return what people should know of the rows, as one sentence; '' if nothing."""
        if self.searched:
            return self.searched
        error, place = self.largest()
        if abs(error) < TUNING.use.told:
            return ''
        return (f'rows differ by {abs(error):.1f} px ({place}): calibration or mounting has '
                'changed')

    def but(self, **changes: Any) -> 'Alignment':
        """Return this alignment with some fields replaced."""
        return replace(self, **changes)
