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
"""~/capture over real DDS: the pair is exposed after the call, whatever clock stamps it."""

from random import Random
import time

from capture_rig import cameras, captured, judge, prepared, TIMEOUT

from capture_world import NS

from diagnostic_msgs.msg import DiagnosticStatus

import pytest

import rclpy
from rclpy.qos import QoSProfile

from ros_rig import values_of

from sensor_msgs.msg import Image

from std_srvs.srv import Trigger

# Each one follows on the one before it: a clock that is set back by less than the pause between
# two tests is noticed late.
RELATIONS = {
    "the node's": lambda wall: wall,
    'TAI': lambda wall: wall + 37 * NS,
    'behind 1 s': lambda wall: wall - NS,
    'behind 37 s': lambda wall: wall - 37 * NS,
    'power-on': lambda wall: wall % (1000 * NS) + NS,
    'ahead': lambda wall: wall + NS // 2,
    'zero': lambda wall: 0,
}


@pytest.fixture(scope='module')
def rig(tmp_path_factory):
    """Yield a rig and a node that measures on request."""
    with prepared(tmp_path_factory.mktemp('clocks')) as found:
        yield found


@pytest.mark.parametrize('relation', RELATIONS)
def test_a_stream_is_captured_after_the_call(rig, effort, figures, relation):
    random, outcomes = Random(1), []
    with cameras(rig, RELATIONS[relation]):
        for _ in range(effort.count(5, 1000)):
            rig.spin(random.random() * 0.1)
            outcomes.append(captured(rig))
    judge(figures, relation, outcomes)


@pytest.mark.parametrize('relation', ['behind 1 s', 'zero'])
def test_a_stream_that_goes_on_after_a_pause_is_captured_after_the_call(
        rig, effort, figures, relation):
    outcomes = []
    with cameras(rig, RELATIONS[relation]) as found:
        for _ in range(effort.count(3, 200)):
            rig.spin(0.5)
            found.pause(0.8)
            found.go_on()  # this pair is under way when the call is made
            outcomes.append(captured(rig))
    judge(figures, f'{relation}, after a pause', outcomes)


@pytest.mark.parametrize('relation', RELATIONS)
def test_one_pair_comes_after_the_call_and_answers_it(rig, effort, figures, relation):
    outcomes = []
    with cameras(rig, RELATIONS[relation], period=0) as found:
        for _ in range(effort.count(5, 1000)):
            outcomes.append(captured(rig, found.expose))
    judge(figures, f'{relation}, software trigger', outcomes)
    unknown = [answer.message for _, _, answer in outcomes
               if 'the clock of the cameras is unknown' in answer.message]
    assert len(unknown) == (0 if relation == "the node's" else len(outcomes))


def test_the_diagnostics_state_the_relation(rig):
    with cameras(rig, RELATIONS['TAI']):
        parts = rig.diagnose(lambda p: 'ahead of the node' in values_of(p['inputs'])['clock'],
                             'the relation')
    sentence = values_of(parts['inputs'])['clock']
    assert sentence.startswith("stamps of the cameras are 37.0 s ahead of the node's clock")
    assert 'jitter' in sentence and 'learned from' in sentence
    assert parts['inputs'].level == DiagnosticStatus.OK


def test_600_calls_that_wait_are_answered_by_one_pair(rig, effort, figures):
    lasted = [seconds_of_600_calls(rig) for _ in range(effort.count(1, 10))]
    figures('600 calls that wait: from the exposure of the pair to the last answer, longest',
            max(lasted), 's', over=len(lasted))


