# SPDX-License-Identifier: Apache-2.0
"""The output topics of range_node: each is computed when somebody listens, the points first."""

import cv2
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from std_msgs.msg import Header

from stereo_msgs.msg import DisparityImage

from ...core.false_color import false_color
from ...messages import images as messages
from ..qos import incompatible_policy

_DEPTH = 4

TOPICS = {
    'points': (PointCloud2, 'organized H x W, fields x y z rgb, 16 bytes a point, NaN = unknown; '
               'with `output.compact_points` the known points only'),
    'depth/image': (Image, '32FC1, m along Z of the rectified left camera, NaN = unknown; with '
                    '`output.depth_encoding` 16UC1 in mm, 0 = unknown'),
    'depth/camera_info': (CameraInfo, 'the rectified left camera; stamp and frame of depth/image'),
    'disparity': (DisparityImage, 'Z = f t / d; unknown below `min_disparity`'),
    'confidence/image': (Image, '32FC1, 0..1, the probability that the match is right'),
    'depth_std/image': (Image, '32FC1, standard deviation of the depth, m, NaN = unknown'),
    'status/image': (Image, 'mono8, why a pixel has no range; 0 = it has one'),
    'range_image': (Image, 'bgr8, false colors with a scale bar: near = purple .. far = orange, '
                    'unknown = black'),
}
"""Type and meaning of the outputs, in the order in which they are published."""


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
        self._publishers = {topic: self._create(topic, kind)
                            for topic, (kind, _) in TOPICS.items()}
        self._reused = {topic: kind() for topic, (kind, _) in TOPICS.items()}

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
        messages.cloud_message(result, Header())

    def publish(self, topics, result, header, settings, rotation):
        """
        Publish a result.

        Parameters
        ----------
        topics : list of str
        result : RangeResult
        header : std_msgs.msg.Header
            Of the left image.
        settings : RangeNodeSettings
        rotation : numpy.ndarray, shape (3, 3)
            From the rectified to the physical left camera.

        """
        for topic in topics:
            message = self._build(topic, result, header, settings, rotation)
            self._publishers[topic].publish(message)

    def _build(self, topic, result, header, settings, rotation):
        reused, output = self._reused[topic], settings.output
        if topic == 'points':
            turn = rotation if output.frame == 'camera' else None
            return messages.cloud_message(result, header, compact=output.compact_points,
                                          rotation=turn, message=reused)
        if topic == 'depth/camera_info':
            return messages.camera_info_message(result.geometry, header)
        if topic == 'disparity':
            return messages.disparity_message(result, header, reused)
        encoding, image = self._image(topic, result, settings)
        return messages.image_message(image, encoding, header, reused)

    @staticmethod
    def _image(topic, result, settings):
        """Return encoding and pixels of an image topic."""
        if topic == 'depth/image':
            if settings.output.depth_encoding == '16UC1':
                return '16UC1', messages.millimeters(result.depth)
            return '32FC1', result.depth
        if topic == 'confidence/image':
            return '32FC1', result.confidence
        if topic == 'depth_std/image':
            return '32FC1', result.depth_std
        if topic == 'status/image':
            return 'mono8', result.status
        picture = false_color(result.depth, settings.range.min_depth, settings.range.max_depth)
        return 'bgr8', cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)

    def destroy(self):
        """Remove the publishers."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
