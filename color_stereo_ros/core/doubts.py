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
"""What is odd about a stream of pairs, at a bounded cost: for the nodes and for recordings."""

import re
import time

from .account import (are_gray, doubt_about_ranges, doubt_about_rivals, doubts_about_features,
                      doubts_about_images, doubts_about_order, doubts_about_rows, exposure_of,
                      status_shares, SUSPICIOUS)
from .patterns.seen import pattern_seen

_PERIOD = 0.5
"""s between two looks at the images."""
_LONGEST = 5.0
"""s between two tries of the other order, while few pixels have a range and nothing changes."""
_SIGHT = 2.0
"""s between two looks at exposure, pattern and the size of its structures: 13 ms."""
_SHARE = 5
"""The other order takes at most one part of so many parts of the time, and one more."""
_ROWS = 4
"""Every so many rows of the images are looked at."""
_COLUMNS = 4
"""The same of columns, where no neighbors are compared."""


class Doubts:
    """
    Watches pairs and their results; used by one thread.

    Parameters
    ----------
    warn : callable
        Takes a doubt that is new.
    clock : callable
        Returns s; only its differences matter.

    """

    def __init__(self, warn, clock=time.monotonic):
        self._warn = warn
        self._clock = clock
        self._images, self._features, self._order, self._rivals = [], [], [], []
        self._notes = []
        self._kinds = set()
        self._images_due = self._sight_due = self._order_due = -float('inf')
        self._wait = _PERIOD
        self.exposure = None
        """The Exposure of the last pair that was looked at, or None."""
        self.pattern = None
        """What it shows of the pattern, a Seen, or None."""

    @property
    def current(self):
        """Return the sentences that hold now, but not the one about few ranges."""
        return [*self._images, *self._features, *self._order, *self._rivals]

    def look(self, stereo, left, right, result):
        """
        Look at a pair that has been measured.

        Parameters
        ----------
        stereo : ColorStereo
            The sensor.
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        result : RangeResult
            Of the pair.

        """
        if self._clock() >= self._images_due:
            self._images_due = self._clock() + _PERIOD
            self._look_at_images(left[::_ROWS], right[::_ROWS])
        if self._clock() >= self._sight_due:
            self._sight_due = self._clock() + _SIGHT
            self.exposure = exposure_of(
                left[::_ROWS, ::_COLUMNS], right[::_ROWS, ::_COLUMNS],
                stereo.settings.color.saturation_level)
            gray = are_gray(left[::_ROWS, ::_COLUMNS], right[::_ROWS, ::_COLUMNS])
            self.pattern = pattern_seen(result.image, stereo.settings.pattern, gray)
            # gray cameras are legal: they are said, but no doubt that lasts
            self._notes = [self.pattern.sentence] if self.pattern.gray else []
            self._features = doubts_about_features(stereo.settings.pattern, result,
                                                   said=bool(self._features))
        if result.density >= SUSPICIOUS:
            self._order, self._order_due, self._wait = [], -float('inf'), _PERIOD
        elif self._clock() >= self._order_due:
            started = self._clock()
            self._order = doubts_about_order(stereo, left, right, result)
            spent = self._clock() - started
            self._order_due = self._clock() + max(self._wait, _SHARE * spent)
            self._wait = min(2 * self._wait, _LONGEST)
        self._rivals = list(filter(None, [doubt_about_rivals(result)]))
        self._say(result)

    def _look_at_images(self, left, right):
        doubts = doubts_about_images(left, right)
        if doubts != self._images:
            self._images = doubts
            self._order_due, self._wait = -float('inf'), _PERIOD

    def _say(self, result):
        """Say what was not true of the pair before, its numbers left aside."""
        few = None
        if result.density < SUSPICIOUS:  # to count all codes takes a while
            few = doubt_about_ranges(status_shares(result.status))
        doubts = {re.sub(r'[\d.]+', '', re.split('[;:?(]', doubt)[0]): doubt
                  for doubt in (*doubts_about_rows(result), *self.current, *self._notes,
                                *filter(None, [few]))}
        for kind in doubts.keys() - self._kinds:
            self._warn(doubts[kind])
        self._kinds = set(doubts)
