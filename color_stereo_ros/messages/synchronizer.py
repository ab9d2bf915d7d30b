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
Pair left and right by stamp, and account for every message.

No ROS inside: items are any objects, stamps are integers in ns. With a tolerance below half the
frame period the partner is unique, so a pair is handed out as soon as its second item arrives.

"""

from collections import deque
from dataclasses import dataclass
from statistics import median
import threading
import time

SIDES = ('left', 'right')

_NS = 1_000_000_000
_JUMP_NS = _NS
"""A topic that goes back this far has jumped; less is a late message at first."""
_LATE_IN_A_ROW = 3
"""So many messages in a row behind the newest one are a jump as well: a short bag that loops."""
_PERIODS_KEPT = 16
_PERIODS_NEEDED = 3
_SKEWS_KEPT = 256
_ADAPTIVE_SHARE = 0.45
_ADAPTIVE_START_NS = 5_000_000
_ADAPTIVE_MAX_NS = 50_000_000
_SILENT_PERIODS = 5
_SILENT_AT_LEAST = 0.5
"""A camera that sends nothing for so many of its periods, and so many s, is silent."""
_ALONE = 4
"""So many left items without a right one in between are needed before one is handed out alone."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two items that belong together."""

    left: object
    right: object
    """None: the right camera is silent, see `Synchronizer.alone`."""
    stamp: int
    """Stamp of the left item, ns."""
    skew: int
    """Stamp of the right item minus stamp of the left one, ns."""
    arrival: float
    """When the second item was taken, s of `time.monotonic`."""
    received: tuple = None
    """
    When the middleware received the first and the second item, s of `time.monotonic`.

    None: as they were taken.
    """


class _Side:
    """What is known of one topic."""

    def __init__(self):
        self.waiting = {}  # arrival number -> (stamp, item, received), oldest arrival first
        self.received = 0
        self.unmatched = 0
        self.late = 0
        self.late_in_a_row = 0
        self.newest = None
        self.last_arrival = None
        self.periods = deque(maxlen=_PERIODS_KEPT)

    def drop(self, is_dropped):
        """Forget the waiting items whose stamp answers true; they stay without partner."""
        kept = {key: entry for key, entry in self.waiting.items() if not is_dropped(entry[0])}
        self.unmatched += len(self.waiting) - len(kept)
        self.waiting = kept

    def note(self, stamp):
        """Update newest stamp and periods."""
        if self.newest is not None and stamp > self.newest:
            self.periods.append(stamp - self.newest)
        if self.newest is None or stamp >= self.newest:
            self.newest = stamp
            self.late_in_a_row = 0

    def nearest(self, stamp, tolerance):
        """Return the key of the waiting item nearest to the stamp (the newest of equals)."""
        best = min(reversed(self.waiting.items()), default=None,
                   key=lambda entry: abs(entry[1][0] - stamp))
        return best[0] if best and abs(best[1][0] - stamp) <= tolerance else None


@dataclass(frozen=True)
class SyncReport:
    """The account of a synchronizer; dicts are by side."""

    received: dict
    unmatched: dict
    """Items that found no partner, the late ones included."""
    late: dict
    """Items that were older than the last pair when they arrived."""
    waiting: dict
    newest: dict
    """Newest stamps, ns, or None."""
    pairs: int
    jumps: int
    """How often time went back."""
    tolerance: int
    """In force now, ns."""
    period: object
    """Frame period of the faster camera, ns, or None."""
    skew_median: object
    """Median skew of the recent pairs, ns, or None."""
    skew_largest: object
    """Largest absolute skew of the recent pairs, ns, or None."""


