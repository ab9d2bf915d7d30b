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
"""The publishers of range_node: an output is computed when somebody listens, the points first."""

import threading

import numpy as np
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from ..filling import message_class, Reused
from ..qos import incompatible_policy
from ...core.results import POINT_FIELDS
from ...messages.cloud import cloud
from ...messages.contents import Header
from ...messages.outputs import OUTPUTS
from ...messages.trimming import cropped

_DEPTH = 4


class Outputs:
    """
    Publishers that build a message only for subscribers.

    With `input.mode: capture` they are transient local and keep one message: who joins late and
    asks for it gets the last result.

    Parameters
    ----------
    node : rclpy.node.Node
    parameters : NodeParameters

    """

    def __init__(self, node, parameters):
        self._node, self._parameters = node, parameters
        self.mismatches = {}
        """The QoS policy that keeps a subscriber away, by topic."""
        self._outputs = dict(OUTPUTS.items())
        self._reused = {topic: Reused(output.type) for topic, output in self._outputs.items()}
        # publishers are used by the worker's thread and created again by the executor's
        self._lock = threading.RLock()
        self._latched = parameters.settings.input.mode == 'capture'
        self._profiles = {topic: self._profile(topic) for topic in self._outputs}
        options = QoSOverridingOptions.with_default_policies()
        self._publishers = {topic: self._create(topic, options) for topic in self._outputs}
        self._kept = None  # the last result, its context, the topics on which it was published

    def _profile(self, topic):
        """Return the QoS of a topic, on which the parameters have the last word."""
        profile = QoSProfile(depth=1 if self._latched else _DEPTH)
        if self._latched:
            profile.durability = QoSDurabilityPolicy.TRANSIENT_LOCAL
        return profile

    def _create(self, topic, options=None):
        return self._node.create_publisher(
            message_class(self._outputs[topic].type), topic, self._profiles[topic],
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=options)

    def configure(self, mode):
        """Create the publishers again if another `input.mode` asks for another durability."""
        latched = mode == 'capture'
        if latched == self._latched:
            return
        with self._lock:
            for publisher in self._publishers.values():
                self._node.destroy_publisher(publisher)
            self._latched = latched
            self._kept = None
            for topic, profile in self._profiles.items():
                fresh = self._profile(topic)
                profile.durability = fresh.durability
                if not self._is_depth_given(topic):
                    profile.depth = fresh.depth
            self._publishers = {topic: self._create(topic) for topic in self._outputs}

    def _is_depth_given(self, topic):
        name = self._node.resolve_topic_name(topic)
        return self._parameters.is_given(f'qos_overrides.{name}.publisher.depth')

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

    def publish(self, result, context, on_first=lambda: None):
        """
        Publish a result on the topics that have a subscriber.

        Parameters
        ----------
        result : RangeResult
            Of the pair.
        context : messages.outputs.Context
            What the outputs of a pair share.
        on_first : callable
            Called when the first topic, the points, is done.

        """
        with self._lock:
            topics = self.wanted()
            self._publish(topics[:1], result, context)
            on_first()
            self._publish(topics[1:], result, context)
            self._kept = (result, context, set(topics)) if self._latched else None

    def publish_to_late(self):
        """Publish the last result of a capture on topics that have got their first subscriber."""
        with self._lock:
            if self._kept is None:
                return
            result, context, served = self._kept
            late = [topic for topic in self.wanted() if topic not in served]
            self._publish(late, result, context)
            served.update(late)

    def _publish(self, topics, result, context):
        for topic in topics:
            reused = self._reused[topic]
            content = self._outputs[topic].content(result, context.with_memory(reused.memory))
            self._publishers[topic].publish(reused.filled(content))

    def destroy(self):
        """Remove the publishers."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
