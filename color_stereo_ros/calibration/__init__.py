# SPDX-License-Identifier: Apache-2.0
"""Calibration of the sensor, and how good it is: boards, geometry, color, hand-eye, checks."""
