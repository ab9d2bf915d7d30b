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
"""How the colors of the pattern look in the left image."""

import cv2
import numpy as np

from .tuning import TUNING

TINY = np.finfo(np.float64).tiny


def color_map(model, measured, pattern, evidence):
    """
    Fit the map from the colors of the pattern to those of the image.

    Chromaticities are shares of R, G and B in their sum: they do not depend on the light.

    Parameters
    ----------
    model : ProjectorModel
        Geometry of the projector.
    measured : Measured
        What two views have measured.
    pattern : numpy.ndarray, uint8, shape (H', W', 3)
        The image that the projector shows, RGB.
    evidence : Evidence
        Where the patches of the pattern were found.

    Returns
    -------
    matrix : numpy.ndarray, float64, shape (3, 4)
        See `ProjectorModel.color_map`.
    quality : float
        Share of the variance of the image's colors that the map explains.

    """
    g = measured.geometry
    points = evidence.points
    pixels = np.column_stack([points[:, 0] / points[:, 2] * g.focal_x + g.center_x_left,
                              points[:, 1] / points[:, 2] * g.focal_y + g.center_y])
    seen = _shares(measured.image, pixels)
    shown = _shares(pattern, np.column_stack(model.project(points)))
    known = np.column_stack([shown, np.ones(len(shown))])
    good = np.isfinite(seen).all(axis=1) & np.isfinite(known).all(axis=1)
    for _ in range(TUNING.color.rounds):
        matrix = np.linalg.lstsq(known[good], seen[good], rcond=None)[0]
        error = np.linalg.norm(seen - known @ matrix, axis=1)
        good = error < TUNING.color.outlier * np.median(error[good]) + TINY
    left = np.sum((seen - known @ matrix)[good] ** 2)
    total = np.sum((seen[good] - seen[good].mean(axis=0)) ** 2)
    return matrix.T, float(1 - left / max(total, TINY))


def _shares(image, places):
    """Return the shares of R, G and B at some places, float64 (N, 3); NaN outside and in black."""
    smooth = cv2.GaussianBlur(image, (0, 0), TUNING.color.blur)
    x, y = np.rint(np.nan_to_num(places, nan=-1)).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < image.shape[1]) & (y < image.shape[0])
    colors = np.full((len(places), 3), np.nan)
    colors[inside] = smooth[y[inside], x[inside]]
    total = colors.sum(axis=1, keepdims=True)
    return np.where(total > 0, colors / np.maximum(total, 1), np.nan)
