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
"""What a calibration with covariance knows of the six numbers of the drift."""

import numpy as np

from .drift import COUNT, expected_fields
from .tuning import TUNING
from ..cameras.covariance import rectified_derivatives


def drift_covariance(calibration, covariance):
    """
    Return the covariance of the drift that the errors of a calibration look like.

    All parameters of both cameras count: an error of a principal point looks like a turn. Each
    parameter moves rows and disparities of a volume; the six numbers of the drift that explain
    this best are its image. What scales all disparities, as the length of the baseline does, is
    no drift.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    covariance : StereoCovariance
        How exact the calibration is.

    Returns
    -------
    covariance : numpy.ndarray, float64, shape (6, 6)
        See `drift.NAMES`.

    Raises
    ------
    CalibrationError
        If the covariance belongs to another calibration.

    """
    images = drift_by_parameters(calibration, covariance)
    return images @ covariance.matrix @ images.T + np.eye(COUNT) * TUNING.prior.least_std ** 2


def drift_by_parameters(calibration, covariance):
    """
    Return which drift the errors of each parameter look like.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    covariance : StereoCovariance
        How exact the calibration is.

    Returns
    -------
    images : numpy.ndarray, float64, shape (6, n)
        Drift per unit of true minus calibrated parameters.

    Raises
    ------
    CalibrationError
        If the covariance belongs to another calibration.

    """
    covariance.check(calibration)
    tuning, geometry = TUNING.prior, calibration.geometry
    x, y, depth = (each.ravel() for each in np.meshgrid(
        np.linspace(0, geometry.width - 1, tuning.grid),
        np.linspace(0, geometry.height - 1, tuning.grid),
        geometry.baseline * np.array(tuning.depths), indexing='ij'))
    rows, disparities = rectified_derivatives(calibration, x, y, depth)
    known = np.isfinite(rows).all(axis=1) & np.isfinite(disparities).all(axis=1)
    x, y, shift = x[known], y[known], geometry.focal_baseline / depth[known]
    by_drift = expected_fields(calibration, x, y, shift + geometry.principal_offset)
    scale = np.concatenate([np.zeros_like(shift), shift])
    fields = np.column_stack([np.concatenate(by_drift), scale])
    return np.linalg.lstsq(
        fields, np.concatenate([-rows[known], disparities[known]]), rcond=None)[0][:COUNT]
