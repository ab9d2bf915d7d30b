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
"""Bands of rows for a blur: a pattern as floats would take twelve times its memory at once."""

from dataclasses import dataclass

from .tuning import TUNING


@dataclass(frozen=True)
class Band:
    """Rows of an image that are blurred at once."""

    rows: slice
    """Those that are wanted."""
    wide: slice
    """Those that the blur sees."""
    inner: slice
    """The wanted ones among them."""


def bands(height, sigma, unit=1):
    """
    Yield the bands of an image.

    Parameters
    ----------
    height : int
        Rows of the image.
    sigma : float
        Standard deviation of the widest blur, px.
    unit : int
        All bands but the last have a multiple of so many rows.

    Yields
    ------
    band : Band

    """
    reach = int(4 * sigma) + 2  # OpenCV cuts the Gaussian of floats off at 4 sigma
    step = -(-max(TUNING.patches.band, reach) // unit) * unit
    for first in range(0, height, step):
        last, top = min(first + step, height), max(first - reach, 0)
        yield Band(slice(first, last), slice(top, min(last + reach, height)),
                   slice(first - top, last - top))
