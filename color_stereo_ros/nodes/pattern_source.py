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
"""The pattern that pattern_node shows, and the description by which range_node knows it."""

from dataclasses import asdict, replace
import hashlib
import json
import threading
import time

import numpy as np

from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import serialize_message

from sensor_msgs.msg import Image

from std_msgs.msg import String

from .filling import message_of
from .parameters import NodeParameters, Reloadable
from ..core.patterns.frames import make_frame, PATTERN
from ..core.patterns.making import check_pattern
from ..errors import bounded, ColorStereoError
from ..messages.contents import Header, image, new_memory
from ..messages.projector import FRAME
from ..messages.synchronizer import LatestSlot
from ..parameters.groups import PatternNodeSettings

_LARGE = 4_000_000  # px; making so many takes a noticeable time
_PATIENCE = 0.2
"""s that the end of the node waits for a pattern that is being made."""


def latched():
    """Return the QoS of a topic whose last message every late subscriber gets."""
    return QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


def describe(settings, image, frame=PATTERN):
    """Return the JSON text of pattern/info: settings, frame and a hash of the pixels."""
    return json.dumps({'pattern': asdict(settings), 'frame': frame,
                       'sha256': fingerprint(image)})


def fingerprint(image):
    """Return the SHA-256 of the pixels of a pattern, in hexadecimal."""
    return hashlib.sha256(np.ascontiguousarray(image)).hexdigest()


def serialized(content):
    """
    Return the bytes of an image message without a copy for each layer of ROS.

    Parameters
    ----------
    content : messages.contents.Image
        What is to be sent.

    Returns
    -------
    data : bytes
        CDR: the message without pixels, whose last field is their number, and the pixels.

    """
    empty = serialize_message(message_of(replace(content, data=new_memory(0))))
    count = len(content.data).to_bytes(4, 'little' if empty[1] & 1 else 'big')
    return b''.join([empty[:-4], count, content.data])


class PatternNode(Reloadable, Node):
    """
    Publishes pattern/image and pattern/info, latched, and again when a parameter changes.

    A pattern is made in a thread of its own, so that the node answers in the meantime; if the
    parameters change again, the latest ones count.

    """

    def __init__(self):
        super().__init__('pattern_node', automatically_declare_parameters_from_overrides=True)
        self._slot = LatestSlot()
        parameters = NodeParameters(self, PatternNodeSettings(), check=_check,
                                    on_change=self._slot.put)
        options = QoSOverridingOptions.with_default_policies()
        self._image = self.create_publisher(Image, 'pattern/image', latched(),
                                            qos_overriding_options=options)
        self._info = self.create_publisher(String, 'pattern/info', latched(),
                                           qos_overriding_options=options)
        parameters.warn_of_unknown()
        _check(parameters.settings)
        self._slot.put(parameters.settings)
        self._thread = threading.Thread(target=self._work, name='pattern', daemon=True)
        self._thread.start()

    def destroy_node(self):
        """End the thread, which is not awaited for long, then the node."""
        self._slot.close()
        self._thread.join(_PATIENCE)
        super().destroy_node()

    def _work(self):
        """Show whatever is newest, until the node ends."""
        while not self._slot.closed:
            settings = self._slot.take()
            if settings is None:
                continue
            try:
                self._show(settings.pattern)
            except ColorStereoError as error:
                self.get_logger().error(f'not shown: {bounded(str(error))}')
            except Exception as error:  # memory for example; what is shown stays
                if not self._slot.closed:
                    self.get_logger().error(f'pattern.type = {settings.pattern.type!r} is not '
                                            f'shown: {type(error).__name__}: {error}')

    def _show(self, settings):
        """Make a pattern, or the frame that is shown instead, and publish it."""
        what = settings.type if settings.frame == PATTERN else settings.frame
        size = f'{what}, {settings.width} x {settings.height} px'
        started = time.monotonic()
        if settings.width * settings.height > _LARGE:
            self.get_logger().info(f'making {size}')
        pattern = make_frame(settings.frame, settings.expected)
        text = describe(settings.expected, pattern, settings.frame)
        header = Header.at(self.get_clock().now().nanoseconds, FRAME)
        data = serialized(image(pattern, 'rgb8', header))
        del pattern  # before the middleware makes its copy
        if self._slot.closed:
            return
        self._image.publish(data)
        self._info.publish(String(data=text))
        self.get_logger().info(f'showing {size}, made in {time.monotonic() - started:.1f} s')


def _check(settings):
    """Refuse what cannot be shown, by a ColorStereoError, without making it."""
    check_pattern(settings.pattern.expected)
