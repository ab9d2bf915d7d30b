# SPDX-License-Identifier: Apache-2.0
"""The publishers of range_node: an output is computed when somebody listens, the points first."""

import numpy as np
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from ...core.results import POINT_FIELDS
from ...messages.cloud import cloud
from ...messages.contents import Header
from ...messages.outputs import OUTPUTS
from ...messages.trimming import cropped
from ..filling import message_class, Reused
from ..qos import incompatible_policy

_DEPTH = 4


class Outputs:
    """
    Publishers that build a message only for subscribers.

    Parameters
    ----------
    node : rclpy.node.Node

    """

    def __init__(self, node):
        self._node = node
        self.mismatches = {}
        """The QoS policy that keeps a subscriber away, by topic."""
        self._outputs = dict(OUTPUTS.items())
        self._publishers = {topic: self._create(topic, message_class(output.type))
                            for topic, output in self._outputs.items()}
        self._reused = {topic: Reused(output.type) for topic, output in self._outputs.items()}

    def _create(self, topic, kind):
        return self._node.create_publisher(
            kind, topic, QoSProfile(depth=_DEPTH),
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def look_for_mismatches(self):
        """Find the subscribers that get nothing; call it now and then."""
        self.mismatches = {}
        for topic, publisher in self._publishers.items():
            name = publisher.topic_name
            if self._node.count_subscribers(name) > publisher.get_subscription_count():
                policies = (incompatible_policy(publisher.qos_profile, info.qos_profile)
                            for info in self._node.get_subscriptions_info_by_topic(name))
                policy = next(filter(None, policies), None)
                if policy:
                    self.mismatches[topic] = policy

    @property
    def names(self):
        """Return the full names of the topics."""
        return [publisher.topic_name for publisher in self._publishers.values()]

    def wanted(self):
        """Return the topics that have a subscriber, in the order of publication."""
        return [topic for topic, publisher in self._publishers.items()
                if publisher.get_subscription_count()]

    @staticmethod
    def prepare(result):
        """Compile or load what the messages of any result need."""
        cloud(result, Header(), fields=POINT_FIELDS, rotation=np.eye(3))
        cropped(result, np.zeros((3, 2)))

    def publish(self, topics, result, context):
        """
        Publish a result.

        Parameters
        ----------
        topics : list of str
        result : RangeResult
        context : messages.outputs.Context

        """
        for topic in topics:
            reused = self._reused[topic]
            content = self._outputs[topic].content(result, context.with_memory(reused.memory))
            self._publishers[topic].publish(reused.filled(content))

    def destroy(self):
        """Remove the publishers."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
