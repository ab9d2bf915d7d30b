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
"""A ColorStereo whose surface method has other constants, for ablations."""

from ..core import ColorStereo, MatchingSettings
from ..core.constants import listed
from ..core.surface.choosing import surface_method
from ..core.surface.tuning import TUNING

CONSTANTS = {entry.name: entry for entry in listed(TUNING)}
"""Every constant of the surface method by its flat name."""


class TunedStereo(ColorStereo):
    """
    A ColorStereo with the surface method under other constants.

    Parameters
    ----------
    calibration : StereoCalibration
    settings : Settings
    constants : dict
        Flat names to values, for example `{'steps.odds': 0.0}`. They replace what suits the
        pattern, too.

    Raises
    ------
    ValueError
        If a name is unknown, or a constant is compiled into the kernels.

    """

    def __init__(self, calibration, settings, constants):
        """Keep the constants for the method."""
        self._constants = constants
        super().__init__(calibration, settings)

    def _make_method(self, calibration):
        return surface_method(self.settings, calibration, self._limits,
                              constants=self._constants)


def switched_off():
    """Return what switches stages of the surface method off: constant to its value when off."""
    return {name: entry.off for name, entry in CONSTANTS.items() if entry.off is not None}


def stereo_for(calibration, settings, values):
    """
    Return a ColorStereo under settings and values.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    settings : Settings
        Of the core.
    values : dict
        Flat settings, and flat constants of the surface method.

    Returns
    -------
    stereo : ColorStereo

    Raises
    ------
    ColorStereoError
        If a setting is wrong.

    """
    constants = {name: value for name, value in values.items() if name in CONSTANTS}
    settings = settings.updated({name: value for name, value in values.items()
                                 if name not in constants})
    if constants and settings.matching.method == MatchingSettings().method:
        return TunedStereo(calibration, settings, constants)
    return ColorStereo(calibration, settings)
