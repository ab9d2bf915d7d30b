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
"""The frames of pattern_node, shown one after the other, as two live cameras see them."""

import time

from .live import LiveError
from .live_pairs import live_pairs
from ..calibration.color import FRAMES

FRAME = 'pattern.frame'
PATIENCE = 10.0  # s for an answer of pattern_node
LOOK = 0.02      # s between two looks for it


def take_frames(stream, pattern_node, topics, compressed, say):
    """
    Show all frames and give the pairs to a FrameStream; the frame shown before comes back.

    Parameters
    ----------
    stream : FrameStream
        Takes the frames.
    pattern_node : str
        Name of the pattern_node, with its namespace.
    topics : (str, str)
        Of the left and of the right image.
    compressed : bool
        The images are JPEG or PNG.
    say : callable
        Called with a sentence about each frame, and where no pair comes.

    Raises
    ------
    ModuleNotFoundError
        If rclpy is not installed.
    LiveError
        If pattern_node does not answer or refuses a frame.

    """
    with live_pairs(topics, compressed, 'calibrate_color') as source:
        shower = Shower(source.node, pattern_node, stream)
        before = shower.frame()
        try:
            for name in FRAMES:
                shower.show(name)
                say(f'frame {name}')
                for pair in source.pairs(say):
                    stream.take(pair.left, pair.right, time.monotonic())
                    if stream.has(name):
                        break
        finally:
            shower.show(before)


class Shower:
    """
    Sets `pattern.frame` of a pattern_node, and hears what it shows.

    Parameters
    ----------
    node : rclpy.node.Node
        Somebody else spins it.
    name : str
    stream : FrameStream

    """

    def __init__(self, node, name, stream):
        from rclpy.parameter_client import AsyncParameterClient
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from std_msgs.msg import String
        self.name = name
        namespace = name.rpartition('/')[0]
        self._heard = node.create_subscription(
            String, f'{namespace}/pattern/info' if namespace else 'pattern/info',
            lambda message: stream.shown(message.data, time.monotonic()),
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self._client = AsyncParameterClient(node, name)
        if not self._client.wait_for_services(PATIENCE):
            raise LiveError(f'{name} does not answer: start pattern_node, or name it by '
                            '--pattern-node')

    def frame(self):
        """Return the frame that is shown now."""
        return self._answer(self._client.get_parameters([FRAME])).values[0].string_value

    def show(self, frame):
        """Show a frame; return when pattern_node has taken the parameter."""
        from rclpy.parameter import Parameter
        result = self._answer(self._client.set_parameters(
            [Parameter(FRAME, value=frame)])).results[0]
        if not result.successful:
            raise LiveError(f'{self.name} refuses {FRAME} = {frame}: {result.reason}')

    def _answer(self, future):
        end = time.monotonic() + PATIENCE
        while not future.done():
            if time.monotonic() > end:
                raise LiveError(f'{self.name} does not answer any more')
            time.sleep(LOOK)
        return future.result()
