# SPDX-License-Identifier: Apache-2.0
"""What all pages of results have in common: the style of plots, the pieces of HTML."""
