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
Fit how certain the third view makes pairs that two cameras find hard.

Both pairs of views share the left image. Its blur and compression move both planes alike, and they
agree on wrong places. Log-odds of agreement, which were fitted to clean pairs, are then too high.
The fit takes the largest factor of them at which no case has a share of wrong ranges among the
sure ones that is larger than with two cameras by more than PERMITTED.

"""

import numpy as np

from . import disturbed
from .doubts import pixels_of
from ..metrics import RIGHT, SURE
from ...core import ColorStereo
from ...core.pipeline import KERNELS

SCENES = QUICK_SCENES = 'casting', 'effector_bin', 'airplane', 'printed'
CASES = (('blur_left', 3.0), ('blur_both', 3.0), ('blur_right', 3.0), ('motion_right', 9.0),
         ('motion_rows', 9.0), ('jpeg', 40), 'worn')
FACTORS = 1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2
PERMITTED = 0.0005
"""Share of wrong ranges among the sure: a twentieth of the largest one that is accepted, 1 %."""


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under every disturbance of CASES."""
    return disturbed.lit_pairs(scenes, CASES, options)


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns `kept_certainty`."""
    found = {}
    for pair in options.progress(pairs):
        found.setdefault(pair.scene, {})[pair.name] = shares(pair)
    excess = worst_excess(found.values())
    return {'kept_certainty': best(excess)}, [
        f'{factor}: wrong among the sure at most {each:+.4f} above two cameras'
        for factor, each in excess.items()], left_out(found)


def left_out(found):
    """Return what the fit to all other scenes gives on each scene; found: shares by scene."""
    told = {}
    for name in found if len(found) > 1 else ():
        factor = best(worst_excess([each for other, each in found.items() if other != name]))
        told[name] = {'kept_certainty': factor,
                      'excess': round(worst_excess([found[name]])[factor], 4)}
    return told


def worst_excess(scenes):
    """
    Return by how much wrong ranges among the sure exceed those of two cameras.

    Parameters
    ----------
    scenes : iterable of dict
        From the name of a case to what `shares` returns.

    Returns
    -------
    excess : dict
        Factor to the excess, mean over scenes, in the worst case.

    """
    scenes = list(scenes)
    return {factor: float(max(np.mean([each[case][1][factor] - each[case][0] for each in scenes])
                              for case in scenes[0])) for factor in FACTORS}


def best(excess):
    """Return the largest factor of a permitted excess; where there is none, that of the least."""
    fair = [factor for factor, each in excess.items() if each <= PERMITTED]
    return max(fair) if fair else min(excess, key=excess.get)


def shares(pair):
    """Return the share of wrong ranges among the sure, of two cameras and of every factor."""
    stereo = ColorStereo(pair.calibration, pair.settings.updated(
        {'matching.third_view': 'automatic'}))
    stereo.process(pair.left, pair.right)
    method = stereo._method
    with KERNELS:
        two = wrong_share(pair, method.of_two(method.trust.verdict))
        if method.third.found is None:  # the projector takes no part
            return two, dict.fromkeys(FACTORS, two)
        return two, {factor: wrong_share(pair, sure_pixels(method, factor)) for factor in FACTORS}


def sure_pixels(method, factor):
    """Return the Measurement of the last pair of a method with another factor."""
    method.third.fusion.kept_certainty = factor
    return pixels_of(method)


def wrong_share(pair, measurement):
    """Return the share of wrong ranges among the sure ones that both cameras see."""
    sure = pair.visible & np.isfinite(pair.disparity) & (measurement.confidence > SURE)
    error = np.abs(measurement.disparity - pair.disparity)[sure]
    return float(np.mean(error > RIGHT)) if error.size else 0.0
