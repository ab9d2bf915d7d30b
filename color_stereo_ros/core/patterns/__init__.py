# SPDX-License-Identifier: Apache-2.0
"""The color patterns: how each is made, and what a search may expect of it."""
