# SPDX-License-Identifier: Apache-2.0
"""The instrument with which everything else is judged: errors, densities and their limits."""
