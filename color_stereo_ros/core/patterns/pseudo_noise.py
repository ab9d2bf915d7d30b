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
"""Colored patches whose neighborhoods are all different (paper, sec. 2.1)."""

import numpy as np

from .blocks import RowColors
from .pattern import Pattern, Repeats
from ...errors import SettingsError

# Full primaries and secondaries: any two differ by a whole component at least.
PATCH_COLORS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1], [1, 1, 0]])
MAX_PATCHES = 1_000_000    # a tenth of the 6^9 neighborhoods: found within a few trials


def make(settings):
    """Return square patches in which no 3 x 3 patches repeat, a `RowColors`."""
    check(settings)
    rows, columns = patches(settings)
    codes = unrepeated_codes(rows, columns, settings)
    row = np.minimum(np.arange(settings.height) / settings.feature_size, rows - 1).astype(int)
    column = np.minimum(np.arange(settings.width) / settings.feature_size, columns - 1).astype(int)
    return RowColors(lambda part: PATCH_COLORS[codes[row[part, None], column]])


def patches(settings):
    """Return how many (rows, columns) of patches a pattern has."""
    return tuple(max(3, int(np.ceil(size / settings.feature_size)))
                 for size in (settings.height, settings.width))


def check(settings):
    """Raise SettingsError if there are more patches than MAX_PATCHES."""
    rows, columns = patches(settings)
    if rows * columns > MAX_PATCHES:
        raise SettingsError(f'pattern.feature_size = {settings.feature_size} px makes {rows} x '
                            f'{columns} patches, expected at most {MAX_PATCHES} for unrepeated '
                            '3 x 3 neighborhoods')


def unrepeated_codes(rows, columns, settings):
    """Return random color numbers, int (rows, columns), whose 3 x 3 neighborhoods all differ."""
    rng = np.random.default_rng(settings.seed)
    codes = rng.integers(len(PATCH_COLORS), size=(rows, columns))
    repeated = repeated_neighborhoods(codes)
    while repeated.any():
        codes[1:-1, 1:-1][repeated] = rng.integers(len(PATCH_COLORS), size=repeated.sum())
        repeated = repeated_neighborhoods(codes)
    return codes


def repeated_neighborhoods(codes):
    """Return which 3 x 3 neighborhoods occurred before, bool (rows - 2, columns - 2)."""
    rows, columns = codes.shape
    number = np.zeros((rows - 2, columns - 2), np.int64)
    for y in range(3):
        for x in range(3):
            number = number * len(PATCH_COLORS) + codes[y:rows - 2 + y, x:columns - 2 + x]
    repeated = np.ones(number.size, bool)
    repeated[np.unique(number, return_index=True)[1]] = False
    return repeated.reshape(number.shape)


PATTERN = Pattern('colored patches', make, Repeats.NEVER, check=check)
