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
The response of a camera without a series of exposures: light adds up.

A mask and its complement together give the light of white, and the light of black once more:

    f(mask) + f(complement) = f(white) + f(black)

at every pixel, whatever the projector does to numbers between black and white. f is that of
`core.color_calibration.linear`. It is found by Gauss-Newton with a robust weight.

"""

from dataclasses import dataclass

import numpy as np

from ..core.color_calibration import linear
from ..core.constants import ROBUST_STD
from ..errors import CalibrationError

_LIMITS = np.array([[0.3, 4.0], [0.0, 0.5]])  # of gamma and offset
_STEP = np.array([1e-3, 1e-4])
_ROUNDS = 60
_CAUCHY = 2.4  # times the scale of the residuals
_PRIOR = 2e-5
"""Weight of the offset beside the residuals: without evidence, at a gamma of 1, it stays at 0."""
_STARTS = 0.45, 1.0, 2.2
MOST_SAMPLES = 60_000
_LEAST_SAMPLES = 500
_BETWEEN = 0.1, 0.9
_LEAST_BETWEEN = 0.05


@dataclass(frozen=True)
class Response:
    """What was found of a response, and how well it explains the images."""

    gamma: float
    offset: float
    """As in `CameraColor`."""
    error: float
    """Root mean square of the residuals, share of white."""
    linear_error: float
    """The same for a linear response."""


def fit_response(mask, complement, white, black):
    """
    Return the Response that makes light add up.

    Parameters
    ----------
    mask, complement, white, black : numpy.ndarray, float64, shape (N,)
        Levels of the same pixels above the dark level, share of full scale.

    Raises
    ------
    CalibrationError
        If too few pixels say anything: all are black or white.

    """
    if len(white) > MOST_SAMPLES:
        chosen = np.random.default_rng(0).choice(len(white), MOST_SAMPLES, replace=False)
        mask, complement, white, black = (each[chosen] for each in
                                          (mask, complement, white, black))
    share = (mask - black) / np.maximum(white - black, 1e-6)
    between = np.count_nonzero((share > _BETWEEN[0]) & (share < _BETWEEN[1]))
    if between < max(_LEAST_SAMPLES, _LEAST_BETWEEN * len(white)):
        raise CalibrationError(
            f'{between} of {len(white)} pixels of the mask lie between black and white, too few '
            'to find the response; was the mask projected pixel by pixel?')
    levels = mask, complement, white, black
    found = min((_descended(np.array([start, 0.0]), levels) for start in _STARTS),
                key=lambda point: robust_cost(residuals(point, levels)))
    return Response(float(found[0]), float(found[1]), _rms(residuals(found, levels)),
                    _rms(residuals(np.array([1.0, 0.0]), levels)))


def residuals(point, levels):
    """Return by which share of white the light does not add up, float64 (N,)."""
    mask, complement, white, black = (linear(level, *point) for level in levels)
    return (mask + complement - black) / white - 1


def robust_cost(errors):
    """Return the mean of errors beyond which more error costs little (Cauchy)."""
    scale = _CAUCHY * 0.02
    return float(np.log1p((errors / scale) ** 2).mean())


def _descended(point, levels):
    """Return gamma and offset where Gauss-Newton ends."""
    for _ in range(_ROUNDS):
        errors = residuals(point, levels)
        slopes = np.stack([(residuals(point + step, levels) - errors) / step.sum()
                           for step in np.diag(_STEP)], axis=1)
        spread = ROBUST_STD * np.median(np.abs(errors - np.median(errors))) + 1e-4
        weight = 1 / (1 + (errors / (_CAUCHY * spread)) ** 2)
        normal = (slopes * weight[:, None]).T @ slopes
        normal[1, 1] += weight.sum() * _PRIOR
        target = (slopes * weight[:, None]).T @ errors
        target[1] += weight.sum() * _PRIOR * point[1]
        move = -np.linalg.solve(normal, target)
        moved = np.clip(point + np.clip(move, -0.3, 0.3), *_LIMITS.T)
        if np.abs(moved - point).max() < 1e-5:
            return moved
        point = moved
    return point


def _rms(errors):
    """Return the root mean square of the central 98 % of errors."""
    low, high = np.percentile(errors, (1, 99))
    return float(np.sqrt(np.mean(np.clip(errors, low, high) ** 2)))
