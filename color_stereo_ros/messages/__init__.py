# SPDX-License-Identifier: Apache-2.0
"""ROS messages as data: what arrives, what is published; no ROS library is needed."""
