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
"""The pairs of images of two live cameras, for commands that look at them one by one."""

from contextlib import contextmanager
from functools import partial
import threading

from .live import ros_node
from ..errors import ImageError
from ..messages.pairs import rgb_pair
from ..messages.reading import read_compressed_image, read_image, stamp_ns
from ..messages.synchronizer import LatestSlot, SIDES, Synchronizer

LOOK = 0.5      # s between two looks at what is wrong
PATIENCE = 5.0  # s without a pair before somebody is told why


class LivePairs:
    """
    The latest pair of two cameras; older ones that nobody took are forgotten.

    Parameters
    ----------
    node : rclpy.node.Node
    topics : (str, str)
        Of the left and of the right image.
    compressed : bool
        The images are JPEG or PNG.

    """

    def __init__(self, node, topics, compressed=False):
        from rclpy.qos import qos_profile_sensor_data
        from sensor_msgs.msg import CompressedImage, Image
        self.node = node
        self._synchronizer = Synchronizer()
        self._slot = LatestSlot()
        self._kind, self._read = ((CompressedImage, read_compressed_image) if compressed
                                  else (Image, read_image))
        # images are read from their bytes: rclpy's conversion would keep the detection waiting
        self._subscriptions = [node.create_subscription(
            self._kind, topic, partial(self._take, side), qos_profile_sensor_data, raw=True)
            for side, topic in zip(SIDES, topics)]
        self._refusal = None

    def _take(self, side, data):
        from rclpy.serialization import deserialize_message
        try:
            message = self._read(data, otherwise=lambda data: deserialize_message(
                data, self._kind))
        except ImageError as error:
            self._refusal = f'{side} image: {error}'
            return
        pair = self._synchronizer.add(side, stamp_ns(message.header), message)
        if pair is not None:
            self._slot.put(pair)

    def pairs(self, say):
        """
        Yield pairs of RGB images as they come, without end.

        Parameters
        ----------
        say : callable
            Called with a sentence when no pair comes, or one cannot be read.

        Yields
        ------
        pair : Pair
            Of images, uint8 (H, W, 3).

        """
        told = None
        while True:
            pair = self._slot.take(LOOK)
            if pair is None:
                complaint = self._complaint()
                if complaint is not None and complaint.partition(': ')[2] != told:
                    say(complaint)
                    told = complaint.partition(': ')[2]
                continue
            told = None
            try:
                yield rgb_pair(pair)
            except ImageError as error:
                say(str(error))

    def latest(self):
        """Return the latest Pair of messages that nobody took, or None."""
        return self._slot.take(0.0)

    def _complaint(self):
        """Say why no pair comes, or None."""
        text = self._synchronizer.complaint(PATIENCE)
        if text is None:
            return None
        refused = f'; the last one was refused: {self._refusal}' if self._refusal else ''
        return f'{text} (topics {", ".join(self.names)}){refused}'

    @property
    def names(self):
        """Return the full names of both topics."""
        return [subscription.topic_name for subscription in self._subscriptions]


@contextmanager
def live_pairs(topics, compressed=False, name='calibrate_geometry'):
    """
    Listen to two cameras while the block runs.

    Parameters
    ----------
    topics : (str, str)
        Of the left and the right images.
    compressed : bool
        The images are JPEG or PNG.
    name : str
        Of the node.

    Yields
    ------
    pairs : LivePairs

    Raises
    ------
    ModuleNotFoundError
        If rclpy is not installed.

    """
    with ros_node(name) as node:
        import rclpy
        pairs = LivePairs(node, topics, compressed)
        ending = threading.Event()

        def spin():
            while not ending.is_set():
                rclpy.spin_once(node, timeout_sec=0.1)

        spinner = threading.Thread(target=spin, daemon=True)
        spinner.start()
        try:
            yield pairs
        finally:
            ending.set()
            spinner.join()
