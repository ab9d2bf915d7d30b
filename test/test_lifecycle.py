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
"""The managed range_node: the same sensor, measuring while it is active."""

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState

import pytest

from ros_rig import NodeProcess, PAPER, Rig

from sensor_msgs.msg import Image


@pytest.fixture(scope='module')
def rig(tmp_path_factory):
    """Yield a rig with an unconfigured node."""
    log = tmp_path_factory.mktemp('lifecycle') / 'log.txt'
    node = NodeProcess(log, 'lifecycle_range_node', PAPER)
    rig = Rig()
    rig.listen(Image, 'depth/image')
    yield rig
    assert node.stop() == 0, node.text()
    rig.close()
    assert 'Traceback' not in node.text()


def change(rig, transition):
    """Ask for a transition and tell whether it succeeded."""
    request = ChangeState.Request(transition=Transition(id=transition))
    return rig.call(ChangeState, f'{rig.target}/change_state', request).success


def state(rig):
    """Return the state of the node."""
    return rig.call(GetState, f'{rig.target}/get_state', GetState.Request()).current_state.id


def outputs_of(rig, pairs):
    """Send pairs and return how many outputs arrived."""
    rig.received['depth/image'].clear()
    for _ in range(pairs):
        rig.send_pair()
        rig.spin(0.1)
    rig.spin(0.3)
    return len(rig.received['depth/image'])


def test_the_node_measures_exactly_while_it_is_active(rig):
    assert state(rig) == State.PRIMARY_STATE_UNCONFIGURED
    assert not any(publisher.get_subscription_count() for publisher in rig.publishers.values())
    assert change(rig, Transition.TRANSITION_CONFIGURE)
    rig.wait_for_node()
    rig.wait_for_publishers()
    assert outputs_of(rig, 2) == 0
    assert change(rig, Transition.TRANSITION_ACTIVATE)
    rig.first_output('depth/image')
    assert rig.good_pair().encoding == '32FC1'
    assert change(rig, Transition.TRANSITION_DEACTIVATE)
    rig.spin(0.3)
    assert outputs_of(rig, 2) == 0
    assert change(rig, Transition.TRANSITION_ACTIVATE)
    rig.good_pair()


def test_parameters_change_in_every_state(rig):
    assert rig.set_parameters(range__max_depth=0.9).successful
    assert change(rig, Transition.TRANSITION_DEACTIVATE)
    assert change(rig, Transition.TRANSITION_CLEANUP)
    assert rig.set_parameters(range__max_depth=0.8).successful
    assert not rig.set_parameters(range__max_depth=0.1).successful


def test_after_a_cleanup_it_can_be_configured_again(rig):
    assert state(rig) == State.PRIMARY_STATE_UNCONFIGURED
    rig.spin_until(lambda: not any(publisher.get_subscription_count()
                                   for publisher in rig.publishers.values()), 'the end')
    assert change(rig, Transition.TRANSITION_CONFIGURE)
    assert change(rig, Transition.TRANSITION_ACTIVATE)
    rig.wait_for_node()
    rig.first_output('depth/image')
    rig.good_pair()


def test_a_managed_node_ends_with_status_0_in_every_state(rig):
    assert change(rig, Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert state(rig) == State.PRIMARY_STATE_FINALIZED
