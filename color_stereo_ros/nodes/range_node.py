# SPDX-License-Identifier: Apache-2.0
"""The node range_node: raw pairs and calibrations in, range images and points out."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from .sensor.node import RangeNode
    return RangeNode()


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros range_node`."""
    return run(make_node, args)
