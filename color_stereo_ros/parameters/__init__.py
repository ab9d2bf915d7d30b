# SPDX-License-Identifier: Apache-2.0
"""The parameters of the nodes and their YAML files; no ROS library is needed."""
