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
How the clock of the cameras relates to ours, learned from when pairs arrive.

No ROS inside. A pair with stamp s arrives at a, after the delay d > 0 from exposure to arrival.
Let the cameras' clock be ahead of ours by the offset o. Then

    lag = a - s = d - o.

Arrivals alone give the lag, never d and o apart. The least lag of the recent pairs belongs to the
fastest of them, so s + min(lag) is when a pair would have arrived on the fastest path, whatever
held it up. It was exposed the least delay before.

"""

from collections import deque
from dataclasses import dataclass
import time

import numpy as np

_NS = 1_000_000_000
_KEPT = 64
_OLD = 10 * _NS
"""ns; older pairs no longer count: two clocks drift apart by up to 1 ms in this time."""
_PLAUSIBLE = _NS
"""ns; stamps that are older on arrival are of another clock, or of a delay that looks like it."""
_BLOCK, _BLOCKS, _BLOCKS_NEEDED = 10 * _NS, 30, 4
"""The drift is the slope of the least lags of blocks of so many ns."""
_TAI = 37.0
"""s by which TAI is ahead of UTC since 2017, until a leap second comes."""
_READINGS, _AT_ONCE = 5, 100_000
"""Clocks are read so often at most, until it takes less than so many ns."""
_DEAD = 1_000
"""ns; the stamp of a clock that stands still, or of none, says nothing."""


@dataclass(frozen=True)
class Moment:
    """A moment on both of our clocks."""

    steady: int
    """ns of a clock that never jumps."""
    node: int
    """ns of the clock of the node."""
    simulated: bool = False
    """The clock of the node follows /clock."""

    @property
    def follows_clock(self):
        """Return whether /clock is there and gives the node's time."""
        return self.simulated and self.node > 0

    @property
    def ours(self):
        """Return the ns that lags are measured by: those of /clock where it is followed."""
        return self.node if self.follows_clock else self.steady


def both_clocks(node, steady=time.monotonic_ns):
    """
    Return the steady clock and the node's, ns, read at the same moment.

    A thread that loses its processor between the two would see the node's clock jump. The reading
    that took least counts.

    Parameters
    ----------
    node, steady : callable
        Each returns ns.

    """
    readings = []
    for _ in range(_READINGS):
        before, present, after = steady(), node(), steady()
        readings.append((after - before, before, present))
        if after - before < _AT_ONCE:
            break
    return min(readings)[1:]


class ClockRelation:
    """Learns the relation from pairs; it starts again where time or stamps jump back."""

    def __init__(self):
        self._newest = None
        self.dead = False
        """The latest stamps are zero or stand still: they say nothing."""
        self.reset()

    def reset(self):
        """Forget what was learned."""
        self._moments = deque(maxlen=_KEPT)  # of arrival
        self._lags = deque(maxlen=_KEPT)  # by our clock, ns
        self._node_lags = deque(maxlen=_KEPT)  # by the node's clock, ns
        self._blocks = deque(maxlen=_BLOCKS)  # (block number, arrival and lag of its fastest pair)
        self._least = self._least_node = None  # lags of the fastest pair by ours and the node's
        self.learned = 0
        """Pairs that it was learned from."""

    def note(self, stamp, arrival):
        """
        Learn from a pair.

        Parameters
        ----------
        stamp : int
            ns, of the image that was exposed first.
        arrival : Moment
            Of the image that arrived last.

        """
        newest, self._newest = self._newest, stamp
        self.dead = stamp == 0 or newest is not None and abs(stamp - newest) < _DEAD
        if self.dead:
            self.reset()
            return
        if newest is not None and stamp < newest:
            self.reset()
        while self._moments and arrival.steady - self._moments[0].steady > _OLD:
            for kept in (self._moments, self._lags, self._node_lags):
                kept.popleft()
        self._moments.append(arrival)
        self._lags.append(arrival.ours - stamp)
        self._node_lags.append(arrival.node - stamp)
        self._least, self._least_node = min(self._lags), min(self._node_lags)
        self.learned += 1
        self._note_block(arrival, arrival.steady - stamp)

    def _note_block(self, arrival, lag):
        number = arrival.steady // _BLOCK
        if not self._blocks or self._blocks[-1][0] != number:
            self._blocks.append((number, arrival.steady, lag))
        elif lag < self._blocks[-1][2]:
            self._blocks[-1] = (number, arrival.steady, lag)

    @property
    def is_node_clock(self):
        """
        Return whether the stamps are believed to be of the node's clock.

        They are where the fastest pair arrived 0 .. 1 s after its stamp. A clock of the cameras
        that is ahead by less than the delay cannot be told from this. Stamps that follow /clock
        are learned: between two of its messages the node's clock stands still.

        """
        return bool(self._moments) and not self._moments[-1].simulated and (
            0 <= self._least_node < _PLAUSIBLE)

    def earliest(self, stamp):
        """Return when a pair with this stamp came at best, on the fastest path, ns of ours."""
        return stamp + self._least

    @property
    def jitter(self):
        """Return by how much 90 % of the pairs were at most later than the fastest one, s."""
        if not self._lags:
            return None
        # (integers: seconds since 1970 in ns exceed what a float64 resolves)
        late = [lag - self._least for lag in self._lags]
        return float(np.percentile(late, 90)) / _NS

    @property
    def ahead(self):
        """
        Return by how much the stamps are at least ahead of the node's clock, s; None: unknown.

        Negative: they are behind, or under way for so long.

        """
        return -self._least_node / _NS if self._moments else None

    @property
    def drift(self):
        """Return by how much the cameras' clock is too fast, s/s; None until a minute has gone."""
        if len(self._blocks) < _BLOCKS_NEEDED:
            return None
        _, *first = self._blocks[0]
        moments, lags = np.array([(moment - first[0], lag - first[1])
                                  for _, moment, lag in self._blocks], np.float64).T
        return -float(np.polyfit(moments, lags, 1)[0])

    def sentence(self):
        """Say what is known, for people."""
        if self.dead:
            return ('the stamps of the cameras are zero or stand still: only the arrival of the '
                    'images tells when they were exposed')
        if not self._moments:
            return 'the clock of the cameras is unknown: no pair has arrived yet'
        learned = (f'jitter {self.jitter * 1e3:.0f} ms (learned from {self.learned} '
                   f'{"pair" if self.learned == 1 else "pairs"})')
        if self.is_node_clock:
            return ("stamps of the cameras are of the node's clock: images arrive "
                    f'{-self.ahead * 1e3:.0f} ms after their stamp, {learned}')
        side = 'ahead of' if self.ahead > 0 else 'behind'
        clock = '/clock' if self._moments[-1].follows_clock else "the node's clock"
        tai = ', as TAI is (PTP)' if abs(self.ahead - _TAI) < _PLAUSIBLE / _NS else ''
        return (f'stamps of the cameras are {_duration(abs(self.ahead))} {side} {clock}{tai}, '
                f'{learned}')


def _duration(seconds):
    return f'{seconds * 1e3:.0f} ms' if seconds < 0.1 else f'{seconds:.1f} s'
