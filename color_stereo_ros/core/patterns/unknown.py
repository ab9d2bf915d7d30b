# SPDX-License-Identifier: Apache-2.0
"""A pattern from elsewhere: it can be matched, not made."""

from .pattern import Pattern

PATTERN = Pattern('some other pattern')
