# SPDX-License-Identifier: Apache-2.0
"""Evaluation against the truth: errors, densities and the noise limit."""
