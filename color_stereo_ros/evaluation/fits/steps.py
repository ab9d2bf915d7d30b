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
"""Fit what log-odds lose beside steps of the disparity (models/steps.yaml)."""

import numpy as np

from . import disturbed
from .nodes import method_with, pattern_tuning
from ...core.constants import replaced
from ...core.pipeline import KERNELS, Stopwatch
from ...core.surface.pixels import measured_pixels

SCENES = 'casting', 'effector_bin', 'airplane', 'printed', 'effector_nut', 'portrait'
QUICK_SCENES = disturbed.SCENES
CASES = 'none', *disturbed.APERIODIC, *disturbed.DETAILED, *disturbed.SLOW
LOSSES = tuple(0.25 * k for k in range(17))
MOST_WRONG = 0.01  # of the sure ranges of a case, mean of the harder half of the scenes
SURE, RIGHT = 0.9, 1.0  # confidence; px


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under every disturbance of CASES."""
    return disturbed.lit_pairs(scenes, CASES, options)


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns `odds`."""
    found = {}
    for pair in options.progress(pairs):
        found.setdefault(pair.name, []).append(curve(pair))
    at = smallest([harder_half(np.array(curves)[:, 0]) for curves in found.values()])
    return {'odds': LOSSES[at]}, [
        f'{case}: wrong of the sure ranges {hi[0]:.2%} -> {hi[at]:.2%}, '
        f'sure of the right ones {sure[0]:.3f} -> {sure[at]:.3f}'
        for case, curves in found.items() for hi, sure in (np.mean(curves, axis=0),)]


def harder_half(wrong):
    """
    Return the mean of the harder half of the scenes at every loss, float64 (losses,).

    Parameters
    ----------
    wrong : ndarray of float64, shape (scenes, losses)
        Shares. Most scenes have few steps and need no loss: a mean over all would hide the others.

    """
    return np.sort(wrong, axis=0)[len(wrong) // 2:].mean(axis=0)


def smallest(curves):
    """Return the index of the smallest of LOSSES at which no curve has more than MOST_WRONG."""
    enough = np.max(curves, axis=0) <= MOST_WRONG
    return int(np.argmax(enough)) if enough.any() else len(LOSSES) - 1


def curve(pair):
    """Return shares (2, losses): wrong of the sure ranges, and sure of the right ones."""
    method = method_with(pair, replaced(pattern_tuning(pair), {'steps.odds': 0.0}))
    with KERNELS:
        method.measure(pair.left, pair.right, Stopwatch())
        return np.array([figures(pair, measurement)
                         for measurement in measurements(method)]).T


def measurements(method):
    """Return the Measurement of the last pair of a method at all of LOSSES, one by one."""
    steps, planes, verdict = method.steps, method.planes, method.trust.verdict
    rough, before = steps.roughness(method.quality), verdict.log_odds.copy()
    weak = steps.weakness(verdict, method.quality, rough)
    for loss in LOSSES:
        verdict.log_odds[...] = before
        steps.lower(planes, verdict, rough, weak * loss)
        yield measured_pixels(planes, verdict, method.geometry, method.limits,
                              method.trust.least_odds)


def figures(pair, measurement):
    """Return the shares of `curve` of one Measurement; 0 and 1 without such ranges."""
    with np.errstate(invalid='ignore'):
        right = pair.visible & (np.abs(measurement.disparity - pair.disparity) <= RIGHT)
    sure = pair.visible & np.isfinite(pair.disparity) & (measurement.confidence > SURE)
    both = np.count_nonzero(sure & right)
    return (1 - both / max(np.count_nonzero(sure), 1) if sure.any() else 0.0,
            both / np.count_nonzero(right) if right.any() else 1.0)
