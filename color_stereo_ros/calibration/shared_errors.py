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
What corners at one place of an image err alike in all views, and what it does to a calibration.

Noise averages away over thousands of corners. What the fit of a corner errs by because a lens
bends its edges, and because a mosaic is converted, comes again in every view. It is a smooth field
over the image. Without it the claims of a calibration from quiet images would be too brave.

"""

import numpy as np

from .views import SIDES

SIZE = 0.23  # px x px of image width, root mean square of either coordinate: edges bend less
#              per px in larger images; measured at 640 and 1280 px: docs/calibration.md
DEGREE = 3   # of the field in column and row; chosen, 4: claims change by 5 %


def shared_covariance(problem, equations, size, matrix):
    """
    Return what errors that all views share add to the covariance of the shared values.

    Parameters
    ----------
    problem : Problem
        Its corners and weights.
    equations : Equations
        Of the solution.
    size : (int, int)
        Width and height of the images, px.
    matrix : numpy.ndarray, float64, shape (k, k)
        Covariance of the shared values by what the corners claim: the same weights as those of
        the pulls, so that a common factor of all sigmas changes nothing.

    Returns
    -------
    covariance : numpy.ndarray, float64, shape (k, k)

    """
    moved = matrix @ problem.pulls(equations, _fields(problem, size))
    return (SIZE / max(size)) ** 2 * moved @ moved.T


def _fields(problem, size):
    """Return the terms of the fields of both cameras, dict of float64 (m, 2, f), px per SIZE."""
    terms = {side: smooth_terms(problem.corners[side].pixels, size) for side in SIDES}
    count = terms['left'].shape[1]
    fields = {side: np.zeros((len(here), 2, 4 * count)) for side, here in terms.items()}
    for index, (side, axis) in enumerate((side, axis) for side in SIDES for axis in (0, 1)):
        fields[side][:, axis, index * count:(index + 1) * count] = terms[side]
    return fields


def smooth_terms(pixels, size):
    """
    Return Legendre polynomials of column and row, up to `DEGREE` in all, float64 (m, f).

    With independent coefficients of standard deviation 1, the mean square over the image is 1.

    """
    u, v = (2 * pixels / np.array(size) - 1).T
    (by_u, by_v) = (np.polynomial.legendre.legvander(each, DEGREE)
                    * np.sqrt(2 * np.arange(DEGREE + 1) + 1) for each in (u, v))
    terms = np.stack([by_u[:, i] * by_v[:, j] for i in range(DEGREE + 1)
                      for j in range(DEGREE + 1 - i)], axis=1)
    return terms / np.sqrt(terms.shape[1])
