# SPDX-License-Identifier: Apache-2.0
"""Settings: the single source of every name, default, unit and range."""

from .fields import (
    checked_value, described, explained, flat, Group, Metadata, setting, suggestion, updated)
from .groups import (
    ColorSettings, HealthSettings, MatchingSettings, PatternSettings, RangeSettings, Settings)

__all__ = [
    'ColorSettings', 'Group', 'HealthSettings', 'MatchingSettings', 'Metadata',
    'PatternSettings', 'RangeSettings', 'Settings', 'checked_value', 'described', 'explained',
    'flat', 'setting', 'suggestion', 'updated']
