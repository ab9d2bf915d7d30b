# SPDX-License-Identifier: Apache-2.0
# Copyright 2026 color_stereo_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The node range_node as a managed one: configure, activate, deactivate, cleanup."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from .sensor.node import LifecycleRangeNode
    return LifecycleRangeNode()


def usage():
    """Return the Usage of the node."""
    from .range_node import usage as usage_of
    return usage_of('lifecycle_range_node', 'range_node as a managed node: it has topics and '
                    'services from configure on, and it measures while it is active.')


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros lifecycle_range_node`."""
    return run(make_node, args, usage)
