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
"""
Which pair answers a call of ~/capture: one that is exposed after the call.

A state machine of plain numbers. Its events are calls and pairs, each with its moment on our
clocks; jumps of time show in them. See docs/capture.md for the reasons behind the rules.

"""

from collections import deque
from dataclasses import dataclass, field, replace
from enum import Enum
from statistics import median

from .clock_relation import ClockRelation, Moment

LIMIT = 1000
"""Calls that may wait at the same time."""

_NS = 1_000_000_000
_GAPS_KEPT, _GAPS_NEEDED = 16, 3
_PERIODS_OF_DELAY = 3
_DELAY_LEAST, _DELAY_MOST = _NS // 5, _NS
_PERIODS_OF_SILENCE = 2
_SILENCE_LEAST = _NS // 2
"""ns; a sender on a busy machine pauses for less."""
_SILENCE = _NS
"""ns of silence after which nothing flows while the period is unknown."""
_GAPS_OF_PATIENCE, _LONG_KEPT = 2, 64
"""A pair has come alone where nothing has followed for so many of the longest recent gaps,"""
_PATIENCE_MOST = 2 * _NS
"""or for so long, ns: callers wait."""
_SLACK = 5_000_000
"""ns by which two clocks may have drifted since the fastest pair came."""
_CLOCK_SLACK = _NS // 4
"""ns by which /clock may lag behind itself: it stands still between two messages."""
_TRUSTED = 16
"""So many pairs hold a fast one, even where many were held up."""
_REMEMBERED = _NS // 2
"""ns by which a call may be taken later than a pair that came after it."""
_STEP = _NS // 10
"""ns by which the node's clock and the steady one disagree when the former is set."""


class Basis(Enum):
    """Why a pair counts as exposed after a call."""

    STAMP = 'its stamp is later than the call'
    LEARNED = 'it came so late that it was exposed after the call'
    FIRST = 'it is the first one that came after the call'


@dataclass(frozen=True, eq=False)
class Arrival:
    """A pair of images that has arrived."""

    stamp: int
    """ns, of the image that was exposed first."""
    first: int
    """When the first of the two images came, ns of the steady clock."""
    moment: Moment
    """When the second one came."""
    pair: object = None
    """The pair itself."""


@dataclass(eq=False)
class Call:
    """A call that waits for a pair."""

    moment: Moment
    """When it was received."""
    answer: object = None
    """What the owner needs to answer it."""
    basis: Basis | None = None
    """Why the pair that answers it counts; None while it waits."""
    sent: Moment | None = None
    """When it was sent, as far as the caller's clock can be believed; None: as it was received."""
    passed: list = field(default_factory=list)
    """Moments of the first and of the latest pair that came since, but did not count."""
    count: int = 0
    """Number of these pairs."""
    first: Arrival | None = None
    """The pair that answers it if none follows: whether a stream goes on with it is open."""

    def pass_over(self, arrival):
        """Take down a pair that does not count."""
        self.count += 1
        self.passed = [*self.passed[:1], arrival.moment]


