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
"""Which messages of a recording belong together: pairs as `range_node` makes them."""

from collections import Counter, deque
from dataclasses import dataclass

from .refusals import Refusals
from .times import OutputTimes
from ..errors import RecordingError
from ..messages.calibration_watch import CalibrationWatch, check_use
from ..messages.contents import CompressedImage, Image
from ..messages.reading import stamp_ns
from ..messages.synchronizer import Synchronizer

WAITING = 50
"""Pairs that wait for a calibration; older ones are given up."""


@dataclass(frozen=True)
class Place:
    """Where a message lies in a recording."""

    time_ns: int
    """When it was recorded, ns."""
    occurrence: int
    """0 for the first message of its topic with this time, then 1, 2, .."""


@dataclass(frozen=True, eq=False)
class Taken:
    """One image message of a pair."""

    place: Place
    content: object
    """As `Recording.decoded` returns it."""

    @property
    def header(self):
        """Return the header of the message."""
        return self.content.header


@dataclass(frozen=True, eq=False)
class FoundPair:
    """A pair that can be measured."""

    left: Taken
    right: Taken
    stamp: int
    """Of the left image, ns."""
    recorded: int
    """When the second image was recorded, ns."""
    time_ns: int
    """At which time of a recording the outputs stand, ns."""
    calibration: object
    """StereoCalibration."""


class Places:
    """Gives every message of a recording its Place; takes the messages in their order."""

    def __init__(self):
        self._time = None
        self._seen = Counter()

    def of(self, message):
        """Return the Place of the next RecordedMessage."""
        if message.time_ns != self._time:
            self._time = message.time_ns
            self._seen.clear()
        place = Place(message.time_ns, self._seen[message.topic])
        self._seen[message.topic] += 1
        return place


class Pairing:
    """
    Takes recorded messages in their order, hands out the pairs that can be measured.

    Parameters
    ----------
    recording : Recording
        Decodes the messages.
    topics : StereoTopics
    settings : RangeNodeSettings
    say : callable
        Called with a sentence about a message or calibration that is refused.

    """

    def __init__(self, recording, topics, settings, say=print):
        self._recording, self._topics, self._say = recording, topics, say
        self._now = 0
        self._places = Places()
        self._synchronizer = Synchronizer(settings.sync.tolerance, settings.sync.queue_size,
                                          clock=self._clock)
        self._watch = CalibrationWatch(
            self._recalibrate, clock=self._clock,
            check=lambda calibration: check_use(calibration, settings))
        self._waiting = deque(maxlen=WAITING)
        self._times = OutputTimes()
        self.refusals = Refusals(say)
        """The messages that could not be decoded."""
        self.found = 0
        """Pairs that were handed out."""

    def _clock(self):
        return self._now * 1e-9

    def _recalibrate(self):
        if self._watch.error is not None:
            self._say(f'calibration refused: {self._watch.error}')

    @property
    def calibration(self):
        """Return the StereoCalibration that holds now, or None."""
        return self._watch.calibration

    def take(self, message):
        """
        Take a RecordedMessage of one of the four input topics.

        Returns
        -------
        pairs : list of FoundPair
            Those that can be measured since this message; nearly always none or one.

        """
        self._now = message.time_ns
        place = self._places.of(message)
        try:
            content = self._recording.decoded(message)
        except RecordingError as error:
            self.refusals.add(message, error)
            return []
        side = 'left' if message.topic in (self._topics.left_image,
                                           self._topics.left_info) else 'right'
        if message.type not in (Image.TYPE, CompressedImage.TYPE):
            self._watch.add(side, content)
        else:
            pair = self._synchronizer.add(side, stamp_ns(content.header), Taken(place, content))
            if pair is not None:
                self._waiting.append((pair, self._now))
        self._watch.tick()
        return self._released()

    def _released(self):
        if self.calibration is None:
            return []
        pairs = [FoundPair(pair.left, pair.right, pair.stamp, recorded,
                           self._times.of(pair.stamp, recorded), self.calibration)
                 for pair, recorded in self._waiting]
        self._waiting.clear()
        self.found += len(pairs)
        return pairs

    @property
    def unpaired(self):
        """Return how many images found no partner, or no calibration in time."""
        images = self._topics.left_image, self._topics.right_image
        return sum(self._recording.counts[topic] - self.refusals.count(topic)
                   for topic in images) - 2 * self.found

    def reason(self):
        """Return why no pair was handed out, as text."""
        if self._watch.error:
            return self._watch.error
        if self.refusals:
            return f'{self.refusals}; the first: {self.refusals.first}'
        if self._watch.missing:
            return f'no camera_info of the {" and the ".join(self._watch.missing)} camera'
        return 'no left and right image have stamps that fit together'
