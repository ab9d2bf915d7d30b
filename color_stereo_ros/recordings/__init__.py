# SPDX-License-Identifier: Apache-2.0
"""Recordings (rosbag2): read, written and measured; no ROS library is needed."""
