# SPDX-License-Identifier: Apache-2.0
"""The node sim_rig_node: two simulated cameras that see a scene under the pattern shown."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from .sim_rig import SimRigNode
    return SimRigNode()


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros sim_rig_node`."""
    return run(make_node, args)
