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
"""Which pair answers a call: cameras, clocks and callers without ROS, the truth beside."""

from capture_world import EPOCH, Loop, NS, seconds, World

from color_stereo_ros.messages.capture_calls import Arrival, Basis, Call, CaptureCalls, Flow
from color_stereo_ros.messages.clock_relation import both_clocks, ClockRelation, Moment

import pytest

LOOP, COARSE, SLOW = Loop(), Loop(tick=0.1), Loop(rate=0.3)
CLOCKS = {
    "the node's": {},
    'TAI': {'stamp': lambda truth, wall: wall + 37 * NS},
    'ahead': {'stamp': lambda truth, wall: wall + seconds(0.3)},
    'a bit behind': {'stamp': lambda truth, wall: wall - seconds(0.5)},
    'behind 1 s': {'stamp': lambda truth, wall: wall - NS},
    'behind 20 s': {'stamp': lambda truth, wall: wall - 20 * NS},
    'behind 37 s': {'stamp': lambda truth, wall: wall - 37 * NS},
    'power-on': {'stamp': lambda truth, wall: truth + 2 * NS},
    'fast': {'stamp': lambda truth, wall: 9 * NS + truth + truth // 10_000},
    'slow': {'stamp': lambda truth, wall: 9 * NS + truth - truth // 10_000},
    'zero': {'stamp': lambda truth, wall: 0},
    'frozen': {'stamp': lambda truth, wall: 123_456_789},
    'looped recording': {'stamp': lambda truth, wall: LOOP.time(truth)},
    'looped /clock': {'stamp': lambda truth, wall: LOOP.time(truth), 'clock': LOOP},
    'coarse /clock': {'stamp': lambda truth, wall: COARSE.time(truth), 'clock': COARSE},
    'slow /clock': {'stamp': lambda truth, wall: SLOW.time(truth), 'clock': SLOW},
    'no /clock': {'clock': lambda truth: 0},
    'wall clock is set': {'wall': lambda truth: EPOCH + truth + truth // (7 * NS) % 2 * 3 * NS},
}
TRIGGERED = [name for name in CLOCKS if name != 'a bit behind']
"""The stamps of that one are believed: they are before the call."""
CAMERAS = {
    '10 Hz': {'period': 0.1},
    '30 Hz, late': {'period': 1 / 30, 'delay': 0.09},
    '5 Hz, later': {'period': 0.2, 'delay': 0.2, 'jitter': 0.02},
    '1 Hz': {'period': 1.0, 'delay': 0.1},
}


@pytest.mark.parametrize('clock', CLOCKS)
@pytest.mark.parametrize('camera', CAMERAS)
def test_a_stream_answers_with_a_pair_that_is_exposed_after_the_call(
        effort, figures, camera, clock):
    lies, failed, count = [], [], 0
    for seed in effort.seeds(1, 20):
        world = World(seed, **CAMERAS[camera], **CLOCKS[clock])
        world.run(4 + 4 * world.period)
        for _ in range(50):
            world.call()
            world.run(world.random.random() * 0.3)
        world.run(6.0)
        lies += world.lies()
        failed += world.failed
        count += len(world.answers)
    extreme = clock == 'slow /clock' and camera == '1 Hz'  # a period of 3 s in the node's time
    figures(f'capture, {clock}, {camera}: pairs from before the call', len(lies), 'pairs',
            over=count, at_most=0)
    figures(f'capture, {clock}, {camera}: calls without an answer', len(failed), 'calls',
            over=count, at_most=count if extreme else 0)
    assert count + len(failed) == 50 * len(effort.seeds(1, 20))


@pytest.mark.parametrize('clock', TRIGGERED)
@pytest.mark.parametrize('pause', [0.1, 1.5])
def test_a_trigger_is_answered_by_the_one_pair_that_comes(effort, figures, pause, clock):
    lies, failed, late = [], [], []
    for seed in effort.seeds(1, 20):
        world = World(seed, period=0, **CLOCKS[clock])
        world.run(2.0)
        for _ in range(30):
            world.call()
            world.run(pause + world.random.random() * 0.3)
        world.run(6.0)
        lies += world.lies()
        failed += world.failed
        late += [wait for wait in world.waits() if wait > 1.0]
    figures(f'capture by trigger, {clock}, every {pause} s: lies, failures, late ones',
            len(lies) + len(failed) + len(late), 'calls', over=effort.count(1, 20) * 30,
            at_most=0)


@pytest.mark.parametrize('clock', [name for name in CLOCKS if name not in ('zero', 'frozen')])
def test_pairs_that_are_held_up_are_not_taken_for_newer_ones(effort, figures, clock):
    lies = []
    for seed in effort.seeds(2, 40):
        world = World(seed, period=1 / 30, delay=0.07, stalls=0.002, **CLOCKS[clock])
        world.run(4.0)
        for _ in range(100):
            world.call()
            world.run(world.random.random() * 0.4)
        world.run(6.0)
        lies += world.lies()
    coarse = clock == 'coarse /clock'  # it hides by how much the first pairs were late
    figures(f'capture, {clock}, pairs held up by 0.5 s: pairs from before the call', len(lies),
            'pairs', over=effort.count(2, 40) * 100, at_most=len(lies) if coarse else 0)


@pytest.mark.parametrize('clock', TRIGGERED)
def test_a_stream_that_becomes_a_trigger_after_two_periods_is_answered(clock):
    world = World(3, **CLOCKS[clock])
    world.run(4.0)
    world.period = 0  # the stream ends
    world.run(0.65)
    for _ in range(20):
        world.call()
        world.run(0.3)
    assert not world.failed and not world.lies() and len(world.answers) == 20
    believed = clock in ("the node's", 'wall clock is set')
    assert {call.basis for call, _, _ in world.answers} == {
        Basis.STAMP if believed else Basis.FIRST}
    assert max(world.waits()) < 1.15  # once: its first pair might be of a stream that goes on
    assert max(world.waits()[4:]) < 0.15


@pytest.mark.parametrize('clock', CLOCKS)
@pytest.mark.parametrize('pause', [0.6, 2.0, 15.0])
def test_a_stream_that_pauses_and_goes_on_is_still_a_stream(effort, figures, pause, clock):
    lies, failed, count = [], [], 0
    for seed in effort.seeds(3, 200):
        world = World(seed, period=0.04, **CLOCKS[clock])
        world.run(3.0)
        for _ in range(4):
            world.pause(pause)
            world.go_on()
            world.run(world.random.random() * world.delay)
            world.call()
            world.run(1.5)
        world.run(6.0)
        lies += world.lies()
        failed += world.failed
        count += len(world.answers)
    figures(f'capture, {clock}, called as a stream goes on after {pause} s: pairs from before '
            'the call', len(lies), 'pairs', over=count, at_most=0)
    assert not failed


@pytest.mark.parametrize('clock', ['TAI', 'behind 1 s', 'zero'])
def test_pauses_of_a_busy_machine_follow_each_other(effort, figures, clock):
    lies, count = [], 0
    for seed in effort.seeds(5, 200):
        world = World(seed, period=0.04, **CLOCKS[clock])
        world.run(3.0)
        for _ in range(3):
            for _ in range(4):  # long ones are a habit
                world.pause(0.4 + 0.6 * world.random.random())
                world.go_on()
                world.run(0.2)
            world.pause(0.7)
            world.go_on()
            world.run(world.random.random() * world.delay)
            world.call()
            world.pause(0.7)  # no second pair comes for long
            world.go_on()
            world.run(3.0)
        lies += world.lies()
        count += len(world.answers)
    figures(f'capture, {clock}, pauses that follow each other: pairs from before the call',
            len(lies), 'pairs', over=count, at_most=0)


def test_a_pair_alone_answers_the_next_call_where_there_is_no_time_to_wait():
    calls = CaptureCalls(moment(0))
    for number in range(20):
        calls.add(pair(1 + 0.1 * number, stamp=EPOCH + seconds(38 + 0.1 * number)))
    late = Call(moment(5.0))
    calls.call(late)
    assert calls.add(pair(5.05, stamp=EPOCH + seconds(42.04))) == []
    assert calls.alone(seconds(5.2)) == ([], None)
    assert calls.expired(seconds(5.3), seconds(0.3)) == [late]
    following = Call(moment(7.0))
    calls.call(following)
    assert calls.add(pair(7.05, stamp=EPOCH + seconds(44.04))) == [following]
    assert following.basis is Basis.FIRST


@pytest.mark.parametrize('clock', ['TAI', 'behind 1 s', 'power-on', 'zero'])
def test_a_camera_that_starts_again_is_a_stream_again(clock):
    world = World(5, period=0.04, **CLOCKS[clock])
    world.run(3.0)
    for number in range(6):
        world.pause(1.0)
        started, kept = world.now, world.stamp
        world.stamp = lambda truth, wall: NS + truth - started  # its clock begins anew
        world.go_on()
        world.run(0.02)
        world.call()
        world.run(1.5)
        world.stamp = kept
    assert not world.lies() and not world.failed and len(world.answers) == 6


def test_a_burst_of_calls_and_pairs_after_a_stream_is_answered():
    world = World(3, **CLOCKS['TAI'])
    world.run(4.0)
    world.period = 0
    world.run(1.0)
    for _ in range(5):  # the pairs of the last ones come after the last call
        world.call()
        world.run(0.01)
    world.run(3.0)
    assert not world.failed and len(world.answers) == 5 and max(world.waits()) < 2.3


def test_clocks_are_read_again_where_the_thread_was_interrupted():
    steady, node = iter((0, 200_000_000, 200_000_001, 200_000_009)), iter((200_000_000, 7))
    assert both_clocks(lambda: next(node), lambda: next(steady)) == (200_000_001, 7)


def test_the_reading_of_the_clocks_that_took_least_counts():
    steady = iter((0, 9_000_000, 10, 5_000_010, 20, 6_000_020, 30, 7_000_030, 40, 8_000_040))
    assert both_clocks(lambda: 3, lambda: next(steady)) == (10, 3)


def moment(at):
    """Return a Moment of a wall clock, at s."""
    return Moment(seconds(at), EPOCH + seconds(at))


def pair(at, stamp=None, first=None):
    """Return a pair that comes at a moment, s; stamps in ns."""
    return Arrival(EPOCH + seconds(at) - NS // 100 if stamp is None else stamp,
                   seconds(at if first is None else first), moment(at))


def test_one_pair_answers_all_calls_that_wait_and_were_made_before_it():
    calls = CaptureCalls(moment(0))
    waiting = [Call(moment(5.0 + 0.001 * number)) for number in range(600)]
    for call in waiting:
        assert calls.call(call) is None
    late = Call(moment(6.0))
    calls.call(late)
    assert calls.add(pair(6.005, stamp=EPOCH + seconds(5.8))) == waiting
    assert calls.waiting == [late] and late.count == 1


def test_no_more_calls_wait_than_the_limit():
    calls = CaptureCalls(moment(0), limit=3)
    for _ in range(3):
        assert not calls.full
        calls.call(Call(moment(1.0)))
    assert calls.full
    calls.expired(seconds(7.0), seconds(5.0))
    assert not calls.full


def test_a_call_is_given_up_after_its_own_time():
    calls = CaptureCalls(moment(0))
    first, second = Call(moment(1.0)), Call(moment(2.0))
    calls.call(first), calls.call(second)
    assert calls.expired(seconds(5.9), seconds(5.0)) == []
    assert calls.expired(seconds(6.0), seconds(5.0)) == [first]
    assert calls.waiting == [second]


def test_a_pair_that_is_taken_before_the_call_it_came_after_answers_it():
    calls = CaptureCalls(moment(0))
    arrival = pair(5.01, stamp=0)
    assert calls.add(arrival) == []
    call = Call(moment(5.0))
    assert calls.call(call) is arrival and call.basis is Basis.FIRST
    assert calls.call(Call(moment(5.02))) is None  # came before this one


def test_an_old_pair_is_forgotten_but_still_counts_as_flow():
    calls = CaptureCalls(moment(0))
    calls.add(pair(5.0, stamp=0))
    calls.rest(seconds(6.0))
    assert calls._last.pair is None
    assert calls.flow.is_on(seconds(5.9)) and not calls.flow.is_on(seconds(6.1))


def test_one_image_from_before_the_call_spoils_a_pair():
    calls = CaptureCalls(moment(0))
    calls.call(Call(moment(5.0)))
    assert calls.add(pair(5.1, first=4.9)) == []
    assert len(calls.add(pair(5.2))) == 1


def test_a_capture_of_several_pairs_holds_other_calls():
    calls = CaptureCalls(moment(0))
    calls.call(Call(moment(5.0)))
    assert calls.add(pair(5.1), held=True) == []
    assert len(calls.add(pair(5.2))) == 1


def test_stamps_of_the_nodes_clock_count_to_the_nanosecond():
    calls = CaptureCalls(moment(0))
    for number in range(20):
        calls.add(pair(1 + 0.1 * number))
    call = Call(moment(3.0))
    calls.call(call)
    assert calls.add(pair(3.01, stamp=call.moment.node - 2000)) == []
    assert calls.add(pair(3.11, stamp=call.moment.node)) == [call] and call.basis is Basis.STAMP


def learned(offset=0.0, delay=0.01, jitter=0.0, count=120, drift=0.0, simulated=False):
    """Return a relation that was learned from pairs at 10 Hz."""
    relation = ClockRelation()
    for number in range(count):
        at = seconds(100 + 0.1 * number)
        late = seconds(delay + jitter * (number % 3) / 2)
        relation.note(EPOCH + at + seconds(offset) + round(at * drift),
                      Moment(at + late, EPOCH + at + late, simulated))
    return relation


@pytest.mark.parametrize('relation, sentence', [
    (learned(37.0, jitter=0.002), "stamps of the cameras are 37.0 s ahead of the node's clock, as "
     'TAI is (PTP), jitter 2 ms (learned from 120 pairs)'),
    (learned(-20.0), "stamps of the cameras are 20.0 s behind the node's clock, jitter 0 ms "
     '(learned from 120 pairs)'),
    (learned(0.06), "stamps of the cameras are 50 ms ahead of the node's clock, jitter 0 ms "
     '(learned from 120 pairs)'),
    (learned(-0.01, simulated=True), 'stamps of the cameras are 20 ms behind /clock, jitter 0 ms '
     '(learned from 120 pairs)'),
    (learned(count=1), "stamps of the cameras are of the node's clock: images arrive 10 ms after "
     'their stamp, jitter 0 ms (learned from 1 pair)'),
    (ClockRelation(), 'the clock of the cameras is unknown: no pair has arrived yet')])
def test_the_relation_is_said_in_one_sentence(relation, sentence):
    assert relation.sentence() == sentence


def test_zero_stamps_are_called_so():
    relation = learned()
    relation.note(0, moment(200))
    assert 'zero or stand still' in relation.sentence()


@pytest.mark.parametrize('drift', [0.0, 5e-5, -2e-4])
def test_the_drift_of_the_clock_is_found(drift):
    assert learned(500.0, count=600, drift=drift).drift == pytest.approx(drift, abs=1e-9)
    assert learned(500.0, count=200, drift=drift).drift is None


def test_the_fastest_pair_tells_when_others_would_have_come():
    relation = learned(37.0, delay=0.01)
    late = seconds(200.0)
    relation.note(EPOCH + seconds(37 + 112.0), Moment(seconds(112.6), EPOCH + seconds(112.6)))
    assert relation.earliest(EPOCH + seconds(37.0) + late) == late + seconds(0.01)


@pytest.mark.parametrize('period, delay, silence', [
    (0.02, 0.2, 0.5), (0.1, 0.3, 0.5), (0.2, 0.6, 0.5), (1.0, 1.0, 2.0)])
def test_delay_and_silence_follow_from_the_period(period, delay, silence):
    flow, before = Flow(0), None
    assert flow.delay(0) == NS and flow.is_on(NS - 1) and not flow.is_on(NS)
    for number in range(5):
        arrival = pair(1 + number * period)
        flow.note(arrival, before)
        before = arrival
    assert flow.delay(0) == pytest.approx(seconds(delay), rel=1e-6)
    end = before.moment.steady + seconds(silence)
    assert flow.is_on(end - 100_000) and not flow.is_on(end + 100_000)
