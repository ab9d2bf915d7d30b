# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests."""

import sys

import pytest


@pytest.fixture(autouse=True)
def no_node_outlives_its_test():
    """End the nodes that a test has started and, since it failed, not stopped."""
    before = len(started_nodes())
    yield
    for node in started_nodes()[before:]:
        if node.process.poll() is None:
            node.process.kill()
            node.process.wait()


def started_nodes():
    """Return the node processes of this session; empty before a test asks for ROS."""
    rig = sys.modules.get('ros_rig')
    return rig.NodeProcess.started if rig else []
