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
"""Publish a recording with the timing of its making."""

import time

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message

from .filling import message_class
from ..errors import RecordingError

SECOND = 1_000_000_000
SETTLING = 0.5  # s from the first sign of a subscriber until both sides know all its topics
ANOTHER_CLOCK = 24 * 3600 * SECOND  # ns between stamp and time of recording: two clocks
LARGEST_STEP = 0.05  # s: how long a signal or a late subscriber may wait to be noticed


class Player:
    """
    Publishes a recording with one node.

    Parameters
    ----------
    node : rclpy.node.Node
    recording : Recording
    topics : sequence of str or None
        Only these; None = all.
    namespace : str
        Goes before every topic.
    restamp : bool
        Shift the stamps to the time of replay; what had one stamp has one again. For a stamp of
        zero the time of recording is used.
    say : callable
        Called with a sentence about a topic that is not published.
    refuse : callable
        Called with each message that is damaged, and the reason; it is not published.

    Raises
    ------
    RecordingError
        If one of the topics is not in the recording, or a type is not installed.

    """

    def __init__(self, node, recording, topics=None, namespace='', restamp=False,
                 say=print, refuse=print):
        self.recording = recording
        self._node = node
        self._restamp = restamp
        self._refuse = refuse
        self._clock_offset = 0  # ns from the clock of the stamps to that of the recording
        self._types = self._installed(topics, say)
        self.topics = list(self._types)
        prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
        self.publishers = {
            topic: node.create_publisher(self._types[topic], prefix + topic,
                                         _profile(topic in recording.latched))
            for topic in self.topics}

    def _installed(self, topics, say):
        """Return the topics to publish and the classes of their messages."""
        offered = self.recording.topics
        missing = [topic for topic in topics or () if topic not in offered]
        if missing:
            raise RecordingError(f'{self.recording.path}: no topic {missing[0]}; it holds '
                                 f'{", ".join(sorted(offered))}')
        found, left_out = {}, []
        for topic in topics or offered:
            try:
                found[topic] = message_class(offered[topic])
            except (ImportError, AttributeError) as error:
                left_out.append(f'message type {offered[topic]} of {topic} is not installed')
                if topics:
                    raise RecordingError(f'{left_out[0]}; choose other topics with '
                                         '--topics') from error
        if not found:
            raise RecordingError(f'{self.recording.path}: no topic can be published: '
                                 f'{"; ".join(left_out) or "it holds none"}')
        if not any(self.recording.counts[topic] for topic in found):
            raise RecordingError(f'{self.recording.path}: holds no messages')
        for reason in left_out:
            say(f'left out: {reason}')
        return found

    def wait_for_subscriber(self, seconds):
        """
        Wait until somebody listens to any of the topics, at most so many seconds.

        Returns
        -------
        listened : bool

        """
        end = time.monotonic() + seconds
        while not self._has_listeners():
            if time.monotonic() >= end:
                return False
            time.sleep(LARGEST_STEP)
        time.sleep(SETTLING)
        return True

    def _has_listeners(self):
        return any(publisher.get_subscription_count() for publisher in self.publishers.values())

    def play(self, rate=1.0, again=False):
        """
        Publish every message once, in time, and wait one mean period after the last one.

        Parameters
        ----------
        rate : float
            1 = as recorded, 2 = twice as fast.
        again : bool
            All was played before: what is refused was told then.

        """
        start, first = time.monotonic(), None
        start_ns = self._node.get_clock().now().nanoseconds
        for message in self.recording.messages(self.topics):
            first = message.time_ns if first is None else first
            _sleep_until(start + (message.time_ns - first) * 1e-9 / rate)
            try:
                self.recording.check(message)
                self._publish(message, lambda time_ns: start_ns + round((time_ns - first) / rate))
            except RecordingError as error:
                if not again:
                    self._refuse(message, error)
        most = max(self.recording.counts[topic] for topic in self.topics)
        period = self.recording.duration / max(most - 1, 1)
        _sleep_until(start + (self.recording.duration + period) / rate)

    def _publish(self, message, shifted):
        publisher = self.publishers[message.topic]
        if not self._restamp:
            publisher.publish(message.data)
            return
        content = self._content(message)
        if hasattr(content, 'header'):
            stamp = content.header.stamp
            time_ns = self._on_recording_clock(stamp.sec * SECOND + stamp.nanosec,
                                               message.time_ns)
            stamp.sec, stamp.nanosec = divmod(shifted(time_ns), SECOND)
        publisher.publish(content)

    def _on_recording_clock(self, stamp, recorded):
        """Return a stamp on the clock of the recording, ns; cameras may have one of their own."""
        if stamp == 0:
            return recorded
        if abs(stamp + self._clock_offset - recorded) > ANOTHER_CLOCK:
            self._clock_offset = recorded - stamp
        return stamp + self._clock_offset

    def _content(self, message):
        try:
            return deserialize_message(message.data, self._types[message.topic])
        except Exception as error:  # the middleware decides what it raises
            raise RecordingError(f'{self.recording.path}: the message on {message.place} is '
                                 'damaged: ROS cannot read it') from error

    def finish(self):
        """Wait until reliable subscribers have everything, at most 2 s."""
        for publisher in self.publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=2))


def _profile(latched):
    durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=10, durability=durability)


def _sleep_until(moment):
    while (left := moment - time.monotonic()) > 0:
        time.sleep(min(left, LARGEST_STEP))
