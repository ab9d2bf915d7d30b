# SPDX-License-Identifier: Apache-2.0
"""By how much the rows of the two views disagree: the value, its estimate, the search."""
