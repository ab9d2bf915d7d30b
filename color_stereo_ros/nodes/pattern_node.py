# SPDX-License-Identifier: Apache-2.0
"""The node pattern_node: the image that the projector must show, and what it is."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from .pattern_source import PatternNode
    return PatternNode()


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros pattern_node`."""
    return run(make_node, args)
