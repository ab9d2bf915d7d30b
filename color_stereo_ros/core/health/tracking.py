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
"""From pair to pair: the drift that row evidence and calibration show together."""

from functools import lru_cache

import numpy as np

from .drift import corrected, COUNT, expected_fields, PhysicalRight, row_errors, SHOWN
from .health import Health
from .tuning import TUNING
from ..rows.alignment import COUNT as TERMS, terms


class HealthTracker:
    """
    Follows the drift of one calibrated pair.

    It holds no state of the pairs: a Health is given and returned.

    Parameters
    ----------
    calibration : StereoCalibration
    rectified_input : bool
        The images arrive rectified: only P of the calibration counts.
    prior : array-like, shape (6, 6), optional
        Covariance of the drift as the calibration knows it, see `drift.NAMES`. Default: that of
        a good calibration, `estimate.calibrated_std`.

    """

    def __init__(self, calibration, rectified_input=False, prior=None):
        self.calibration, self.rectified_input = calibration, rectified_input
        self.camera = PhysicalRight.of(calibration, rectified_input)
        if prior is None:
            prior = covariance_of(TUNING.estimate.calibrated_std)
        self.prior = np.array(prior, np.float64)
        self._corrected = lru_cache(maxsize=2)(self._make_corrected)

    def unknown(self):
        """Return the Health before the first pair."""
        return Health.unknown(self.prior)

    def follow(self, health, alignment):
        """
        Bring a Health up to date after a pair.

        One pair of some is used; the others cost nothing.

        Parameters
        ----------
        health : Health
            `applied` is what the maps of the pair were corrected by.
        alignment : Alignment or None
            Of the pair; None: its rows were not measured.

        Returns
        -------
        health : Health

        """
        tuning = TUNING.estimate
        if alignment is None:
            return health.but(observable=False, age=health.age + 1)
        seen = alignment.observable
        if not (seen and alignment.agreeing and len(alignment.evidence.x)):
            return health.but(observable=seen, age=health.age + 1)
        if health.pairs >= tuning.first and health.age + 1 < tuning.every:
            return health.but(observable=True, age=health.age + 1)
        return self._updated(health, Rows(self, health, alignment), alignment.turn)

    def camera_of(self, applied):
        """Return the PhysicalRight whose maps are corrected by a drift (6,)."""
        return self._corrected(applied.tobytes())

    def _make_corrected(self, applied):
        applied = np.frombuffer(applied)
        if self.rectified_input or not applied.any():
            return self.camera
        return PhysicalRight.of(corrected(self.calibration, applied, baseline=False))

    def _updated(self, health, rows, turn):
        pairs = health.pairs
        information, pull = health.information.copy(), health.pull.copy()
        if pairs and rows.apart(health.drift) > TUNING.estimate.bump:
            information[:], pull[:], pairs = 0, 0, 0
        drift, knock = health.drift, False
        for _ in range(TUNING.estimate.iterations):
            information[turn], pull[turn] = rows.normal(drift)
            total, right = information.sum(axis=0), pull.sum(axis=0)
            knock = is_knock(total, right, self.prior)
            before = self.prior + knock * covariance_of(TUNING.estimate.knocked_std)
            found, covariance = posterior(total, right, before)
            step = rows.step(found - drift)
            drift = found
            if step < TUNING.estimate.settled:
                break
        return self.judged(health.but(
            drift=drift, covariance=covariance, information=information, pull=pull,
            knocked=knock, observable=True, pairs=pairs + 1, age=0), rows.disparity)

    def judged(self, health, disparity):
        """Return a Health that says what its drift does at a working disparity, px."""
        geometry = self.calibration.geometry
        rows, columns = self.fields(disparity)
        values = {}
        for name, field in (('rows', rows), ('disparity', columns)):
            values[name] = mean_square(field @ health.drift)
            values[f'{name}_std'] = float(np.sqrt(
                np.einsum('ni,ij,nj->', field, health.covariance, field) / len(field)))
        depth = geometry.focal_baseline / (disparity - geometry.principal_offset)
        # dZ/dd = Z^2 / (f B)
        per_pixel = depth * depth / geometry.focal_baseline
        return health.but(**values, distance=depth, depth=per_pixel * values['disparity'],
                          depth_std=per_pixel * values['disparity_std'])

    def fields(self, disparity):
        """Return `drift.expected_fields` all over the image at one disparity, px."""
        geometry, count = self.calibration.geometry, TUNING.use.grid
        x, y = np.meshgrid(np.linspace(0, geometry.width - 1, count),
                           np.linspace(0, geometry.height - 1, count))
        return expected_fields(self.calibration, x.ravel(), y.ravel(),
                               np.full(x.size, float(disparity)), self.rectified_input)

    def to_apply(self, health):
        """
        Return the drift by which the maps of the next pair are to be corrected.

        Parameters
        ----------
        health : Health
            What is known of the drift.

        Returns
        -------
        applied : numpy.ndarray, float64, shape (6,)
            Without the direction of the baseline: the frame of the results stays. Exactly that
            of the health where nearly nothing would change; 0 where nothing has drifted, or too
            far.

        """
        if self.rectified_input or not health.correctable:
            return np.zeros(COUNT)
        if not (health.drifted or health.is_applied):
            return health.applied
        wanted = health.drift.copy()
        wanted[4:] = 0
        geometry, use = self.calibration.geometry, TUNING.use
        disparity = geometry.focal_baseline / health.distance + geometry.principal_offset
        for field, spread in zip(self.fields(disparity),
                                 (health.rows_std, health.disparity_std)):
            change = mean_square(field @ (wanted - health.applied))
            if change > max(use.least_change, use.worth * spread):
                return wanted
        return health.applied