class Flow:
    """Pairs that come without a call: how often, and when the last one came."""

    def __init__(self, start):
        self._last = start
        self._stamp = None
        self._gaps = deque(maxlen=_GAPS_KEPT)  # (steady, ours), ns
        self._recent = deque(maxlen=_LONG_KEPT)  # steady, ns
        self._firsts = deque(maxlen=_GAPS_KEPT)  # arrivals of all pairs, ns

    def see(self, arrival):
        """Take down that a pair has come, asked for or not."""
        self._firsts.append(arrival.first)

    def note(self, arrival, before):
        """Take down a pair that no call has asked for, and the one before it."""
        self._last, self._stamp = arrival.moment.steady, arrival.stamp
        if before is None:
            return
        gap = (arrival.moment.steady - before.moment.steady,
               arrival.moment.ours - before.moment.ours)
        if min(gap) >= 0:
            self._gaps.append(gap)
            self._recent.append(gap[0])

    def _period(self, clock):
        """Return the median time between pairs, ns of the steady clock (0) or of ours (1)."""
        if len(self._gaps) < _GAPS_NEEDED:
            return None
        return median(gap[clock] for gap in self._gaps)

    @property
    def silence(self):
        """Return for how long nothing comes where nothing flows, ns."""
        period = self._period(0)
        return _SILENCE if period is None else max(_PERIODS_OF_SILENCE * period, _SILENCE_LEAST)

    def is_on(self, steady):
        """Tell whether pairs flow at a moment: the last one came within two periods."""
        return steady - self._last < self.silence

    @property
    def has_been(self):
        """Return whether pairs have flowed: what was a stream may only have paused."""
        return self._period(0) is not None

    @property
    def patience(self):
        """Return for how long nothing follows a pair that is not of a stream, ns."""
        gaps = _GAPS_OF_PATIENCE * max(self._recent, default=0)
        return max(self.silence, _SILENCE, min(gaps, _PATIENCE_MOST))

    def end(self):
        """Forget the stream: a pair came alone."""
        self._gaps.clear()
        self._recent.clear()
        self._stamp = None

    def forget_stamp(self):
        """Forget what the next stamp is compared with: stamps have jumped."""
        self._stamp = None

    def goes_on(self, stamp, clock):
        """Tell whether a pair was exposed so soon after the last one that none is missing."""
        period = self._period(clock)
        return period is not None and self._stamp is not None and (
            0 < stamp - self._stamp < _PERIODS_OF_SILENCE * period)

    def delay(self, clock):
        """
        Return the longest delay of the fastest pair that is presumed, ns.

        A camera that keeps up exposes, reads out and transfers within a period each.

        """
        period = self._period(clock)
        if period is None:
            return _DELAY_MOST
        return min(max(_PERIODS_OF_DELAY * period, _DELAY_LEAST), _DELAY_MOST)

    def earliest(self):
        """Return when the latest pair would have come if none was held up, by counting, ns."""
        period = self._period(0) or 0
        return min(first + age * period for age, first in enumerate(reversed(self._firsts)))


