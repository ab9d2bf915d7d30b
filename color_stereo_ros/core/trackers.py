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
"""The tracker of the projector for a pattern: made when a pair needs it, kept for others."""

from functools import lru_cache

from .patterns.making import check_pattern, make_pattern
from .patterns.registry import PATTERNS
from .projector.finding import ProjectorFinder
from .projector.tracking import ProjectorTracker
from ..errors import SettingsError


def is_makable(settings):
    """Return whether a pattern can be made."""
    try:
        check_pattern(settings)
    except SettingsError:
        return False
    return True


def tracker_of(settings, geometry):
    """
    Return what follows the projector that shows a pattern.

    The pattern and its features take part of a second. The last two are kept.

    Parameters
    ----------
    settings : PatternSettings
        Of the pattern that is projected.
    geometry : RectifiedGeometry
        Of the rectified pair.

    Returns
    -------
    tracker : ProjectorTracker

    """
    return _made(settings, PATTERNS[settings.type], (geometry.width, geometry.height))


@lru_cache(maxsize=2)
def _made(settings, entry, size):
    """Make a tracker; an entry that was registered anew is another one."""
    return ProjectorTracker(ProjectorFinder(make_pattern(settings), size))
