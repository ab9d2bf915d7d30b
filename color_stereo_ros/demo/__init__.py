# SPDX-License-Identifier: Apache-2.0
"""The demonstration: sample recordings through both nodes, and a page to look at."""
