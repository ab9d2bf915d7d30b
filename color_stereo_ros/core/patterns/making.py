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
"""The image for the projector (paper, sec. 2.1, figs. 2.1 and 2.2)."""

import numpy as np

from .blocks import RowColors, slices
from .registry import makable, PATTERNS
from ..arrays import Bytes
from ..settings import PatternSettings
from ...errors import SettingsError


def make_pattern(settings: PatternSettings = PatternSettings()) -> Bytes:
    """
    Return the image that the projector must show.

    Parameters
    ----------
    settings : PatternSettings
        Of the pattern that is projected.

    Returns
    -------
    pattern : numpy.ndarray, uint8, shape (height, width, 3)
        RGB, linear light: a projector with a gamma curve should be given the inverse of it.

    Raises
    ------
    SettingsError
        If settings.type is 'unknown': such a pattern cannot be made, only matched.

    """
    make = PATTERNS[settings.type].make
    if make is None:
        raise SettingsError(f'pattern.type = {settings.type!r} cannot be made, expected one of '
                            f'{", ".join(makable())}')
    colors = make(settings)
    out = np.empty((settings.height, settings.width, 3), np.uint8)
    if isinstance(colors, RowColors):
        for rows in slices(settings.height, 3 * settings.width, colors.least):
            out[rows] = np.rint(255.0 * np.asarray(colors.make(rows)))
    else:
        out[...] = np.rint(255.0 * np.asarray(colors)).astype(np.uint8)
    return out


def check_pattern(settings):
    """
    Refuse, without making it, a pattern that cannot be made.

    Parameters
    ----------
    settings : PatternSettings
        Of the pattern that is projected.

    Raises
    ------
    SettingsError
        Where `make_pattern` does.

    """
    pattern = PATTERNS[settings.type]
    if pattern.make is None:
        raise SettingsError(f'pattern.type = {settings.type!r} names no pattern that can be '
                            f'shown, expected one of {", ".join(makable())}')
    if pattern.check is not None:
        pattern.check(settings)
