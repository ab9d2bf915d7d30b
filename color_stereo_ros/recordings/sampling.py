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
A look at a few places of a recording: how its images pair up, and what its camera_infos are worth.

Only what is recorded within some windows is read, so that a recording of any length takes the
same time.

"""

from dataclasses import dataclass, field, replace

import numpy as np

from .refusals import Refusals
from ..errors import RecordingError
from ..messages.calibration_watch import CalibrationWatch, check_use
from ..messages.contents import CameraInfo
from ..messages.reading import stamp_ns
from ..messages.synchronizer import Synchronizer

PLACES = 3
"""Windows of a long recording."""
MEASURED = 3
"""Pairs whose images are kept; no less than PLACES."""
PAIRS = 12
"""Pairs of a window; chosen: enough to see every tenth frame missing."""
LEAST = 4
"""Pairs of a window of very large images."""
BYTES = 120_000_000
"""To be read of a recording at most, about; chosen: less than a second, unpacking included."""
GAP = 1.5
"""Frame periods between two images from which one is missing between them."""
MOST_EDGE = 2
"""Images at each end of a window whose partner may lie outside of it."""


@dataclass(eq=False)
class _Seen:
    """An image within a window."""

    side: str
    time_ns: int
    """Its stamp, or when it was recorded where it has none."""
    content: object
    paired: bool = False


@dataclass
class Sample:
    """What was seen within the windows."""

    pairs: list = field(default_factory=list)
    """MEASURED Pairs of message contents at most, from all windows."""
    images: int = 0
    """Images that could have a partner within their window."""
    paired: int = 0
    """Those of them that have one."""
    skews: list = field(default_factory=list)
    """Stamp of the right image minus that of the left one, ns, of every pair."""
    steps: list = field(default_factory=list)
    """Time from one left image to the next within a window, ns."""
    backwards: int = 0
    """Images whose stamp is before that of the image before."""
    without_stamp: int = 0
    """Images whose stamp is zero or less."""
    empty: int = 0
    """Windows without an image."""
    windows: int = 0
    damage: list = field(default_factory=list)
    """Texts about places where the file cannot be read."""

    @property
    def share(self):
        """Return the share of images with a partner; None without images."""
        return self.paired / self.images if self.images else None

    @property
    def period(self):
        """Return the median time from one left image to the next, ns; None: unknown."""
        return float(np.median(self.steps)) if self.steps else None

    @property
    def gaps(self):
        """Return the steps in which an image is missing, ns."""
        return [step for step in self.steps if step > GAP * self.period]


class Sampler:
    """
    Looks at some windows of a recording.

    Parameters
    ----------
    recording : Recording
    topics : StereoTopics
    settings : RangeNodeSettings
    say : callable
        Called with a sentence about a message that cannot be decoded.

    """

    def __init__(self, recording, topics, settings, say):
        self._recording, self._topics = recording, topics
        self._now = 0
        self._sync = Synchronizer(settings.sync.tolerance, settings.sync.queue_size, self._clock)
        self.watch = CalibrationWatch(lambda: None, self._clock,
                                      lambda calibration: check_use(calibration, settings))
        """What the camera_infos are worth."""
        self.refusals = Refusals(say)
        self._windows = windows(recording, topics)
        self.sample = Sample(windows=len(self._windows))
        self._last = {}

    def _clock(self):
        return self._now * 1e-9

    def look(self):
        """
        Read the windows.

        Returns
        -------
        sample : Sample

        """
        for start, stop in self._windows:
            try:
                self._look_at(start, stop)
            except RecordingError as error:
                self.sample.damage.append(str(error))
        self._look_for_infos()
        return self.sample

    def _look_at(self, start, stop):
        """Read one window."""
        seen, pairs = [], []
        try:
            for message in self._recording.messages(self._topics.names, start, stop):
                content = self._decoded(message)
                if content is not None and message.type == CameraInfo.TYPE:
                    self._note_info(message.topic, content)
                elif content is not None:
                    self._take(message, content, seen, pairs)
        finally:
            self._add(seen, pairs)

    def _take(self, message, content, seen, pairs):
        """Take an image; add it to those of the window, and the pair that it completes."""
        side = 'left' if message.topic == self._topics.left_image else 'right'
        stamp = self._stamp(side, content)
        seen.append(_Seen(side, stamp if stamp > 0 else message.time_ns, content))
        pair = self._sync.add(side, stamp, seen[-1])
        if pair is not None:
            pair.left.paired = pair.right.paired = True
            pairs.append(pair)

    def _add(self, seen, pairs):
        """Add what was seen in a window to the sample."""
        sample, within = self.sample, [image.paired for image in _without_edges(seen)]
        times = [image.time_ns for image in seen if image.side == 'left']
        sample.images += len(within)
        sample.paired += sum(within)
        sample.empty += not seen
        sample.skews += [pair.skew for pair in pairs]
        sample.steps += [after - before for before, after in zip(times, times[1:])
                         if after > before]
        count = MEASURED // len(self._windows)
        for place in sorted({(2 * index + 1) * len(pairs) // (2 * count)
                             for index in range(count)} if pairs else ()):
            pair = pairs[place]
            sample.pairs.append(replace(pair, left=pair.left.content, right=pair.right.content))

    def _stamp(self, side, content):
        """Return the stamp of an image in ns, and count odd ones."""
        stamp = stamp_ns(content.header)
        self.sample.without_stamp += stamp <= 0
        self.sample.backwards += stamp < self._last.get(side, stamp)
        self._last[side] = stamp
        return stamp

    def _decoded(self, message):
        self._now = message.time_ns
        self.watch.tick()
        try:
            return self._recording.decoded(message)
        except RecordingError as error:
            self.refusals.add(message, error)
            return None

    def _note_info(self, topic, content):
        self.watch.add('left' if topic == self._topics.left_info else 'right', content)

    def _look_for_infos(self):
        """Take the first camera_infos of the recording where the windows hold none."""
        for side in self.watch.missing:
            topic = getattr(self._topics, f'{side}_info')
            try:
                message = next(self._recording.messages({topic}), None)
            except RecordingError as error:
                self.sample.damage.append(str(error))
                continue
            content = None if message is None else self._decoded(message)
            if content is not None:
                self._note_info(topic, content)
        self._now += 10 ** 9  # nothing comes any more: what has come is judged
        self.watch.tick()


def _without_edges(seen):
    """Return the images of a window but for those whose partner may lie outside of it."""
    seen = list(seen)
    for end in (0, -1):
        for _ in range(MOST_EDGE):
            if seen and not seen[end].paired:
                del seen[end]
    return seen


def windows(recording, topics):
    """
    Return which parts of a recording are looked at.

    Parameters
    ----------
    recording : Recording
        An open recording.
    topics : StereoTopics
        The topics of images and calibrations.

    Returns
    -------
    windows : list of (int, int)
        Start and stop, ns. A short recording is one window.

    """
    first = recording.start_ns
    stop = first + round(recording.duration * 1e9) + 1
    images = recording.counts[topics.left_image]
    pairs = int(np.clip(BYTES * images / (PLACES * max(size_of(recording.path), 1)), LEAST, PAIRS))
    if images <= PLACES * pairs:
        return [(first, stop)]
    span = (stop - first) * pairs // images
    return [(start, start + span) for start in np.linspace(first, stop - span, PLACES,
                                                           dtype=np.int64).tolist()]


def size_of(path):
    """Return the bytes of a file, or of the files in a folder."""
    files = path.iterdir() if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())
