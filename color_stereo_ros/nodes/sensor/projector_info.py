# SPDX-License-Identifier: Apache-2.0
"""The topic projector/camera_info: where the projector stands, latched."""

import time

from rclpy.qos_overriding_options import QoSOverridingOptions

from sensor_msgs.msg import CameraInfo

from ...messages.projector import projector_info, TOPIC
from ..filling import message_of
from ..pattern_source import latched

_PERIOD = 1.0  # s, between two messages


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
        self._model, self._last = None, float('-inf')

    def note(self, track, header):
        """
        Publish the projector of a pair if it is another than the last one.

        Parameters
        ----------
        track : Track or None
        header : messages.contents.Header
            Whose stamp counts.

        """
        if track is None or not track.usable or track.model is self._model:
            return
        now = time.monotonic()
        if now - self._last < _PERIOD:
            return
        self._model, self._last = track.model, now
        self._publisher.publish(message_of(projector_info(track.model, header.stamp)))

    def destroy(self):
        """Leave the topic."""
        self._node.destroy_publisher(self._publisher)
