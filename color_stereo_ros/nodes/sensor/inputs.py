# SPDX-License-Identifier: Apache-2.0
"""The input topics of range_node: what arrives, is refused, or is paired."""

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSPolicyKind, QoSProfile, QoSReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import deserialize_message

from sensor_msgs.msg import CameraInfo, Image

from ...errors import ImageError
from ...messages.calibration_watch import CalibrationWatch
from ...messages.reading import check_image, read_image, stamp_ns
from ...messages.synchronizer import SIDES, Synchronizer
from ..complaints import Complaints
from ..qos import incompatible_policy

_DEPTH = 10


class FollowingSubscription:
    """
    A subscription that is as reliable as the publishers offer to be.

    It is reliable until a best-effort publisher shows up. A `qos_overrides` parameter for its
    reliability pins it.

    """

    def __init__(self, node, kind, topic, callback, parameters):
        self._node, self._kind, self._topic, self._callback = node, kind, topic, callback
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
        # images are read from their bytes: rclpy's conversion holds the interpreter for 1 ms each
        return self._node.create_subscription(
            self._kind, self._topic, self._callback, self._profile, raw=self._kind is Image,
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


class StereoInputs:
    """
    Both cameras: images checked and paired, calibrations watched.

    Parameters
    ----------
    node : rclpy.node.Node
    parameters : NodeParameters
    on_pair : callable
        Called with a `Pair` of `messages.contents.Image`.
    on_calibration : callable
        Called when `calibration` has changed for better or worse.

    """

    def __init__(self, node, parameters, on_pair, on_calibration):
        self._node = node
        self._on_pair = on_pair
        logger = node.get_logger()
        # (rclpy knows a call by its line, and wants one severity for each)
        self._complain = Complaints(lambda text: logger.error(text))
        self._warn = Complaints(lambda text: logger.warning(text))
        sync = parameters.settings.sync
        self.synchronizer = Synchronizer(sync.tolerance, sync.queue_size)
        self.calibration = CalibrationWatch(on_calibration)
        self.refused = dict.fromkeys(SIDES, 0)
        """Images that were refused, by side."""
        self.refusals = dict.fromkeys(SIDES)
        """Why the latest image was refused, or None if it was not, by side."""
        self._image_frame = None
        self.zero_stamps = False
        """The latest image had a stamp of zero."""
        self.subscriptions = [self._subscribe(parameters, side, kind)
                              for side in SIDES for kind in (Image, CameraInfo)]
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=False), post_callback=self._jump_back)

    def _jump_back(self, _):
        self.synchronizer.jump_back(self._node.get_clock().now().nanoseconds)

    def _subscribe(self, parameters, side, kind):
        topic = f'{side}/{"image_raw" if kind is Image else "camera_info"}'
        take = self._take_image if kind is Image else self.calibration.add
        return FollowingSubscription(self._node, kind, topic, lambda msg: take(side, msg),
                                     parameters)

    def _take_image(self, side, data):
        try:
            msg = read_image(data, otherwise=_deserialized_image)
            check_image(msg)
        except ImageError as error:
            self.refused[side] += 1
            self.refusals[side] = f'{side} image refused: {error}'
            self._complain(self.refusals[side])
            return
        self.refusals[side] = None
        self._look_at_header(side, msg)
        pair = self.synchronizer.add(side, stamp_ns(msg.header), msg)
        if pair is not None:
            self._on_pair(pair)

    def _look_at_header(self, side, msg):
        self.zero_stamps = stamp_ns(msg.header) == 0
        if self.zero_stamps:
            self._warn(f'{side} image has a stamp of zero: pairs cannot be told apart')
        if side == 'left':
            self._image_frame = msg.header.frame_id
            if self.frame_warning:
                self._warn(self.frame_warning)

    @property
    def frame_warning(self):
        """Return how the frames of the latest left image and camera_info differ, or None."""
        calibrated, frame = self.calibration.frame_id, self._image_frame
        if None in (calibrated, frame) or frame == calibrated:
            return None
        return (f'left image has frame_id {frame!r}, left camera_info {calibrated!r}: the outputs '
                'carry that of the image')

    def configure(self, sync):
        """Take new sync.* settings."""
        self.synchronizer.tolerance = sync.tolerance
        self.synchronizer.queue_size = sync.queue_size

    def follow(self):
        """Look after the subscriptions and a calibration that settles."""
        for subscription in self.subscriptions:
            subscription.follow()
        self.calibration.tick()

    def destroy(self):
        """Unsubscribe from everything."""
        self._jumps.unregister()
        for subscription in self.subscriptions:
            subscription.destroy()


def _deserialized_image(data):
    """Return the Image in bytes of a middleware whose format only rclpy knows."""
    return deserialize_message(data, Image)
