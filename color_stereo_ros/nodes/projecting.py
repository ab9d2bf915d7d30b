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
"""The pattern of pattern_node for a process that shows it."""

from contextlib import contextmanager

import numpy as np

from .live import ros_node
from ..messages.reading import image_to_rgb

TOPIC = 'pattern/image'


class PatternListener:
    """
    Keeps the newest pattern.

    Parameters
    ----------
    node : rclpy.node.Node
    topic : str

    """

    def __init__(self, node, topic=TOPIC):
        """Subscribe."""
        from sensor_msgs.msg import Image

        from .pattern_source import latched
        self._node, self._newest = node, None
        self._subscription = node.create_subscription(Image, topic, self._take, latched())

    def _take(self, message):
        self._newest = np.array(image_to_rgb(message))

    def newest(self, seconds=0.0):
        """
        Return a pattern that has come within so many seconds, uint8 (H, W, 3) RGB, else None.

        Raises
        ------
        ImageError
            If the message is no image of 8 bits.

        """
        import rclpy
        rclpy.spin_once(self._node, timeout_sec=seconds)
        newest, self._newest = self._newest, None
        return newest


@contextmanager
def pattern_listener(namespace=''):
    """Yield a PatternListener with a node of its own."""
    prefix = f'/{namespace.strip("/")}/' if namespace.strip('/') else ''
    with ros_node('color_stereo_project') as node:
        yield PatternListener(node, prefix + TOPIC)
