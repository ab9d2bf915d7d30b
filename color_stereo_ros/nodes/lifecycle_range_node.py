# SPDX-License-Identifier: Apache-2.0
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
