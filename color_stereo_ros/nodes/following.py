# SPDX-License-Identifier: Apache-2.0
"""A subscription whose quality of service follows that of the publishers."""

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSPolicyKind, QoSProfile, QoSReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from .qos import incompatible_policy

_DEPTH = 10


class FollowingSubscription:
    """
    A subscription that is as reliable as the publishers offer to be.

    It is reliable until a best-effort publisher shows up. A `qos_overrides` parameter for its
    reliability pins it.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        Of the messages.
    topic : str
    callback : callable
        Called with a message, or with its bytes.
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
        policies = [QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH]
        self._pinned = parameters.is_given(
            f'qos_overrides.{self.name}.subscription.reliability')
        if self._pinned:
            policies.append(QoSPolicyKind.RELIABILITY)
        self._profile = QoSProfile(depth=_DEPTH)
        self._subscription = self._create(QoSOverridingOptions(policies))

    def _create(self, options=None):
        return self._node.create_subscription(
            self._kind, self._topic, self._callback, self._profile, raw=self._raw,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=options)

    @property
    def reliability(self):
        """Return 'reliable' or 'best_effort'."""
        return self._profile.reliability.name.lower()

    @property
    def publishers(self):
        """Return how many publishers there are."""
        return self._node.count_publishers(self.name)

    def follow(self):
        """Become what the publishers offer; call it from the executor's thread now and then."""
        profiles = [info.qos_profile
                    for info in self._node.get_publishers_info_by_topic(self.name)]
        offered = {profile.reliability for profile in profiles}
        best_effort = QoSReliabilityPolicy.BEST_EFFORT
        wanted = best_effort if best_effort in offered else QoSReliabilityPolicy.RELIABLE
        if offered and not self._pinned and wanted != self._profile.reliability:
            self._profile.reliability = wanted
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._create()
            self._node.get_logger().info(f'{self.name}: subscribed {self.reliability} as the '
                                         'publishers offer')
        policies = (incompatible_policy(profile, self._profile) for profile in profiles)
        self.mismatch = next(filter(None, policies), None)

    def destroy(self):
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)
