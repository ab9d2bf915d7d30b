# SPDX-License-Identifier: Apache-2.0
"""Publish a recording with the timing of its making."""

import time

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message

from ..errors import RecordingError
from .filling import message_class

SECOND = 1_000_000_000
SETTLING = 0.5  # s from the first sign of a subscriber until both sides know all its topics
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
        Shift the stamps to the time of replay; what had one stamp has one again.

    Raises
    ------
    RecordingError
        If one of the topics is not in the recording, or a type is not installed.

    """

    def __init__(self, node, recording, topics=None, namespace='', restamp=False):
        self.recording = recording
        self.topics = self._chosen(topics)
        self._node = node
        self._restamp = restamp
        self._types = {topic: _installed(recording.topics[topic]) for topic in self.topics}
        prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
        self.publishers = {
            topic: node.create_publisher(self._types[topic], prefix + topic,
                                         _profile(topic in recording.latched))
            for topic in self.topics}

    def _chosen(self, topics):
        missing = [topic for topic in topics or () if topic not in self.recording.topics]
        if missing:
            raise RecordingError(f'{self.recording.path}: no topic {missing[0]}; it holds '
                                 f'{", ".join(sorted(self.recording.topics))}')
        return list(topics or self.recording.topics)

    def wait_for_subscriber(self, seconds):
        """Wait until somebody listens to any of the topics, at most so many seconds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not any(
                publisher.get_subscription_count() for publisher in self.publishers.values()):
            time.sleep(LARGEST_STEP)
        if time.monotonic() < end:
            time.sleep(SETTLING)

    def play(self, rate=1.0):
        """
        Publish every message once, in time, and wait one mean period after the last one.

        Parameters
        ----------
        rate : float
            1 = as recorded, 2 = twice as fast.

        """
        start, first = time.monotonic(), None
        start_ns = self._node.get_clock().now().nanoseconds
        for message in self.recording.messages(self.topics):
            first = message.time_ns if first is None else first
            _sleep_until(start + (message.time_ns - first) * 1e-9 / rate)
            self._publish(message, lambda stamp: start_ns + round((stamp - first) / rate))
        most = max(self.recording.counts[topic] for topic in self.topics)
        period = self.recording.duration / max(most - 1, 1)
        _sleep_until(start + (self.recording.duration + period) / rate)

    def _publish(self, message, shifted):
        publisher = self.publishers[message.topic]
        if not self._restamp:
            publisher.publish(message.data)
            return
        content = deserialize_message(message.data, self._types[message.topic])
        if hasattr(content, 'header'):
            stamp = content.header.stamp
            nanoseconds = shifted(stamp.sec * SECOND + stamp.nanosec)
            stamp.sec, stamp.nanosec = divmod(nanoseconds, SECOND)
        publisher.publish(content)

    def finish(self):
        """Wait until reliable subscribers have everything, at most 2 s."""
        for publisher in self.publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=2))


def _installed(type_name):
    """Return the class of a message type, or raise RecordingError."""
    try:
        return message_class(type_name)
    except (ImportError, AttributeError) as error:
        raise RecordingError(f'message type {type_name} is not installed; choose other topics '
                             'with --topics') from error


def _profile(latched):
    durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=10, durability=durability)


def _sleep_until(moment):
    while (left := moment - time.monotonic()) > 0:
        time.sleep(min(left, LARGEST_STEP))
