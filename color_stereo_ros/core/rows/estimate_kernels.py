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
"""Kernel of the rows: robust least squares of few coefficients."""

import numpy as np

from .tuning import TUNING
from ..compiled import part, serial

# Constants of `tuning`, compiled into the kernel.
HALF = TUNING.estimate.half
OUTLIER = TUNING.estimate.outlier
ITERATIONS = TUNING.estimate.iterations
CONVERGED = TUNING.estimate.converged


@part()
def solve_positive(matrix, target):
    """Solve matrix x = target, positive definite (n, n) and (n,); both are overwritten."""
    size = target.size
    for i in range(size):
        for j in range(i + 1):
            left = matrix[i, j]
            for k in range(j):
                left -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(left) if i == j else left / matrix[j, j]
        for k in range(i):
            target[i] -= matrix[i, k] * target[k]
        target[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            target[i] -= matrix[k, i] * target[k]
        target[i] /= matrix[i, i]


@serial()
def fit_robustly(there, dy, deviation, unseen, center, weight):
    """
    Fit coefficients by iteratively reweighted least squares with Cauchy weights.

    there, float64 (N, 7), are the terms; dy and deviation, float64 (N,), in px; unseen, float64
    (7, 7), is the information before anything is seen, px^-2. Overwrites center, float64 (7,):
    where to begin, and the coefficients, px; and weight, float64 (N,): the inverse variance of
    each dy as it counts, px^-2.

    """
    count, size = there.shape
    middle = count // 2  # of the upper median
    rest, apart = np.empty(count), np.empty(count)
    normal, target = np.empty((size, size)), np.empty(size)
    for turn in range(ITERATIONS):
        for n in range(count):
            rest[n] = dy[n]
            for i in range(size):
                rest[n] -= there[n, i] * center[i]
            apart[n] = abs(rest[n]) / deviation[n]
        if turn == 0:
            # begin with the median: the rows may be off by more than any cell is reliable for
            shift = np.partition(rest, middle)[middle]
            center[0] += shift
            for n in range(count):
                apart[n] = abs(rest[n] - shift) / deviation[n]
        scatter = np.partition(apart, middle)[middle] / HALF
        normal[:] = unseen
        target[:] = 0.0
        for n in range(count):
            spread, ratio = scatter * deviation[n], apart[n] / (OUTLIER * scatter)
            w = 1 / (spread * spread * (1 + ratio * ratio))
            weight[n] = w
            for i in range(size):
                part_of = w * there[n, i]
                target[i] += part_of * dy[n]
                for j in range(i + 1):
                    normal[i, j] += part_of * there[n, j]
        solve_positive(normal, target)
        change = 0.0
        for i in range(size):
            change = max(change, abs(target[i] - center[i]))
            center[i] = target[i]
        if change < CONVERGED:
            break
