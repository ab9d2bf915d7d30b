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
"""Pairing by stamp, with plain objects."""

from random import Random
import threading

from color_stereo_ros.messages.synchronizer import LatestSlot, Synchronizer

import pytest

MS = 1_000_000
PERIOD = 33 * MS


class Clock:
    """A clock that the test turns."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Rig:
    """Feeds a synchronizer and remembers what it hands out."""

    def __init__(self, **options):
        self.clock = Clock()
        self.sync = Synchronizer(clock=self.clock, **options)
        self.pairs = []

    def feed(self, *messages):
        """Feed (side, ms) messages; the item is the message itself."""
        for side, stamp in messages:
            pair = self.sync.add(side, round(stamp * MS), (side, stamp))
            if pair is not None:
                self.pairs.append((pair.left[1], pair.right[1]))

    def stream(self, count, *, first=0, skew=0, period=33, left=True, right=True):
        """Feed both cameras at a fixed period, ms."""
        for index in range(first, first + count):
            if left:
                self.feed(('left', index * period))
            if right:
                self.feed(('right', index * period + skew))

    def accounted(self):
        """Tell whether every received item is in a pair, waiting or unmatched."""
        report = self.sync.report()
        return all(report.received[side] == report.pairs + report.unmatched[side]
                   + report.waiting[side] for side in ('left', 'right'))


def test_equal_stamps_pair_whichever_side_comes_first():
    rig = Rig()
    rig.feed(('left', 0), ('right', 0), ('right', 33), ('left', 33))
    assert rig.pairs == [(0, 0), (33, 33)]


def test_a_pair_tells_stamp_skew_and_arrival():
    rig = Rig()
    rig.sync.add('left', 10 * MS, 'a')
    rig.clock.now = 101.5
    pair = rig.sync.add('right', 12 * MS, 'b')
    assert (pair.left, pair.right, pair.stamp, pair.skew) == ('a', 'b', 10 * MS, 2 * MS)
    assert pair.arrival == 101.5


def test_the_adaptive_tolerance_stays_below_half_a_frame_period():
    rig = Rig()
    rig.stream(20)
    assert rig.sync.period() == PERIOD
    assert 0.4 * PERIOD < rig.sync.tolerance_now() < 0.5 * PERIOD


def test_the_adaptive_tolerance_pairs_a_skewed_stream_without_mixing_frames():
    rig = Rig()
    rig.stream(10, skew=0)
    rig.pairs.clear()
    rig.stream(50, first=10, skew=12)
    assert rig.pairs == [(33 * i, 33 * i + 12) for i in range(10, 60)]


def test_half_a_period_of_skew_is_refused():
    rig = Rig()
    rig.stream(30, skew=16.5)
    assert rig.pairs == []
    assert rig.accounted()


def test_a_fixed_tolerance_is_exact():
    rig = Rig(tolerance=0.002)
    rig.feed(('left', 0), ('right', 2))
    rig.feed(('left', 33), ('right', 35.1))
    assert rig.pairs == [(0, 2)]


def test_the_nearest_partner_wins():
    rig = Rig(tolerance=0.010)
    rig.feed(('left', 0), ('left', 6), ('right', 5))
    assert rig.pairs == [(6, 5)]


def test_one_camera_at_half_rate_pairs_every_frame_it_has():
    rig = Rig()
    for index in range(40):
        rig.feed(('left', index * 33))
        if index % 2 == 0:
            rig.feed(('right', index * 33))
    assert rig.pairs == [(33 * i, 33 * i) for i in range(0, 40, 2)]
    report = rig.sync.report()
    assert report.unmatched['right'] == 0
    assert rig.accounted()


def test_lost_frames_never_mix_pairs():
    rig = Rig()
    for index in range(200):
        if index % 7:
            rig.feed(('left', index * 33))
        if index % 11:
            rig.feed(('right', index * 33 + 1))
    assert rig.pairs == [(33 * i, 33 * i + 1) for i in range(200) if i % 7 and i % 11]
    assert rig.accounted()


@pytest.mark.parametrize('tolerance, most', [(0.014, 0), (0.0, 1e-4)])
def test_random_losses_delays_and_order_do_not_mix_pairs(tolerance, most, effort, figures):
    """The adaptive tolerance (0.0) may take the period of a stream with many gaps for double."""
    seeds = effort.seeds(20, 5000)
    mixed = lost = pairs = 0
    for seed in seeds:
        random = Random(seed)
        rig = Rig(queue_size=16, tolerance=tolerance)
        rig.stream(5)  # the period is known
        skew = random.uniform(-10, 10)
        arrivals = []  # when, side, frame: each message is late by up to three frames
        for index in range(5, 105):
            for side in ('left', 'right'):
                if random.random() > 0.1:
                    arrivals.append((index + random.choice((0, 0, 0, random.uniform(0, 3))),
                                     side, index))
        for _, side, index in sorted(arrivals):
            rig.feed((side, 33 * index + (skew if side == 'right' else 0)))
        mixed += sum(round(left / 33) != round((right - skew) / 33)
                     for left, right in rig.pairs[5:])
        pairs += len(rig.pairs)
        lost += not rig.accounted()
        stamps = [left for left, _ in rig.pairs]
        assert stamps == sorted(set(stamps)) or rig.sync.report().jumps
    name = f'pairing, tolerance {tolerance} s' if tolerance else 'pairing, adaptive tolerance'
    figures(f'{name}: pairs of different frames', mixed / pairs, 'of the pairs', over=seeds,
            at_most=most)
    figures(f'{name}: streams with unaccounted messages', lost, 'streams', over=seeds, at_most=0)


def test_bursts_pair_completely_as_long_as_the_queue_holds_them():
    rig = Rig(queue_size=8)
    rig.stream(8, right=False)
    rig.stream(8, left=False)
    assert [left for left, _ in rig.pairs] == [33 * i for i in range(8)]


def test_memory_stays_bounded_when_one_camera_is_dead():
    rig = Rig(queue_size=8)
    rig.stream(1000, right=False)
    report = rig.sync.report()
    assert report.waiting == {'left': 8, 'right': 0}
    assert report.unmatched['left'] == 992
    assert rig.accounted()


def test_a_late_message_is_counted_and_never_gives_a_stale_pair():
    rig = Rig()
    rig.stream(10)
    rig.feed(('left', 5 * 33))
    rig.stream(5, first=10)
    assert [left for left, _ in rig.pairs] == [33 * i for i in range(15)]
    report = rig.sync.report()
    assert (report.late['left'], report.jumps) == (1, 0)


def test_late_messages_that_interleave_still_find_their_waiting_partner():
    rig = Rig()
    rig.stream(5)
    rig.feed(('left', 5 * 33), ('left', 6 * 33), ('left', 7 * 33))
    rig.feed(('right', 6 * 33), ('right', 5 * 33), ('right', 7 * 33))
    assert [left for left, _ in rig.pairs[5:]] == [6 * 33, 7 * 33]
    assert rig.sync.report().jumps == 0
    assert rig.accounted()


@pytest.mark.parametrize('missing', [0, 7])
def test_a_looped_recording_pairs_as_well_in_every_pass(missing):
    rig = Rig()
    for _ in range(3):
        for index in range(100):
            rig.feed(('left', index * 33))
            if index < 100 - missing:
                rig.feed(('right', index * 33))
    assert len(rig.pairs) == 3 * (100 - missing)
    assert rig.sync.report().jumps >= 2
    assert rig.accounted()


def test_a_loop_shorter_than_a_second_is_found_after_three_messages():
    rig = Rig()
    for _ in range(4):
        rig.stream(10)
    assert len(rig.pairs) >= 10 + 3 * 7
    assert rig.pairs[-1] == (9 * 33, 9 * 33)


def test_a_loop_of_a_single_pair_pairs_every_time():
    rig = Rig()
    for _ in range(5):
        rig.stream(1)
    assert len(rig.pairs) == 5


def test_a_stamp_in_the_far_future_costs_nothing_but_itself():
    rig = Rig()
    rig.stream(10)
    rig.feed(('left', 10_000_000))
    rig.stream(10, first=10)
    assert [left for left, _ in rig.pairs] == [33 * i for i in range(20)]
    assert rig.accounted()


def test_a_clock_that_jumps_back_clears_what_lies_after_it():
    rig = Rig()
    rig.stream(5, first=1000)
    rig.feed(('left', 1005 * 33))
    rig.sync.jump_back(0)
    assert rig.sync.report().waiting == {'left': 0, 'right': 0}
    rig.stream(5)
    assert len(rig.pairs) == 10


def test_stamps_of_zero_pair_in_the_order_of_arrival():
    rig = Rig()
    for _ in range(4):
        rig.feed(('left', 0), ('right', 0))
    assert len(rig.pairs) == 4
    assert rig.sync.period() is None


def test_negative_stamps_are_stamps():
    rig = Rig()
    rig.feed(('left', -5), ('right', -5))
    assert rig.pairs == [(-5, -5)]


def test_no_complaint_before_the_patience_is_over():
    rig = Rig()
    rig.clock.now += 5.0
    assert rig.sync.complaint(5.0) is None


def test_the_complaint_says_that_nothing_has_arrived():
    rig = Rig()
    rig.clock.now += 6.0
    assert rig.sync.complaint(5.0) == (
        'no pair for 6.0 s: no left and no right image has arrived yet')


def test_the_complaint_names_the_missing_side():
    rig = Rig()
    rig.clock.now += 6.0
    rig.stream(3, right=False)
    assert rig.sync.complaint(5.0) == (
        'no pair for 6.0 s: no right image has arrived yet, left images do arrive')


def test_the_complaint_names_the_side_that_died():
    rig = Rig()
    rig.stream(5)
    rig.clock.now += 6.0
    rig.stream(3, first=5, left=False)
    assert 'no left image any more, right images do arrive' in rig.sync.complaint(5.0)


def test_the_complaint_tells_how_far_the_stamps_are_apart():
    rig = Rig()
    rig.clock.now += 6.0
    rig.stream(10, skew=214)
    text = rig.sync.complaint(5.0)
    assert 'stamps differ by 214.0 ms' in text
    assert 'tolerance 14.8 ms' in text


@pytest.mark.parametrize('silent, words', [
    (0.1, 'both images arrive, but their stamps differ by'),
    (0.6, 'no right image any more, left images do arrive')])
def test_a_camera_is_called_silent_by_its_own_period(silent, words):
    """A camera of 30 Hz that paused for 0.1 s still arrives; after 0.6 s it does not."""
    rig = Rig()
    rig.clock.now += 6.0
    rig.stream(10, skew=214)
    rig.clock.now += silent
    rig.stream(3, first=10, right=False)
    assert words in rig.sync.complaint(5.0)


@pytest.mark.parametrize('patience', [0.0, 5.0])
def test_no_camera_is_called_silent_that_has_just_sent(patience):
    rig = Rig()
    rig.clock.now += 6.0
    rig.stream(10, skew=214)
    assert 'both images arrive' in rig.sync.complaint(patience)


def test_a_pair_ends_the_complaint():
    rig = Rig()
    rig.clock.now += 6.0
    rig.stream(1)
    assert rig.sync.complaint(5.0) is None


def test_the_report_gives_the_skew():
    rig = Rig()
    rig.stream(5)
    rig.stream(5, first=5, skew=-3)
    report = rig.sync.report()
    assert report.skew_largest == 3 * MS
    assert report.skew_median == -1.5 * MS
    assert report.pairs == 10


def test_a_slot_keeps_the_latest_and_counts_the_others():
    slot = LatestSlot()
    for thing in range(4):
        slot.put(thing)
    assert slot.take() == 3
    assert slot.replaced == 3
    assert slot.take(timeout=0.0) is None


def test_closing_a_slot_wakes_the_taker():
    slot = LatestSlot()
    taken = []
    thread = threading.Thread(target=lambda: taken.append(slot.take()))
    thread.start()
    slot.close()
    thread.join(10.0)
    assert taken == [None]
    assert slot.closed


def test_a_left_item_is_handed_out_alone_where_the_right_topic_alone_is_silent():
    now = [0.0]
    synchronizer = Synchronizer(0.01, clock=lambda: now[0])
    for stamp in range(5):
        now[0] += 0.1
        synchronizer.add('left', stamp * 100 * MS, stamp)
        assert synchronizer.add('right', stamp * 100 * MS, stamp) is not None
    now[0] += 3.0  # both pause: the left item that comes first is not alone
    assert synchronizer.add('left', 3500 * MS, 'late') is None
    assert synchronizer.alone(3500 * MS, 'late', 2.0) is None
    assert synchronizer.add('right', 3500 * MS, 'late').left == 'late'
    alone = []
    for stamp in range(3600, 5000, 100):
        now[0] += 0.1
        assert synchronizer.add('left', stamp * MS, stamp) is None
        alone.append(synchronizer.alone(stamp * MS, stamp, 2.0))
    assert alone[0] is None and alone[-1].left == 4900 and alone[-1].right is None
    now[0] += 0.1
    synchronizer.add('right', 5000 * MS, 'back')
    assert synchronizer.add('left', 5000 * MS, 'back').right == 'back'
