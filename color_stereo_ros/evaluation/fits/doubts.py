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
Fit how much the third view is doubted, and in which pairs.

Log-odds of three views are true, but the more nodes may have a range, the more wrong ones are
among them. Doubts lower all log-odds that two cameras do not know for certain. Under blur, noise
and compression most nodes are of this kind, and two cameras give them ranges. Doubts must fade
there. The fit takes the doubts of the fewest wrong ranges at which every case gains right ranges.

"""

from dataclasses import dataclass

import numpy as np

from . import disturbed
from ...core import ColorStereo
from ...core.pipeline import KERNELS
from ...core.surface.pixels import measured_pixels

SCENES = QUICK_SCENES = 'casting', 'effector_bin', 'airplane', 'printed'
CLEAN = 'none'
CASES = ((CLEAN, 1.0), ('rows', 1.0), ('blur_both', 2.0), ('jpeg', 60), ('gamma_both', 2.2),
         ('projector_gamma', 2.2), ('exposure', 0.2))
DOUBTS = tuple((agree, 0.0, round(agree + 0.2, 2))
               for agree in (0.0, 0.4, 0.6, 0.7, 0.85, 1.0, 1.2))
FADING = (0.02, 0.04), (0.02, 0.05), (0.03, 0.05), (0.03, 0.06), (1.0, 2.0)
"""Of `use.expected_wrong`; the last one: doubts never fade."""

LEAST_GAIN = 0.0015  # share of right ranges against two cameras: three views shall add some
RIGHT = 1.0  # px


@dataclass(frozen=True)
class Point:
    """What one choice gives in one pair: shares of the visible pixels, false_wrong of all."""

    right: float
    wrong: float
    false_wrong: float


@dataclass(frozen=True)
class Verdict:
    """What one choice gives on some scenes."""

    gain: float
    """Share of right ranges less that of two cameras, in the worst case."""
    case: str
    """Its name."""
    wrong: float
    """Of clean pairs, as in Point."""
    false_wrong: float


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under every disturbance of CASES."""
    return disturbed.lit_pairs(scenes, CASES, options)


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns `doubts` and `expected_wrong`."""
    found = {}
    for pair in options.progress(pairs):
        found.setdefault(pair.scene, {})[pair.name] = points(pair)
    choices = verdicts(found.values())
    doubts, fading = best(choices)
    return {'doubts': list(doubts), 'expected_wrong': list(fading)}, [
        f'{choice}: worst gain of right ranges {each.gain:+.4f} ({each.case}), clean pairs: '
        f'wrong {each.wrong:.4f}, false and wrong {each.false_wrong:.4f}'
        for choice, each in choices.items()], left_out(found)


def left_out(found):
    """Return what the fit to all other scenes gives on each scene; found: Points by scene."""
    told = {}
    for name in found if len(found) > 1 else ():
        choice = best(verdicts([each for other, each in found.items() if other != name]))
        own = verdicts([found[name]])[choice]
        told[name] = {'doubts': list(choice[0]), 'expected_wrong': list(choice[1]),
                      'worst_gain': round(own.gain, 4), 'wrong': round(own.wrong, 4),
                      'false_wrong': round(own.false_wrong, 4)}
    return told


def all_choices():
    """Return all pairs of DOUBTS and FADING."""
    return [(doubts, fading) for doubts in DOUBTS for fading in FADING]


def verdicts(scenes):
    """Return the Verdict of every choice; scenes: dicts of a case to what `points` returns."""
    scenes = list(scenes)
    return {choice: verdict(scenes, choice) for choice in all_choices()}


def verdict(scenes, choice):
    """Return the Verdict of one choice on some scenes."""
    gains = {case: float(np.mean([each[case][1][choice].right - each[case][0].right
                                  for each in scenes])) for case in scenes[0]}
    worst = min(gains, key=gains.get)
    clean = [each.get(CLEAN, each[worst])[1][choice] for each in scenes]
    return Verdict(gains[worst], worst, float(np.mean([each.wrong for each in clean])),
                   float(np.mean([each.false_wrong for each in clean])))


def best(choices):
    """Return the choice of the fewest wrong ranges of clean pairs whose cases all gain."""
    fair = [choice for choice, each in choices.items() if each.gain >= LEAST_GAIN]
    return min(fair or all_choices()[:1],
               key=lambda choice: choices[choice].wrong + choices[choice].false_wrong)


def points(pair):
    """Return the Point of two cameras, and that of every choice by the choice."""
    stereo = ColorStereo(pair.calibration, pair.settings.updated(
        {'matching.third_view': 'automatic'}))
    stereo.process(pair.left, pair.right)
    method = stereo._method
    with KERNELS:
        two = method.of_two(method.trust.verdict)
        before = point(pair, two)
        if method.third.found is None:  # the projector takes no part
            return before, {choice: before for choice in all_choices()}
        return before, {choice: point(pair, fused_pixels(method, *choice))
                        for choice in all_choices()}


def fused_pixels(method, doubts, fading):
    """Return the Measurement of the last pair of a method under other doubts."""
    fusion = method.third.fusion
    fusion.doubts, fusion.fading = np.array([0, *doubts], np.float32), fading
    return pixels_of(method)


def pixels_of(method):
    """Return the Measurement of the last pair of a method, weighed anew."""
    fusion = method.third.fusion
    fused = fusion.fuse(method.third.found, method.trust.verdict, method.planes)
    return measured_pixels(fused.planes, fused.verdict, method.geometry, method.limits,
                           method.trust.least_odds, fused.beyond)


def point(pair, measurement):
    """Return the Point of a Measurement."""
    given = np.isfinite(measurement.disparity) & np.isfinite(pair.disparity)
    with np.errstate(invalid='ignore'):
        right = given & (np.abs(measurement.disparity - pair.disparity) <= RIGHT)
    seen = max(np.count_nonzero(pair.visible), 1)
    off = given & ~right
    return Point(np.count_nonzero(right & pair.visible) / seen,
                 np.count_nonzero(off & pair.visible) / max(
                     np.count_nonzero(given & pair.visible), 1),
                 np.count_nonzero(off & ~pair.visible) / max(np.count_nonzero(given), 1))
