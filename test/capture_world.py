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
"""Cameras, clocks and callers without ROS: what a capture decides, with the truth beside."""

from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from random import Random

from color_stereo_ros.messages.capture_calls import Arrival, Call, CaptureCalls
from color_stereo_ros.messages.clock_relation import Moment

NS = 1_000_000_000
EPOCH = 1_790_000_000 * NS


def seconds(value):
    """Return s as ns."""
    return round(value * NS)


@dataclass
class World:
    """Two cameras as one, the node's clocks and callers; the truth is the steady clock."""

    seed: int = 0
    period: float = 0.1
    """s between two exposures; 0: the cameras wait for a trigger."""
    delay: float = 0.03
    """s from exposure to arrival at least."""
    jitter: float = 0.01
    """s, mean of what a pair is late beyond that."""
    stamp: object = None
    """Called with the truth and the wall clock, ns, returns the stamp; None: the wall clock."""
    clock: object = None
    """Called with the truth, ns, returns what /clock says; None: the node has the wall clock."""
    wall: object = None
    """Called with the truth, ns, returns what the wall clock says; None: it never jumps."""
    stalls: float = 0.0
    """Share of the pairs that come half a second late and hold up those behind them."""
    trigger_after: float = 0.02
    """s from a call to the exposure that it triggers."""
    tick: float = 0.05
    """s between two looks at calls whose pair has come alone."""

    def __post_init__(self):
        self.random = Random(self.seed)
        self.now = 0
        self.calls = CaptureCalls(self.moment())
        self.answers = []
        """(Call, exposure of the pair that answers it, when, all in ns of the truth)."""
        self.failed = []
        """Calls that were given up."""
        self._events, self._order, self._last_arrival = [], count(), 0
        self._at(self.tick * NS, self._look)
        if self.period:
            self._at(self.random.random() * self.period * NS, self._expose)

    def moment(self, at=None):
        """Return a Moment."""
        at = self.now if at is None else at
        if self.clock is not None:
            return Moment(at, self.clock(at), True)
        return Moment(at, self.wall_clock(at))

    def wall_clock(self, at):
        """Return what the wall clock says."""
        return (self.wall or (lambda truth: EPOCH + truth))(at)

    def _at(self, moment, action):
        heappush(self._events, (round(moment), next(self._order), action))

    def run(self, duration):
        """Let time go by, s."""
        end = self.now + seconds(duration)
        while self._events and self._events[0][0] <= end:
            self.now, _, action = heappop(self._events)
            action()
            self.failed += self.calls.expired(self.now, seconds(5.0))
        self.now = end
        self.failed += self.calls.expired(self.now, seconds(5.0))

    def _look(self):
        answered, arrival = self.calls.alone(self.now)
        if answered:
            self._note(answered, arrival)
        self._at(self.now + self.tick * NS, self._look)

    def _expose(self):
        if self.period:
            self.expose()
            self._at(self.now + self.period * NS, self._expose)

    def pause(self, length):
        """Expose nothing for so long, s; a pair that is exposed is still under way."""
        period, self.period = self.period, 0
        self.run(max(length, period))
        self.period = period

    def go_on(self):
        """Expose at once, and from now on."""
        self._expose()

    def expose(self):
        """Take a pair now."""
        exposed = self.now
        stamp = (self.stamp or (lambda _, wall: wall))(exposed, self.wall_clock(exposed))
        held_up = 0.5 if self.random.random() < self.stalls else 0.0
        late = self.delay + self.random.expovariate(1 / self.jitter) + held_up
        arrival = max(exposed + seconds(late), self._last_arrival + 1)
        self._last_arrival = arrival
        first = arrival - seconds(self.random.random() * 0.002)
        self._at(arrival, lambda: self._arrive(Arrival(stamp, first, self.moment(), exposed)))

    def _arrive(self, arrival):
        self._note(self.calls.add(arrival), arrival)

    def _note(self, answered, arrival):
        for call in answered:
            self.answers.append((call, arrival.pair, self.now))

    def call(self):
        """Call now; a camera that waits for a trigger gets one."""
        call = Call(self.moment(), self.now)
        arrival = self.calls.call(call)
        if arrival is not None:
            self._note([call], arrival)
        if not self.period:
            self._at(self.now + self.trigger_after * NS, self.expose)

    def lies(self):
        """Return by how much pairs were exposed before the call that they answer, ns."""
        return [call.answer - exposed for call, exposed, _ in self.answers
                if exposed < call.answer]

    def waits(self):
        """Return how long each call waited, s."""
        return [(when - call.answer) / NS for call, _, when in self.answers]


@dataclass
class Loop:
    """A /clock that is published so often, at a rate, and starts again."""

    length: float = 4.0
    rate: float = 1.0
    tick: float = 0.02
    start: float = 100.0

    def time(self, truth):
        """Return the exact time of the recording, ns."""
        return seconds(self.start) + round(truth * self.rate) % seconds(self.length)

    def __call__(self, truth):
        """Return what the latest message said, ns."""
        return self.time(truth // seconds(self.tick) * seconds(self.tick))
