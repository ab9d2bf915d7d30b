# SPDX-License-Identifier: Apache-2.0
"""The topic projector/camera_info: where the projector stands, latched."""

import time

from rclpy.qos_overriding_options import QoSOverridingOptions

from sensor_msgs.msg import CameraInfo

from ..filling import message_of
from ..pattern_source import latched
from ...messages.projector import projector_info, ProjectorNews, TOPIC


class ProjectorInfo:
    """
    Publishes the projector that pairs show, at most once a second.

    Parameters
    ----------
    node : rclpy.node.Node

    """

    def __init__(self, node):
        self._node = node
        self._publisher = node.create_publisher(
            CameraInfo, TOPIC, latched(),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        self._news = ProjectorNews()

    def note(self, track, header):
        """
        Publish the projector of a pair if it is another than the last one.

        Parameters
        ----------
        track : Track or None
            What is known of the projector; None: it is not used.
        header : messages.contents.Header
            Whose stamp counts.

        """
        model = self._news.model(track, time.monotonic())
        if model is not None:
            self._publisher.publish(message_of(projector_info(model, header.stamp)))

    def destroy(self):
        """Leave the topic."""
        self._node.destroy_publisher(self._publisher)
