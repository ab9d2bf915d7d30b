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
"""How exact a calibration is once it was corrected by a drift."""

from dataclasses import dataclass

import numpy as np

from .drift import corrected, COUNT
from .prior import drift_by_parameters
from .tracking import covariance_of
from .tuning import TUNING
from ..cameras.covariance import StereoCovariance
from ..cameras.parameters import StereoParameters
from ...errors import CalibrationError


@dataclass(frozen=True, eq=False)
class KnownDrift:
    """What pairs have shown of the drift of a calibration."""

    drift: np.ndarray
    """float64 (6,), see `drift.NAMES`."""
    covariance: np.ndarray
    """float64 (6, 6), of the drift."""
    prior_std: np.ndarray
    """float64 (6,), standard deviations before any pair, as the calibration knows the drift."""
    knocked: bool
    """Whether the cameras have moved, and not only the calibration is not exact."""

    @classmethod
    def of(cls, health):
        """Return that of a Health."""
        return cls(health.drift, health.covariance, np.sqrt(np.diag(health.prior)),
                   health.knocked)


def corrected_covariance(calibration, covariance, known):
    """
    Return the covariance of a calibration that was corrected by a drift.

    What is unknown before the pairs are the errors e of the calibration, covariance C, and the
    motion k of a knock, covariance K. The pairs see their sum as a drift only, d = L e + k, with
    the covariance D = L C L' + K before and P after them. The drift moves the parameters by J:

        G = (C L' + J K) D^-1                     what a drift tells of the parameters
        C' = C + J K J' - G (D - P) G' + b b'     b = (G - J) d

    b is what the best estimate of all parameters has beside the correction, which turns the
    right camera and changes its focal length only; after a knock it is nearly 0.

    Parameters
    ----------
    calibration : StereoCalibration
        Before the correction.
    covariance : StereoCovariance
        Of `calibration`.
    known : KnownDrift
        What the pairs tell of the drift.

    Returns
    -------
    covariance : StereoCovariance
        Of `corrected(calibration, known.drift)`.

    Raises
    ------
    CalibrationError
        If the covariance belongs to another calibration, or the drift was measured without it.

    """
    images = drift_by_parameters(calibration, covariance)
    errors, spread = covariance.matrix, TUNING.prior.least_std ** 2 * np.eye(COUNT)
    own = images @ errors @ images.T + spread
    _check_prior(known, np.sqrt(np.diag(own)))
    knock = covariance_of(TUNING.estimate.knocked_std) if known.knocked else 0 * own
    moves = parameters_by_drift(calibration, known.drift)
    # what least_std adds to the drift is a motion, as a knock is
    knock = knock + spread
    before = own - spread + knock
    tells = np.linalg.solve(before, (errors @ images.T + moves @ knock).T).T
    beside = (tells - moves) @ known.drift
    matrix = (errors + moves @ knock @ moves.T
              - tells @ (before - known.covariance) @ tells.T + np.outer(beside, beside))
    return StereoCovariance.of(corrected(calibration, known.drift), (matrix + matrix.T) / 2)


def parameters_by_drift(calibration, drift):
    """Return how `StereoParameters.vector` moves with a drift about one, float64 (n, 6)."""
    small = TUNING.prior.step
    ends = [[StereoParameters.from_calibration(corrected(calibration, drift + sign * step)).vector
             for sign in (1, -1)] for step in small * np.eye(COUNT)]
    return np.column_stack([(ahead - behind) / (2 * small) for ahead, behind in ends])


def _check_prior(known, std):
    """Refuse a drift that was measured with another idea of how exact the calibration is."""
    if not np.allclose(known.prior_std, std, rtol=TUNING.prior.same, atol=0):
        raise CalibrationError(
            'the drift was measured with another covariance of the calibration, or without one; '
            'measure with health.covariance set to this file')