class CaptureCalls:
    """
    The calls that wait, what is known of the cameras' clock, and how both meet.

    Parameters
    ----------
    start : Moment
        From when on pairs would have been seen.
    limit : int
        Calls that may wait.

    """

    def __init__(self, start, limit=LIMIT):
        self.limit = limit
        self.relation = ClockRelation()
        self.flow = Flow(start.steady)
        self.waiting = []
        """The calls that no pair answers yet, oldest first."""
        self._seen = start
        self._before = self._last = None
        self._is_asked = True
        self._is_called = False  # since the last pair

    @property
    def full(self):
        """Return whether no other call may wait."""
        return len(self.waiting) >= self.limit

    def call(self, call, held=False):
        """
        Take a call.

        The last pair may answer it: what came after the call may be taken before it.

        Parameters
        ----------
        call : Call
            Of the service.
        held : bool
            A capture of several pairs is under way: no pair answers the call yet.

        Returns
        -------
        arrival : Arrival or None
            The pair that answers it; None: it waits.

        """
        self._look(call.moment)
        if not held and not self._is_asked and self._answers(call, self._last):
            self._is_asked = True
            return self._last
        self._is_called = self._is_called or call.first is None
        self._is_asked = self._is_asked or call.first is not None
        self._settle()
        self.waiting.append(call)
        return None

    def add(self, arrival, held=False):
        """
        Take a pair.

        Parameters
        ----------
        arrival : Arrival
            The pair and when it came.
        held : bool
            It belongs to a capture of several pairs: it answers no call.

        Returns
        -------
        answered : list of Call
            The calls that it answers.

        """
        self._look(arrival.moment)
        if not self._is_called and self._open():
            self._go_on(arrival)
        self._is_called = False
        self._settle()
        flows = self.flow.is_on(arrival.moment.steady)
        self._before, self._last, self._is_asked = self._last, arrival, held and not flows
        self.relation.note(arrival.stamp, arrival.moment)
        if self.relation.learned == 1:  # of other stamps than those before
            self.flow.forget_stamp()
        self.flow.see(arrival)
        if held:
            return []
        answered = [call for call in self.waiting if self._answers(call, arrival)]
        self.waiting = [call for call in self.waiting if call.basis is None]
        for call in self.waiting:
            call.pass_over(arrival)
        flows = flows or self._goes_on(arrival) or any(
            call.basis is Basis.LEARNED for call in answered)
        asked = answered or any(call.first is arrival for call in self.waiting)
        self._is_asked = bool(asked) and not flows
        if answered or self.waiting:
            self._settle()
        return answered

    def expired(self, now, timeout):
        """
        Remove and return the calls that have waited for too long.

        Parameters
        ----------
        now : int
            ns of the steady clock.
        timeout : int
            ns.

        """
        over = [call for call in self.waiting if now - call.moment.steady >= timeout]
        if any(call.first is not None for call in over):
            self.flow.end()  # else a pair that comes alone would never answer in time
        self.waiting = [call for call in self.waiting if now - call.moment.steady < timeout]
        return over

    def _open(self):
        """Return the calls of which it is open whether a stream goes on."""
        return [call for call in self.waiting if call.first is not None]

    def _go_on(self, arrival):
        """Count the last pair to the flow: one that nobody has asked for follows it."""
        self._is_asked = False
        for call in self._open():
            call.first = arrival

    def alone(self, now):
        """
        Remove and return the calls whose first pair came alone: no stream went on with it.

        Parameters
        ----------
        now : int
            ns of the steady clock.

        Returns
        -------
        answered : list of Call
        arrival : Arrival or None
            The pair that answers them all, the first one after the latest of them.

        """
        found = self._open()
        if not found or now - found[0].first.moment.steady < self.flow.patience:
            return [], None
        self.flow.end()
        arrival = found[-1].first
        for call in found:
            call.first, call.basis = None, Basis.FIRST
        self.waiting = [call for call in self.waiting if call.basis is None]
        return found, arrival

    def rest(self, now):
        """Let go of the last pair if it is old, ns of the steady clock: no call will want it."""
        if self._last is not None and now - self._last.moment.steady > _REMEMBERED:
            self._settle()
            self._last = replace(self._last, pair=None)

    def _settle(self):
        """Count the last pair to the flow if no call has asked for it."""
        if not self._is_asked:
            self.flow.note(self._last, self._before)
            self._is_asked = True

    def _look(self, moment):
        """Start to learn again where the node's clock was set, stopped or turned back."""
        seen, self._seen = self._seen, moment
        if (moment.simulated, moment.follows_clock) != (seen.simulated, seen.follows_clock):
            jumped = True
        elif moment.simulated:
            jumped = moment.node < seen.node
        else:
            jumped = abs(moment.node - moment.steady - seen.node + seen.steady) > _STEP
        if jumped:
            self.relation.reset()
            for call in self.waiting:
                if call.moment.node > moment.node:  # stamps go on from here
                    call.moment = replace(call.moment, node=moment.node)
                    call.sent = None

    def _answers(self, call, arrival):
        """Tell whether a pair counts as exposed after a call, and note in the call why."""
        call.basis = self._basis(call, arrival)
        return call.basis is not None

    def _basis(self, call, arrival):
        flows = self.flow.is_on(call.moment.steady) or self._goes_on(arrival)
        # a trigger's one pair may overtake the call; a stream brings another one
        since = call.moment if flows or call.sent is None else call.sent
        if arrival.first < since.steady:
            return None
        if self.relation.is_node_clock and not self.relation.dead:
            return Basis.STAMP if arrival.stamp >= since.node else None
        clock = self._clock(arrival)
        late = self._lateness(since, arrival, clock)
        if flows:
            sure = late >= self.flow.delay(clock) and self._is_late_by_counting(call, clock)
            return Basis.LEARNED if sure else None
        if late < -(_CLOCK_SLACK if clock else _SLACK):
            return None
        if self.flow.has_been:
            call.first = call.first or arrival
            return None
        return Basis.FIRST

    def _clock(self, arrival):
        """Return the clock that counts: 0 the steady one, 1 ours."""
        return int(not self.relation.dead and arrival.moment.follows_clock)

    def _goes_on(self, arrival):
        """Tell whether a pair belongs to the flow by its stamp, however late it comes."""
        return not self.relation.dead and self.flow.goes_on(arrival.stamp, self._clock(arrival))

    def _lateness(self, since, arrival, clock):
        """Return how long after a Moment a pair came, or would have on the fastest path, ns."""
        if self.relation.dead:
            return arrival.first - since.steady
        return self.relation.earliest(arrival.stamp) - (since.node if clock else since.steady)

    def _is_late_by_counting(self, call, clock):
        """
        Tell the same without stamps, as long as they have not told much.

        So where /clock counts: a busy node takes its messages late, and a call seems earlier.

        """
        if self.relation.learned >= _TRUSTED and not self.relation.dead and not clock:
            return True
        return self.flow.earliest() - call.moment.steady >= self.flow.delay(0)
