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
"""What every pattern says of itself."""

from dataclasses import dataclass
from enum import Enum
from typing import Callable, Optional


class Repeats(Enum):
    """How often the same colors come again along a row; what a search expects follows from it."""

    NEVER = 'aperiodic: no colors come again, and both cameras see all hues'
    CYCLES = 'pattern.cycles times over the width; in between the colors change slowly'
    UNKNOWN = 'any number of times'


@dataclass(frozen=True)
class Pattern:
    """One type of pattern; an entry of `registry.PATTERNS`."""

    summary: str
    """What it shows, for lists of the types; may be empty."""
    make: Optional[Callable] = None
    """
    PatternSettings in, colors out: numbers 0 .. 1 that broadcast to (height, width, 3), RGB,
    linear light; or `blocks.RowColors`, which bounds the memory of large patterns. None: the
    pattern can be matched but not made.
    """
    repeats: Repeats = Repeats.UNKNOWN
    uniform_brightness: bool = False
    """Whether the three components have the same sum everywhere."""
    check: Optional[Callable] = None
    """
    PatternSettings in; raises SettingsError, at once, where `make` would refuse them after a
    while. None: every setting can be made.
    """
