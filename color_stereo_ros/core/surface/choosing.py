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
"""The surface method under a pattern of which nothing is known: each pair shows what it is."""

import math

from .method import SurfaceMethod
from .tuning import tuning_for
from ..constants import replaced
from ..patterns.expectation import Expectation


def surface_method(settings, calibration, limits, rectified_input=False, constants=None):
    """
    Return the surface method that suits the pattern of the settings.

    Parameters
    ----------
    settings : Settings
        Of the core.
    calibration : StereoCalibration
        Of the two cameras.
    limits : (float, float)
        Smallest and largest disparity, px.
    rectified_input : bool
        The images arrive rectified already.
    constants : dict, optional
        Flat names to values that replace those of the tuning, see `replaced`.

    Returns
    -------
    method : SurfaceMethod or UnknownPattern

    """
    def made(expectation):
        tuning = replaced(tuning_for(expectation, calibration.geometry.width), constants or {})
        return SurfaceMethod(settings, calibration, limits, rectified_input, tuning, expectation)

    expectation = Expectation.of(settings.pattern)
    if expectation.aperiodic or math.isfinite(expectation.cycles):
        return made(expectation)
    return UnknownPattern(made(Expectation(aperiodic=True, cycles=1)), made(expectation))


class UnknownPattern:
    """
    Measures each pair by the method that suits what it shows.

    Colors that are steep everywhere and come again nowhere are matched as those of an aperiodic
    pattern. Nothing is carried from pair to pair.

    Parameters
    ----------
    aperiodic, other : SurfaceMethod
        The method for such colors, and that for all others.

    """

    aligns_rows = True

    def __init__(self, aperiodic, other):
        """Keep the methods."""
        self.aperiodic, self.other = aperiodic, other
        self.planar, self.may_use_projector = other.planar, False

    def measure(self, left, right, clock, alignment=None, search=None, given=None):
        """Measure one pair; see `SurfaceMethod.measure`."""
        method = self.suiting(left, right, alignment)
        return method.measure(left, right, clock, alignment, search, given)

    def curve(self, left, right, alignment, pixel):
        """Return the CostCurve of a pixel; see `SurfaceMethod.curve`."""
        return self.suiting(left, right, alignment).curve(left, right, alignment, pixel)

    def suiting(self, left, right, alignment):
        """Return the SurfaceMethod for a pair; see `measure` for the arguments."""
        return self.aperiodic if self.aperiodic.never_repeats(
            left, right, alignment) else self.other