class Rows:
    """
    The row evidence of one pair in terms of the drift.

    Parameters
    ----------
    tracker : HealthTracker
    health : Health
    alignment : Alignment

    """

    def __init__(self, tracker, health, alignment):
        evidence, geometry = alignment.evidence, tracker.calibration.geometry
        step = len(evidence.x) // TUNING.estimate.samples + 1
        x, y, dy, sigma, disparity = (
            getattr(evidence, name)[::step].astype(np.float64)
            for name in ('x', 'y', 'dy', 'sigma', 'disparity'))
        self.tracker, self.focal = tracker, geometry.focal_y
        self.disparity = float(np.median(disparity))
        self.weight = sigma ** -2
        self.bias = terms(x, y, alignment.size)
        self.left = np.column_stack([(x + disparity - geometry.center_x_left) / geometry.focal_x,
                                     (y - geometry.center_y) / geometry.focal_y])
        right = np.column_stack([(x - geometry.center_x_right) / geometry.focal_x,
                                 (y + dy - geometry.center_y) / geometry.focal_y])
        self.raw = tracker.camera_of(health.applied).raw(right)
        self._by_drift = None

    def errors(self, drift):
        """Return what `row_errors` does."""
        return row_errors(drift, self.tracker.camera, self.raw, self.left, self.focal)

    def normal(self, drift):
        """Return information (13, 13) and pull (13,) of drift and bias, linear about a drift."""
        error, self._by_drift = self.errors(drift)
        rows = np.column_stack([self._by_drift, self.bias])
        weighted = rows * self.weight[:, None]
        return weighted.T @ rows, weighted.T @ (self._by_drift @ drift - error)

    def step(self, change):
        """Return what a change of the drift does to the rows, root mean square, px."""
        return mean_square(self._by_drift @ change)

    def apart(self, drift):
        """Return by how much the smooth row errors differ from a drift, root mean square, px."""
        error = self.errors(drift)[0]
        weighted = self.bias * self.weight[:, None]
        normal = weighted.T @ self.bias + np.eye(self.bias.shape[1])
        return mean_square(self.bias @ np.linalg.solve(normal, weighted.T @ error))


def mean_square(values):
    """Return the root mean square, a float."""
    return float(np.sqrt(np.mean(np.square(values))))


def covariance_of(shown):
    """Return the covariance (6, 6) of standard deviations in degrees and percent."""
    return np.diag(np.square(np.asarray(shown) / SHOWN))


def with_bias(covariance):
    """Return the covariance (13, 13) of drift and bias, neither of which knows the other."""
    joint = np.eye(COUNT + TERMS) * TUNING.estimate.bias_std ** 2
    joint[:COUNT, :COUNT] = covariance
    return joint


def posterior(information, pull, covariance):
    """
    Return the drift that evidence and a prior around 0 show together.

    Parameters
    ----------
    information : numpy.ndarray, float64, shape (13, 13)
        Of drift and row terms of the scene.
    pull : numpy.ndarray, float64, shape (13,)
        Information times what it is about.
    covariance : numpy.ndarray, float64, shape (6, 6)
        Of the prior.

    Returns
    -------
    drift : numpy.ndarray, float64, shape (6,)
    covariance : numpy.ndarray, float64, shape (6, 6)

    """
    after = np.linalg.inv(np.linalg.inv(with_bias(covariance)) + information)
    return (after @ pull)[:COUNT], after[:COUNT, :COUNT]


def evidence_for(information, pull, covariance):
    """Return the logarithm of the likelihood of the evidence under a prior around 0."""
    # Woodbury: data with covariance N + A P A' of which only A' N^-1 A and A' N^-1 y are kept
    prior = with_bias(covariance)
    spread = np.eye(len(prior)) + prior @ information
    return 0.5 * (pull @ np.linalg.solve(spread, prior @ pull) - np.linalg.slogdet(spread)[1])


def is_knock(information, pull, prior):
    """Return whether a knock explains the evidence far better than the calibration does."""
    wide = prior + covariance_of(TUNING.estimate.knocked_std)
    gain = evidence_for(information, pull, wide) - evidence_for(information, pull, prior)
    return bool(gain > TUNING.estimate.knock_odds)
