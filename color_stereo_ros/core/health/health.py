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
"""The health of a calibration as a value: what is known of its drift, and what that does."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from .drift import COUNT, NAMES, SHOWN, UNITS
from .tuning import TUNING
from ..arrays import Doubles, Mask
from ..frozen import constant_array
from ..rows.alignment import COUNT as TERMS, TURNS

MILLIMETERS = 1000
BLIND = 'drift of the calibration: not observable with this pattern, which shows no rows'


@dataclass(frozen=True, eq=False)
class Health:
    """
    What is known of the drift between the cameras since they were calibrated; immutable.

    `ColorStereo.process` returns it in `RangeResult.health` and takes it for the next pair.

    """

    prior: Doubles
    """float64 (6, 6), covariance of the numbers of the drift as the calibration knows them."""
    drift: Doubles
    """float64 (6,), see `drift.NAMES`: rad, relative for the focal length."""
    covariance: Doubles
    """float64 (6, 6), of the drift."""
    applied: Doubles
    """float64 (6,): by this drift the maps of this pair were corrected; 0: as calibrated."""
    information: Doubles
    """
    float64 (4, 13, 13), of the drift and of seven row terms of the scene, from rows alone.

    One for each turn of cells, of the last pair that was asked them.
    """
    pull: Doubles
    """float64 (4, 13), information times what it is about."""
    knocked: bool = False
    """Whether the cameras have moved, and not only the calibration is not exact."""
    observable: bool = False
    """Whether the pattern of the last pair shows rows; a sweep along them does not."""
    pairs: int = 0
    """Pairs that were used since the start or the last knock."""
    age: int = 0
    """Pairs since the drift was brought up to date."""
    rows: float = 0.0
    """By how much rows differ, root mean square over the image at the working distance, px."""
    rows_std: float = float('inf')
    """Its standard deviation, px."""
    disparity: float = 0.0
    """By how much disparities are wrong, root mean square, px."""
    disparity_std: float = float('inf')
    """Its standard deviation, px."""
    depth: float = 0.0
    """The same of the depth at the working distance, m."""
    depth_std: float = float('inf')
    """Its standard deviation, m."""
    distance: float = float('nan')
    """The working distance: median depth of the evidence, m; NaN: there was none."""

    def __post_init__(self):
        """Keep the arrays from being written."""
        for name in ('prior', 'drift', 'covariance', 'applied', 'information', 'pull'):
            object.__setattr__(self, name, constant_array(getattr(self, name)))

    @classmethod
    def unknown(cls, prior: Doubles) -> Self:
        """Return what is known before the first pair; prior: float64 (6, 6), a covariance."""
        size = COUNT + TERMS
        return cls(prior, np.zeros(COUNT), prior, np.zeros(COUNT),
                   np.zeros((TURNS, size, size)), np.zeros((TURNS, size)))

    @property
    def std(self) -> Doubles:
        """Return the standard deviations of the drift, float64 (6,), in its units."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def known(self) -> Mask:
        """Return which numbers of the drift the pairs tell, bool (6,)."""
        before = np.square(np.asarray(TUNING.estimate.knocked_std) / SHOWN)
        return np.diag(self.covariance) < TUNING.use.known ** 2 * (
            before + np.diag(self.prior))

    @property
    def drifted(self) -> bool:
        """Return whether rows or depth have drifted by more than is worth telling."""
        use = TUNING.use
        return any(
            value > max(told, use.sure * spread) for value, told, spread in (
                (self.rows, use.told_rows, self.rows_std),
                (self.disparity, use.told_disparity, self.disparity_std)))

    @property
    def correctable(self) -> bool:
        """Return whether the drift is small enough to be corrected."""
        return bool((np.abs(self.drift[:4] * SHOWN[:4]) <= TUNING.use.largest).all())

    @property
    def is_applied(self) -> bool:
        """Return whether the maps of this pair were corrected."""
        return bool(self.applied.any())

    def numbers(self) -> dict[str, tuple[float, float, str]]:
        """
        Return the drift for people.

        Returns
        -------
        numbers : dict
            Names to (value, standard deviation, unit), degrees and percent.

        """
        return {name: (float(value), float(spread), unit) for name, value, spread, unit in
                zip(NAMES, self.drift * SHOWN, self.std * SHOWN, UNITS)}

    def sentence(self) -> str:
        """Return what people should know of the calibration, as one sentence."""
        if not self.pairs:
            return 'drift of the calibration: unknown yet' if self.observable else BLIND
        text = (f'rows {self.rows:.2f} +- {self.rows_std:.2f} px, depth '
                f'{self.depth * MILLIMETERS:.2f} +- {self.depth_std * MILLIMETERS:.2f} mm at '
                f'{self.distance:.2f} m')
        if not self.drifted:
            return f'the calibration holds: {text}'
        if not self.correctable:
            return (f'the cameras have moved too far to be corrected: {text}; calibrate them '
                    'again')
        return f'the cameras have moved: {text}' + (' (corrected)' if self.is_applied else (
            '; correct it by health.correct: apply, or by color_stereo calibrate update'))

    def but(self, **changes: Any) -> 'Health':
        """Return this health with some fields replaced."""
        return replace(self, **changes)
