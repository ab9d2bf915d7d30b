# SPDX-License-Identifier: Apache-2.0
"""Recordings (rosbag2): read, written, measured without ROS, replayed."""
