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
"""The transform between the physical and the rectified left camera on /tf_static."""

from rclpy.event_handler import PublisherEventCallbacks

from ..filling import message_class, message_of
from ..pattern_source import latched
from ...messages.frames import frames_of, TOPIC

_TYPE = 'tf2_msgs/msg/TFMessage'


class StaticFrames:
    """
    Publishes the transform where the two cameras have different names, and each change of it.

    Without the package tf2_msgs it says instead which command does so.

    Parameters
    ----------
    node : rclpy.node.Node

    """

    def __init__(self, node):
        self._node = node
        self._publisher = self._frames = self._asked = None

    def note(self, frame_id, calibration, settings):
        """
        Take what decides on the frames of a pair.

        Parameters
        ----------
        frame_id : str
            Of the left image.
        calibration : StereoCalibration
            Of the two cameras.
        settings : OutputSettings
            The group `output` of the parameters.

        """
        asked = frame_id, calibration, settings.frame_id
        if asked == self._asked:
            return
        self._asked = asked
        frames = frames_of(frame_id, calibration, settings)
        if frames.differ and frames != self._frames:
            self._publish(frames)
        self._frames = frames

    def _publish(self, frames):
        try:
            kind = message_class(_TYPE)
        except (ImportError, AttributeError):
            self._node.get_logger().warning(
                f'outputs are in the frame {frames.rectified!r}, but the package tf2_msgs is '
                f'missing, so its place is not published; this command does it: {frames.command}')
            return
        if self._publisher is None:
            self._publisher = self._node.create_publisher(
                kind, TOPIC, latched(),
                event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))
        now = self._node.get_clock().now().nanoseconds
        self._publisher.publish(message_of(frames.transform(now)))
        self._node.get_logger().info(
            f'outputs are in the frame {frames.rectified!r}, its place in {frames.physical!r} is '
            f'on {TOPIC}')

    def destroy(self):
        """Leave the topic."""
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
