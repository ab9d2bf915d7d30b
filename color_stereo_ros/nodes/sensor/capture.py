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
"""The service ~/capture: measures a pair, or several, that are exposed after the call."""

from dataclasses import dataclass, field, replace
import threading
import time

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile

from std_msgs.msg import Header

from ..filling import message_of
from ...core.fusion import Fusion
from ...messages.capture_calls import Arrival, Basis, Call, CaptureCalls
from ...messages.clock_relation import both_clocks, Moment

_NS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a call gets: a result, or why there is none."""

    failure: str = ''
    result: object = None
    context: object = None
    """messages.outputs.Context of the result."""
    note: str = ''
    """What a caller should know about the result."""
    pair: object = None
    """The last pair that it is from."""


@dataclass(eq=False)
class Shot:
    """The pairs that answer some calls."""

    calls: list
    wanted: int
    """Pairs that are fused."""
    fusion: Fusion | None
    """None: one pair is not fused."""
    measured: int = 0
    pending: float | None = None
    """Arrival of the pair that is being measured, s; None: the next pair is awaited."""
    since: float = field(default_factory=time.monotonic)
    """When the last pair was taken or measured, s."""

    @property
    def complete(self):
        """Return whether all pairs have been measured."""
        return self.measured == self.wanted

    def awaits(self, pair):
        """Tell whether a measured pair is the one that is pending, or a later one."""
        return self.pending is not None and self.pending <= pair.arrival


class Capture:
    """
    Finds pairs for the calls, and says on ~/acquired when the last image is there.

    Parameters
    ----------
    node : rclpy.node.Node
    services : ServiceThread
    sensor : RangeSensor

    """

    def __init__(self, node, services, sensor):
        self._node, self._services, self._sensor = node, services, sensor
        self._lock = threading.Lock()
        self._calls = CaptureCalls(self._moment())
        self._shots = []
        self._measured = 0.0  # arrival of the latest pair that was measured, s
        self.latest = None
        """The last Outcome with a result, or None."""
        self._acquired = node.create_publisher(
            Header, '~/acquired', QoSProfile(depth=1),
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))  # see `qos`
        services.create('~/capture', lambda reply: self.request(
            reply, lambda outcome: reply(*_answer(outcome))))
        services.on_tick(self._look_at_time)
        services.on_end(lambda: self._fail_all('the node is shutting down'))

    def _moment(self, steady=None):
        """Return a Moment of our clocks; hold the lock, so that they follow each other."""
        clock = self._node.get_clock()
        present, node = both_clocks(lambda: clock.now().nanoseconds)
        if clock.ros_time_is_active:
            return Moment(present if steady is None else round(steady * _NS), node, True)
        past = 0 if steady is None else present - round(steady * _NS)
        return Moment(present - past, node - past)

    @property
    def relation(self):
        """Return what is known of the clock of the cameras, a ClockRelation."""
        return self._calls.relation

    @property
    def waiting(self):
        """Return how many calls wait for their answer."""
        with self._lock:
            return len(self._calls.waiting) + sum(len(shot.calls) for shot in self._shots)

    # ---- calls, in the thread of the services

    def request(self, reply, done):
        """
        Ask for a capture.

        Parameters
        ----------
        reply : services.Reply
            Of the call.
        done : callable
            Called with the Outcome in the thread of the services.

        """
        if not self._sensor.active:
            done(Outcome('the node is inactive'))
            return
        with self._lock:
            if self._calls.full:
                done(Outcome(f'{self._calls.limit} calls wait already'))
                return
            call = Call(self._moment(reply.received), done, sent=self._moment(reply.sent))
            arrival = self._calls.call(call, held=self._holds())
            if arrival is not None:
                self._begin([call], arrival.pair)

    def _look_at_time(self):
        """Give up what waits for longer than capture.timeout."""
        timeout = self._sensor.settings.capture.timeout
        now = time.monotonic()
        with self._lock:
            self._calls.rest(round(now * _NS))
            if not self._holds():
                self._answer_by_pair_alone(round(now * _NS))
            calls = [] if self._holds() else self._calls.expired(
                round(now * _NS), round(timeout * _NS))
            late = [shot for shot in self._shots if self._is_over(shot, now, timeout)]
            self._shots = [shot for shot in self._shots if shot not in late]
        for call in calls:
            call.answer(Outcome(self._sensor.why_no_result(timeout,
                                                           self._about_pairs(call, timeout))))
        for shot in late:
            begun = (f'only {shot.measured} of {shot.wanted} pairs have come: '
                     if shot.pending is None else '')
            self._finish(shot, Outcome(begun + self._sensor.why_no_result(timeout)))

    def _answer_by_pair_alone(self, now):
        calls, arrival = self._calls.alone(now)
        if calls:
            self._begin(calls, arrival.pair)

    def _is_over(self, shot, now, timeout):
        """Tell whether the next pair is overdue, or nothing can be measured yet."""
        if shot.pending is None:
            return now - shot.since > timeout
        waited = now - min(call.moment.steady for call in shot.calls) / _NS
        return self._sensor.worker.state != 'ready' and waited > timeout

    def _about_pairs(self, call, timeout):
        """Say what came since a call, for want of a better reason; None: nothing came."""
        if not call.count:
            return None
        latest = (call.passed[-1].steady - call.moment.steady) / _NS
        if call.moment.simulated and call.passed[-1].node == call.moment.node:
            return ("the node's clock stands still: use_sim_time is true, and /clock brings "
                    'nothing new')
        have = '1 pair has' if call.count == 1 else f'{call.count} pairs have'
        return (f'{have} arrived within {timeout:.1f} s after the call, the last one {latest:.2f} '
                's after it, but none was surely exposed after the call: '
                f'{self.relation.sentence()}')

    # ---- pairs, in the executor's thread

    def note(self, pair):
        """Learn from a pair that nobody may ask for."""
        with self._lock:
            self._calls.add(self._arrival(pair), held=True)

    def takes(self, pair):
        """Tell whether a pair must be measured for a call."""
        with self._lock:
            held = self._holds()
            answered = self._calls.add(self._arrival(pair), held=held)
            if answered:
                self._open(answered)
            ready = [shot for shot in self._shots
                     if shot.pending is None and not shot.complete]
            self._expect(ready, pair)
            return bool(ready)

    def _arrival(self, pair):
        first, second = pair.received or (pair.arrival, pair.arrival)
        return Arrival(pair.stamp + min(pair.skew, 0), round(first * _NS), self._moment(second),
                       pair)

    def _holds(self):
        """Tell whether a capture of several pairs is under way; another one waits."""
        return any(shot.wanted > 1 for shot in self._shots)

    def _open(self, calls):
        wanted = self._sensor.settings.capture.pairs
        shot = Shot(calls, wanted, Fusion() if wanted > 1 else None)
        self._shots.append(shot)
        return shot

    def _begin(self, calls, pair):
        """Let a pair that came before answer calls; it may be measured already."""
        wanted = self._sensor.settings.capture.pairs
        shot = next((shot for shot in self._shots if wanted == 1 and shot.awaits(pair)), None)
        if shot is not None:
            shot.calls += calls
        elif wanted == 1 and self.latest is not None and self.latest.pair is pair:
            for call in calls:
                self._tell(call, self.latest)
        else:
            self._expect([self._open(calls)], pair)
            if not self._sensor.streams or self._measured >= pair.arrival:
                self._sensor.worker.submit(pair)  # else the worker has it already

    def _expect(self, shots, pair):
        for shot in shots:
            shot.pending, shot.since = pair.arrival, time.monotonic()
        if any(shot.measured + 1 == shot.wanted for shot in shots):
            self._acquired.publish(message_of(pair.left.header))

    # ---- results, in the worker's thread

    def merged(self, pair, result):
        """
        Return what is published of a pair that was measured: its result, or the fused one.

        None: the pair is one of several that are fused, and nothing but captures is published.

        """
        with self._lock:
            self._measured = pair.arrival
            shots = [shot for shot in self._shots if shot.awaits(pair)]
        publish = self._sensor.settings.input.mode == 'stream' or not shots
        for shot in shots:
            if shot.fusion is not None:
                shot.fusion.add(result)
        fused = None
        with self._lock:
            for shot in shots:
                shot.measured += 1
                shot.pending, shot.since = None, time.monotonic()
                if shot.complete:
                    fused = shot.fusion if shot.fusion is not None else fused
                    publish = True
        if fused is not None:
            return fused.result()
        return result if publish else None

    def succeed(self, pair, result, context):
        """Answer the calls of the captures that a published result completes."""
        with self._lock:
            done = [shot for shot in self._shots if shot.complete]
            self._shots = [shot for shot in self._shots if not shot.complete]
        for shot in done:
            note = _about(shot)
            self.latest = Outcome('', result, context, note, pair)
            self._finish(shot, self.latest)

    def fail(self, pair, text):
        """Answer the calls of the captures that lose a pair with the reason."""
        with self._lock:
            self._measured = max(self._measured, pair.arrival)
            lost = [shot for shot in self._shots if shot.complete or shot.awaits(pair)]
            self._shots = [shot for shot in self._shots if shot not in lost]
        for shot in lost:
            self._finish(shot, Outcome(text))

    def _finish(self, shot, outcome):
        for call in shot.calls:
            self._tell(call, outcome)

    def _tell(self, call, outcome):
        if call.basis is Basis.FIRST and outcome.result is not None:
            outcome = replace(outcome, note='; '.join(filter(None, (outcome.note, _UNKNOWN))))
        self._services.post(lambda: call.answer(outcome))

    def _fail_all(self, text):
        """Answer all calls that wait."""
        with self._lock:
            calls = [*self._calls.waiting, *(call for shot in self._shots for call in shot.calls)]
            self._calls.waiting, self._shots = [], []
        for call in calls:
            call.answer(Outcome(text))

    def destroy(self):
        """Leave ~/acquired; the service ends with its thread."""
        self._node.destroy_publisher(self._acquired)


_UNKNOWN = ('the clock of the cameras is unknown: this is the first pair that came after the call')


def _about(shot):
    """Return what a caller should know of a fused result."""
    if shot.fusion is None:
        return ''
    return f'fused from {shot.wanted} pairs' + shot.fusion.about_motion()


def _answer(outcome):
    """Return success and message of a response."""
    if outcome.result is None:
        return False, outcome.failure
    stamp = outcome.context.header.stamp
    text = (f'stamp {stamp.sec}.{stamp.nanosec:09d}: '
            f'{outcome.result.density:.1%} of the pixels have a range')
    return True, '; '.join(filter(None, (text, outcome.note)))
