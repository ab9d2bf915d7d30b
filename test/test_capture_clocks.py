# SPDX-License-Identifier: Apache-2.0
"""~/capture over real DDS: the pair is exposed after the call, whatever clock stamps it."""

from contextlib import contextmanager
from random import Random
import time

from capture_world import Loop, NS

from diagnostic_msgs.msg import DiagnosticStatus

import pytest

import rclpy
from rclpy.qos import QoSProfile

from ros_rig import silent_rig, values_of

from rosgraph_msgs.msg import Clock

from sensor_msgs.msg import Image

from std_msgs.msg import Header

from std_srvs.srv import Trigger

TIMEOUT = 20.0
"""capture.timeout, s: the machine may be busy."""
RELATIONS = {
    "the node's": lambda wall: wall,
    'TAI': lambda wall: wall + 37 * NS,
    'ahead': lambda wall: wall + NS // 2,
    'behind 1 s': lambda wall: wall - NS,
    'behind 37 s': lambda wall: wall - 37 * NS,
    'power-on': lambda wall: wall % (1000 * NS) + NS,
    'zero': lambda wall: 0,
}


class Cameras:
    """
    Two cameras that say in the frame_id when they exposed, ns of `time.time`.

    Parameters
    ----------
    rig : Rig
    stamp : callable
        Called with the wall clock, ns, returns the stamp.
    period, delay : float
        s between exposures and from exposure to sending. A period of 0 waits for `expose`.

    """

    def __init__(self, rig, stamp, period=0.04, delay=0.03):
        self._rig, self._stamp = rig, stamp
        self._period, self._delay = period, delay
        self._next, self._on_the_way = time.monotonic(), []
        self._timer = rig.node.create_timer(0.005, self._look)
        rig.send_infos()

    def _look(self):
        now = time.monotonic()
        if self._period and now >= self._next:
            self._next = max(self._next + self._period, now)
            self.expose()
        while self._on_the_way and self._on_the_way[0][0] <= now:
            _, exposed, stamp = self._on_the_way.pop(0)
            for side in ('left', 'right'):
                msg = self._rig.image_messages[side]
                msg.header.frame_id = f'optical {exposed}'
                self._rig.send_image(side, stamp, msg)

    def expose(self):
        """Take a pair now."""
        wall = time.time_ns()
        self._on_the_way.append((time.monotonic() + self._delay, wall, self._stamp(wall)))

    def close(self):
        """Stop."""
        self._rig.node.destroy_timer(self._timer)


@contextmanager
def cameras(rig, stamp, **options):
    """Yield Cameras that have been seen for a while."""
    from ros_rig import image_message
    rig.image_messages = {side: image_message(rig.images[side]) for side in ('left', 'right')}
    found = Cameras(rig, stamp, **options)
    try:
        rig.spin(1.5)
        yield found
    finally:
        found.close()


@pytest.fixture(scope='module')
def rig(tmp_path_factory):
    """Yield a rig and a node that measures on request."""
    with prepared(tmp_path_factory.mktemp('clocks')) as found:
        yield found


@contextmanager
def prepared(folder, **parameters):
    """Yield a rig that hears what is acquired."""
    with silent_rig(folder, **{'input.mode': 'capture', 'capture.timeout': TIMEOUT,
                               **parameters}) as found:
        found.acquired = []
        found.node.create_subscription(Header, f'{found.target}/acquired', found.acquired.append,
                                       QoSProfile(depth=50))
        found.client = found.node.create_client(Trigger, f'{found.target}/capture',
                                                qos_profile=QoSProfile(depth=1000))
        found.spin_until(found.client.service_is_ready, 'the service')
        found.spin_until(lambda: found.node.count_publishers(f'{found.target}/acquired'), 'topic')
        yield found


def captured(rig, meanwhile=lambda: None):
    """Capture; return when the call was made, the exposure that answers, and the answer."""
    rig.acquired.clear()
    called = time.time_ns()
    future = rig.client.call_async(Trigger.Request())
    meanwhile()
    rig.spin_until(lambda: future.done() and (rig.acquired or not future.result().success),
                   'the answer')
    exposed = int(rig.acquired[-1].frame_id.split()[1]) if rig.acquired else None
    return called, exposed, future.result()


def judge(figures, name, outcomes):
    """Ask that all captures succeeded, each with a pair from after its call."""
    early = [called - exposed for called, exposed, answer in outcomes
             if answer.success and exposed < called]
    failed = [answer.message for _, _, answer in outcomes if not answer.success]
    figures(f'capture over DDS, {name}: pairs from before the call', len(early), 'pairs',
            over=len(outcomes), at_most=0)
    figures(f'capture over DDS, {name}: failures', len(failed), 'calls', over=len(outcomes),
            at_most=0)


@pytest.mark.parametrize('relation', RELATIONS)
def test_a_stream_is_captured_after_the_call(rig, effort, figures, relation):
    random, outcomes = Random(1), []
    with cameras(rig, RELATIONS[relation]):
        for _ in range(effort.count(5, 1000)):
            rig.spin(random.random() * 0.1)
            outcomes.append(captured(rig))
    judge(figures, relation, outcomes)
    assert not any('unknown' in answer.message for _, _, answer in outcomes)


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


def test_a_looped_clock_and_recording_are_captured_after_the_call(tmp_path, effort, figures):
    loop, random, outcomes = Loop(length=3.0), Random(1), []
    with prepared(tmp_path, use_sim_time=True) as rig:
        start, publisher = time.time_ns(), rig.node.create_publisher(Clock, '/clock', 10)

        def tick():
            msg = Clock()
            msg.clock.sec, msg.clock.nanosec = divmod(loop.time(time.time_ns() - start), NS)
            publisher.publish(msg)

        rig.node.create_timer(0.02, tick)
        with cameras(rig, lambda wall: loop.time(wall - start)):
            for _ in range(effort.count(15, 1000)):
                rig.spin(random.random() * 0.2)
                outcomes.append(captured(rig))
    judge(figures, 'looped /clock', outcomes)


def test_600_calls_that_wait_are_answered_by_one_pair(rig):
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
        rig.spin_until(lambda: all(future.done() for future in futures), 'all answers')
    answers = {future.result().message for future in futures}
    assert len(answers) == 1 and next(iter(answers)).startswith('stamp ')
    assert len(rig.acquired) == 1
    rig.diagnose(lambda p: values_of(p['range images'])[waiting] == '0', 'no call')


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
