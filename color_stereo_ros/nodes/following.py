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
"""A subscription whose quality of service follows that of the publishers."""

import time

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSDurabilityPolicy, QoSPolicyKind, QoSProfile, QoSReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from .qos import incompatible_policy
from .received import received_at

_DEPTH = 10
_LARGE = 16 << 20
"""Bytes beyond the usual ones from which the memory of a message is given back."""
_QUIET = 1.0
"""s without such a message until then."""


class FollowingSubscription:
    """
    A subscription that asks for what all publishers offer.

    It is reliable until a best-effort publisher shows up, and transient local as long as there
    are publishers and all of them are: what they published before it came arrives, too. A
    `qos_overrides` parameter for one of these policies pins it.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        Of the messages.
    topic : str
    callback : callable
        Called with a message, or with its bytes and when they were received (`received_at`).
    parameters : NodeParameters
    raw : bool
        Hand over the bytes of a message as they come.

    """

    def __init__(self, node, kind, topic, callback, parameters, raw=False):
        self._node, self._kind, self._topic, self._callback = node, kind, topic, callback
        self._raw = raw
        self.name = node.resolve_topic_name(topic)
        self.mismatch = None
        """The QoS policy that keeps a publisher away, or None."""
        self.publishers = []
        """Names of the nodes that publish, one for each publisher."""
        policies = [QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH]
        self._pinned = {policy for policy in _FOLLOWED if parameters.is_given(
            f'qos_overrides.{self.name}.subscription.{policy.name.lower()}')}
        policies += sorted(self._pinned)
        self._profile = QoSProfile(depth=_DEPTH)
        self._sizes = _Sizes()
        self._subscription = self._create(QoSOverridingOptions(policies))

    def _create(self, options=None):
        return self._node.create_subscription(
            self._kind, self._topic, self._take_bytes if self._raw else self._callback,
            self._profile, raw=self._raw,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=options)

    def _take_bytes(self, data, info):
        self._callback(data, received_at(info['received_timestamp']))
        self._sizes.note(len(data))
        if self._sizes.are_usual_again():
            self._create_again()  # now, since the next message is a frame period away

    def _create_again(self):
        """Subscribe anew; the middleware gives back what its largest messages have taken."""
        self._node.destroy_subscription(self._subscription)
        self._sizes = _Sizes()
        self._subscription = self._create()

    @property
    def kind(self):
        """Return what was asked for: 'reliable' or 'best_effort', and 'transient_local'."""
        latched = ', transient_local' if self.is_latched else ''
        return self._profile.reliability.name.lower() + latched

    @property
    def is_latched(self):
        """Return whether messages from before the subscription are asked for."""
        return self._profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL

    def follow(self):
        """Become what the publishers offer; call it from the executor's thread now and then."""
        publishers = self._node.get_publishers_info_by_topic(self.name)
        self.publishers = [_name(info) for info in publishers]
        profiles = [info.qos_profile for info in publishers]
        wanted = {policy: wish(profiles) for policy, wish in _FOLLOWED.items()
                  if policy not in self._pinned} if profiles else {}
        changes = {policy: value for policy, value in wanted.items()
                   if getattr(self._profile, policy.name.lower()) != value}
        for policy, value in changes.items():
            setattr(self._profile, policy.name.lower(), value)
        if changes:
            self._create_again()
            self._node.get_logger().info(f'{self.name}: subscribed {self.kind} as the publishers '
                                         'offer')
        elif self._sizes.are_usual_again() and self._sizes.are_quiet():
            self._create_again()
        policies = (incompatible_policy(profile, self._profile) for profile in profiles)
        self.mismatch = next(filter(None, policies), None)

    def destroy(self):
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)


class _Sizes:
    """Whether messages far larger than the usual ones have come and are over."""

    def __init__(self):
        self._largest = self._usual = 0
        self._when = self._latest = time.monotonic()

    def note(self, size):
        """Take down a message of so many bytes."""
        self._latest = time.monotonic()
        if size < self._largest - _LARGE:
            self._usual = size
            return
        if size > self._largest + _LARGE:
            self._usual = self._largest  # 0: this is the first one
        self._largest, self._when = max(size, self._largest), time.monotonic()

    def are_usual_again(self):
        """Tell whether messages far larger than others have not come for a while."""
        return bool(self._usual and self._largest > self._usual + _LARGE
                    and time.monotonic() - self._when > _QUIET)

    def are_quiet(self):
        """Tell whether no message has come for a while."""
        return time.monotonic() - self._latest > _QUIET


def _reliability(profiles):
    """Return the strictest reliability that all publishers offer."""
    best_effort = QoSReliabilityPolicy.BEST_EFFORT
    weak = any(profile.reliability == best_effort for profile in profiles)
    return best_effort if weak else QoSReliabilityPolicy.RELIABLE


def _durability(profiles):
    """Return the strictest durability that all publishers offer, of the two that ROS has."""
    latched = QoSDurabilityPolicy.TRANSIENT_LOCAL
    strong = all(profile.durability == latched for profile in profiles)
    return latched if strong else QoSDurabilityPolicy.VOLATILE


_FOLLOWED = {QoSPolicyKind.RELIABILITY: _reliability, QoSPolicyKind.DURABILITY: _durability}


def _name(info):
    """Return the full name of the node of a publisher."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'
