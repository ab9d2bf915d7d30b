# SPDX-License-Identifier: Apache-2.0
"""From two cameras and a projector to a calibrated sensor; no ROS."""