def seconds_of_600_calls(rig):
    """Let 600 calls wait, 50 of a client that goes; return the time to the last answer, s."""
    quitter = rclpy.create_node('quitter', context=rig.context)
    with cameras(rig, RELATIONS["the node's"], period=0) as found:
        leaver = quitter.create_client(Trigger, f'{rig.target}/capture',
                                       qos_profile=QoSProfile(depth=1000))
        rig.spin_until(leaver.service_is_ready, 'the service')
        for _ in range(50):
            leaver.call_async(Trigger.Request())
        futures = [rig.client.call_async(Trigger.Request()) for _ in range(550)]
        waiting = 'calls of ~/capture that wait'
        rig.diagnose(lambda p: values_of(p['range images'])[waiting] == '600', 'all calls')
        quitter.destroy_node()
        rig.acquired.clear()
        found.expose()
        start = time.monotonic()
        rig.spin_until(lambda: all(future.done() for future in futures), 'all answers')
        lasted = time.monotonic() - start
    answers = {future.result().message for future in futures}
    assert len(answers) == 1 and next(iter(answers)).startswith('stamp ')
    assert len(rig.acquired) == 1
    rig.diagnose(lambda p: values_of(p['range images'])[waiting] == '0', 'no call')
    return lasted


def test_more_calls_than_the_queue_holds_are_refused_with_the_reason(rig):
    with cameras(rig, RELATIONS["the node's"], period=0) as found:
        futures = [rig.client.call_async(Trigger.Request()) for _ in range(1000)]
        rig.diagnose(lambda p: values_of(p['range images'])['calls of ~/capture that wait']
                     == '1000', 'a full queue')
        _, _, answer = captured(rig)
        assert not answer.success and '1000 calls wait already' in answer.message
        found.expose()
        rig.spin_until(lambda: all(future.done() for future in futures), 'all answers')
    assert all(future.result().success for future in futures)


def test_the_right_reason_is_given_where_no_pair_counts(rig):
    rig.set_parameters(capture__timeout=0.3)
    with cameras(rig, lambda wall: wall + NS // 50, delay=0.5):
        rig.spin(1.0)
        _, _, answer = captured(rig)
    rig.set_parameters(capture__timeout=TIMEOUT)
    assert not answer.success
    assert 'none was surely exposed after the call: stamps of the cameras' in answer.message
    assert 'within 0.3 s after the call' in answer.message


def test_a_capture_that_has_begun_is_not_cut_off(rig):
    rig.set_parameters(capture__timeout=2.0, capture__pairs=100)
    with cameras(rig, RELATIONS["the node's"]):
        start = time.monotonic()
        _, _, answer = captured(rig)
        lasted = time.monotonic() - start
    rig.set_parameters(capture__timeout=TIMEOUT, capture__pairs=1)
    assert answer.success and answer.message.endswith('fused from 100 pairs')
    assert lasted > 2.0  # 100 pairs at 25 Hz


def test_a_capture_whose_pairs_stay_away_says_how_many_came(rig):
    rig.set_parameters(capture__timeout=1.0, capture__pairs=100)
    with cameras(rig, RELATIONS["the node's"]) as found:
        future = rig.client.call_async(Trigger.Request())
        rig.spin(1.5)
        found.close()
        rig.spin_until(future.done, 'the answer')
        found._timer = rig.node.create_timer(1e6, found.expose)  # closed again in the end
    rig.set_parameters(capture__timeout=TIMEOUT, capture__pairs=1)
    assert not future.result().success
    assert ' of 100 pairs have come: no pair for' in future.result().message


def test_several_pairs_are_fused_to_one_result(rig):
    rig.listen(Image, 'depth/image')
    rig.wait_for_publishers()
    rig.set_parameters(capture__pairs=4)
    with cameras(rig, RELATIONS["the node's"]):
        rig.received['depth/image'].clear()
        called, exposed, answer = captured(rig)
        rig.spin_until(lambda: rig.received['depth/image'], 'the fused depth')
        rig.spin(0.5)
    rig.set_parameters(capture__pairs=1)
    assert answer.success and answer.message.endswith('; fused from 4 pairs')
    assert len(rig.received['depth/image']) == 1 and len(rig.acquired) == 1
    frame = rig.received['depth/image'][0].header.frame_id
    assert frame == f'optical {exposed}' and exposed > called + NS // 10
    rig.received.clear()
