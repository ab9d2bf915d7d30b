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
