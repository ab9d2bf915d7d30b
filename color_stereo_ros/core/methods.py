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
"""The matching methods: the choices of `matching.method`."""

from dataclasses import dataclass
from typing import Callable

from .registry import Registry


@dataclass(frozen=True)
class Method:
    """One way to measure a pair; an entry of `METHODS`."""

    summary: str
    """What it does, for lists of the methods; may be empty."""
    make: Callable
    """
    Makes the method from the arguments of `make_method`: an object with
    `measure(left, right, clock)` that takes raw images (checked, uint8 (H, W, 3) RGB) and a
    Stopwatch and returns a Measurement.
    """


def _surface(settings, calibration, limits, rectifier):
    from .surface.choosing import surface_method
    return surface_method(settings, calibration, limits, rectifier.rectified_input)


def _paper(settings, calibration, limits, rectifier):
    from .paper.method import PaperMethod
    return PaperMethod(settings, calibration, limits, rectifier)


METHODS = Registry('matching method', Method, {
    'surface': Method('coarse to fine with slanted surfaces', _surface),
    'paper': Method('the exhaustive search of the paper, sec. 2.2', _paper),
})
"""Method by name; their order is that of all lists."""


def make_method(settings, calibration, limits, rectifier):
    """
    Return the method that settings.matching.method names.

    Parameters
    ----------
    settings : Settings
        Of the core.
    calibration : StereoCalibration
        Of the two cameras.
    limits : (float, float)
        Smallest and largest disparity, px.
    rectifier : Rectifier
        Of raw images.

    Returns
    -------
    method : object
        See `Method.make`.

    """
    make = METHODS[settings.matching.method].make
    return make(settings, calibration, limits, rectifier)
