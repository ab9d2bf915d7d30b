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
"""The fusion of several pairs, pixel by pixel in plain Python: the twin of core/fusion.py."""

import math
from statistics import median


def clusters_of(values):
    """Return two lists of (disparity, std, confidence) that agree, in the order of arrival."""
    clusters = [], []
    for value in values:
        disparity, std, _ = value
        for cluster in clusters:
            if not cluster or abs(disparity - mean_of(cluster)) <= max(1.0, 4.0 * std):
                cluster.append(value)
                break
    return clusters


def mean_of(cluster):
    """Return the mean weighted by 1 / variance."""
    weights = [1 / std ** 2 for _, std, _ in cluster]
    return sum(weight * value[0] for weight, value in zip(weights, cluster)) / sum(weights)


def scatter_of(cluster):
    """Return the sum of squares over variances."""
    mean = mean_of(cluster)
    return sum((disparity - mean) ** 2 / std ** 2 for disparity, std, _ in cluster)


def noise_share(pixels):
    """Return the share of the variance that differs between pairs; pixels: lists of values."""
    ratios = []
    for values in pixels:
        freedom = len(values) - 1
        if freedom > 0:
            change = sum((after[0] - before[0]) ** 2 / after[1] ** 2 / 2
                         for before, after in zip(values, values[1:]))
            ratios.append(change / freedom / (1 - 2 / (9 * freedom)) ** 3)
    return min(median(ratios), 0.9) if ratios else 0.9


def fuse(values, pairs, noise):
    """
    Return (disparity, std, confidence) of a pixel, or None, and whether it may have moved.

    values: those of the pairs that have one, as (disparity, std, confidence).

    """
    if not values:
        return None, False
    one, two = clusters_of(values)
    chosen, other = (two, one) if len(two) > len(one) else (one, two)
    count = len(chosen)
    suspect = (len(other) >= 0.25 * pairs or 2 * count < pairs
               or scatter_of(chosen) > 9.0 * max(count - 1, 1))
    suspect = suspect and 2 * len(values) >= pairs
    if 2 * count < pairs:
        return None, suspect
    weight = sum(1 / std ** 2 for _, std, _ in chosen)
    std = math.sqrt(count / weight * (1 - noise + noise / count))
    confidence = sum(value[2] for value in chosen) / pairs
    return (mean_of(chosen), std, confidence), suspect
