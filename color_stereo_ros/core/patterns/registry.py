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
"""The types of pattern: the choices of `pattern.type`."""

from . import (
    bright_sweep, hue_field, lines, pseudo_noise, sine, sweep, unknown, walsh, wave_field)
from .pattern import Pattern, Repeats
from ..registry import Registry

PATTERNS = Registry('pattern type', Pattern, {
    'hue_field': hue_field.PATTERN,
    'sweep': sweep.PATTERN,
    'bright_sweep': bright_sweep.PATTERN,
    'sine': sine.PATTERN,
    'walsh': walsh.PATTERN,
    'lines': lines.PATTERN,
    'wave_field': wave_field.PATTERN,
    'pseudo_noise': pseudo_noise.PATTERN,
    'unknown': unknown.PATTERN,
})
"""Pattern by type; their order is that of all lists."""


def makable():
    """Return the types that can be made, a list of str."""
    return [name for name, pattern in PATTERNS.items() if pattern.make]


def repeating(repeats):
    """Return the types that repeat as given, a list of str."""
    return [name for name, pattern in PATTERNS.items() if pattern.repeats is repeats]


def repetition(settings):
    """Return how the pattern of PatternSettings repeats, one of Repeats."""
    return PATTERNS[settings.type].repeats


def is_aperiodic(settings):
    """Return whether no colors come again in the pattern of PatternSettings."""
    return repetition(settings) is Repeats.NEVER