class Synchronizer:
    """
    Pairs items of two topics.

    Every item that was received is handed out in a pair, is waiting, or is counted as unmatched.
    A pair is never older than the one before it, except after time itself has jumped back.

    Parameters
    ----------
    tolerance : float
        Largest difference of the stamps of a pair, s. 0 adapts to the cameras: a little less
        than half the measured frame period, at most 50 ms, and 5 ms until it is measured.
    queue_size : int
        Items of each topic that wait for their partner; the oldest leave first.
    clock : callable
        Returns s; only its differences matter.

    """

    def __init__(self, tolerance=0.0, queue_size=8, clock=time.monotonic):
        self.tolerance = tolerance
        self.queue_size = queue_size
        self._clock = clock
        self._sides = {side: _Side() for side in SIDES}
        self._pairs = 0
        self._jumps = 0
        self._arrivals = 0
        self._lefts_in_a_row = 0
        self._last_pair = None
        self._skews = deque(maxlen=_SKEWS_KEPT)
        self._quiet_since = clock()

    def add(self, side, stamp, item, received=None):
        """
        Take an item.

        Parameters
        ----------
        side : str
            'left' or 'right'.
        stamp : int
            ns.
        item : object
            What is to be paired.
        received : float, optional
            When the item was received, s of the clock; now, if it is not given.

        Returns
        -------
        pair : Pair or None
            The pair that the item completes.

        """
        own, other = self._sides[side], self._sides[SIDES[side == 'left']]
        own.received += 1
        self._lefts_in_a_row = self._lefts_in_a_row + 1 if side == 'left' else 0
        own.last_arrival = self._clock()
        received = own.last_arrival if received is None else received
        self._look_for_jump(own, stamp)
        own.note(stamp)
        if self._last_pair is not None and stamp < self._last_pair[side]:
            own.late += 1
            own.unmatched += 1
            return None
        partner = other.nearest(stamp, self.tolerance_now())
        if partner is None:
            self._enqueue(own, stamp, item, received)
            return None
        partner_stamp, partner_item, partner_received = other.waiting.pop(partner)
        stamps = (stamp, partner_stamp) if side == 'left' else (partner_stamp, stamp)
        items = (item, partner_item) if side == 'left' else (partner_item, item)
        return self._hand_out(stamps, items, tuple(sorted((partner_received, received))))

    def alone(self, stamp, item, patience):
        """
        Hand out a left item without a partner if the right topic alone is silent.

        It is if it has sent nothing for some periods, and for some left items in a row: after a
        pause of both topics the right item may just be the later one.

        Call it with an item for which `add` has found none.

        Parameters
        ----------
        stamp : int
            ns.
        item : object
            What is to be paired.
        patience : float
            See `complaint`.

        Returns
        -------
        pair : Pair or None

        """
        if self._lefts_in_a_row < _ALONE or not self._is_silent(self._sides['right'], patience):
            return None
        self._sides['left'].drop(lambda waiting: waiting <= stamp)
        self._last_pair = {'left': stamp, 'right': stamp - self.tolerance_now()}
        return Pair(item, None, stamp, 0, self._clock())

    def _enqueue(self, own, stamp, item, received):
        self._arrivals += 1
        own.waiting[self._arrivals] = (stamp, item, received)
        while len(own.waiting) > self.queue_size:
            del own.waiting[next(iter(own.waiting))]
            own.unmatched += 1

    def _hand_out(self, stamps, items, received):
        self._last_pair = dict(zip(SIDES, stamps))
        for side, stamp in self._last_pair.items():
            self._sides[side].drop(lambda waiting, limit=stamp: waiting <= limit)
        skew = stamps[1] - stamps[0]
        self._pairs += 1
        self._skews.append(skew)
        self._quiet_since = self._clock()
        return Pair(*items, stamps[0], skew, self._quiet_since, received)

    def _look_for_jump(self, own, stamp):
        """Start again when time goes back; a late message alone is not a jump."""
        if own.newest is None or stamp >= own.newest:
            return
        own.late_in_a_row += 1
        if own.newest - stamp >= _JUMP_NS or own.late_in_a_row >= _LATE_IN_A_ROW:
            self.jump_back(stamp)

    def jump_back(self, stamp):
        """
        Forget what lies after a moment, because time goes on from there.

        Items up to 1 s after it stay: they may already be of the new time.

        Parameters
        ----------
        stamp : int
            The present, ns.

        """
        self._jumps += 1
        self._last_pair = None
        for side in self._sides.values():
            side.drop(lambda waiting: waiting > stamp + _JUMP_NS)
            side.newest = None
            side.late_in_a_row = 0

    def period(self):
        """Return the frame period of the faster camera, ns, or None while it is unknown."""
        known = [median(side.periods) for side in self._sides.values()
                 if len(side.periods) >= _PERIODS_NEEDED]
        return int(min(known)) if known else None

    def tolerance_now(self):
        """Return the tolerance in force, ns."""
        if self.tolerance > 0:
            return round(self.tolerance * _NS)
        period = self.period()
        if period is None:
            return _ADAPTIVE_START_NS
        return min(int(period * _ADAPTIVE_SHARE), _ADAPTIVE_MAX_NS)

    def quiet_seconds(self):
        """Return for how long no pair has been found, s."""
        return self._clock() - self._quiet_since

    def complaint(self, patience):
        """
        Say why nothing pairs up.

        Parameters
        ----------
        patience : float
            s without a pair that are no reason to complain, and without an image that are none
            to call a camera silent whose frame period is unknown.

        Returns
        -------
        text : str or None
            None while pairs are found.

        """
        if self.quiet_seconds() <= patience:
            return None
        silent = [name for name, side in self._sides.items() if self._is_silent(side, patience)]
        quiet = f'no pair for {self.quiet_seconds():.1f} s: '
        if silent:
            others = [name for name in SIDES if name not in silent]
            return quiet + self._about_silence(silent) + (
                f', {others[0]} images do arrive' if others else '')
        return quiet + self._about_stamps()

    def _is_silent(self, side, patience):
        """Tell whether a camera sends nothing, by its own period where it is known."""
        if side.last_arrival is None:
            return True
        limit = patience
        if len(side.periods) >= _PERIODS_NEEDED:
            usual = max(_SILENT_PERIODS * median(side.periods) / _NS, _SILENT_AT_LEAST)
            limit = min(patience, usual)
        return self._clock() - side.last_arrival > limit

    def _about_silence(self, names):
        never = all(self._sides[name].last_arrival is None for name in names)
        return f'no {" and no ".join(names)} image {"has arrived yet" if never else "any more"}'

    def _about_stamps(self):
        left, right = (self._sides[name].newest for name in SIDES)
        if left is None or right is None:
            return 'the stamps have just jumped back'
        return (f'both images arrive, but their stamps differ by {abs(left - right) / 1e6:.1f} ms '
                f'(left {left / _NS:.6f} s, right {right / _NS:.6f} s), tolerance '
                f'{self.tolerance_now() / 1e6:.1f} ms')

    def report(self):
        """Return the account so far, a `SyncReport`."""
        def by_side(value):
            return {name: value(side) for name, side in self._sides.items()}
        return SyncReport(
            received=by_side(lambda side: side.received),
            unmatched=by_side(lambda side: side.unmatched),
            late=by_side(lambda side: side.late),
            waiting=by_side(lambda side: len(side.waiting)),
            newest=by_side(lambda side: side.newest),
            pairs=self._pairs, jumps=self._jumps, tolerance=self.tolerance_now(),
            period=self.period(),
            skew_median=median(self._skews) if self._skews else None,
            skew_largest=max(map(abs, self._skews)) if self._skews else None)


class LatestSlot:
    """A place for one thing between two threads: a newer one replaces one that nobody took."""

    def __init__(self):
        self._condition = threading.Condition()
        self._thing = None
        self._awake = False
        self.closed = False
        """Nothing comes any more."""
        self.replaced = 0
        """How many things were replaced before they were taken."""

    def put(self, thing):
        """Leave a thing, which replaces one that waits."""
        with self._condition:
            self.replaced += self._thing is not None
            self._thing = thing
            self._condition.notify()

    def take(self, timeout=None):
        """Wait for a thing; return None after `timeout` s, a `wake` or the end."""
        with self._condition:
            self._condition.wait_for(
                lambda: self._thing is not None or self._awake or self.closed, timeout)
            thing, self._thing, self._awake = self._thing, None, False
            return thing

    def wake(self):
        """Let the taker return at once, though there may be nothing to take."""
        with self._condition:
            self._awake = True
            self._condition.notify()

    def close(self):
        """Wake the taker for the last time and forget what waits."""
        with self._condition:
            self.closed = True
            self._thing = None
            self._condition.notify_all()
