# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes: they translate, call the core and publish."""
