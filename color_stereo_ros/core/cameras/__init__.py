# SPDX-License-Identifier: Apache-2.0
"""Calibrated cameras: lens models, checks, rectification."""
