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
"""What a search may expect of a pattern before it sees an image."""

from dataclasses import dataclass
import math

from .pattern import Repeats
from .registry import is_aperiodic, repetition


@dataclass(frozen=True)
class Expectation:
    """What is known of a pattern."""

    aperiodic: bool
    """The same colors do not come again, and every part holds all of them alike."""
    cycles: float
    """How often the colors come again over the width of the pattern; inf: not known."""

    @property
    def repeats(self):
        """Return whether the same colors may come again within the search."""
        return not self.aperiodic and self.cycles > 1

    @classmethod
    def of(cls, pattern):
        """
        Return what is known of a pattern.

        Parameters
        ----------
        pattern : PatternSettings
            Of the pattern that is projected.

        Returns
        -------
        expectation : Expectation

        """
        if is_aperiodic(pattern):
            return cls(aperiodic=True, cycles=1)
        known = repetition(pattern) is Repeats.CYCLES
        return cls(aperiodic=False, cycles=pattern.cycles if known else math.inf)
