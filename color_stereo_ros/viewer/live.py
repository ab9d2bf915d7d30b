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
"""Frames of a running `range_node`: what it publishes, beside the raw pair of the same stamp."""

from contextlib import contextmanager
import time

import numpy as np

from .frame import Frame
from .page import PERIOD
from ..core import CalibrationError, ColorStereoError, ImageError, StereoCalibration
from ..core.results import RangeResult
from ..core.triangulation import disparity_from_depth, disparity_limits
from ..messages.pairs import rgb_pair
from ..messages.published import depth_of, values_of
from ..messages.reading import image_to_rgb, stamp_ns
from ..nodes.live import Collector, ros_node
from ..nodes.live_pairs import LivePairs
from ..recordings.reading import seconds
from ..recordings.topics import STEREO_TOPICS

OUTPUTS = ('depth/image', 'confidence/image', 'status/image', 'views/image', 'depth_std/image',
           'left/image_rect_color')
KEPT = 10  # raw pairs
PATIENCE = 5.0  # s without a frame before somebody is told why


class LiveFrames:
    """
    Makes frames of messages.

    Parameters
    ----------
    node : rclpy.node.Node
    namespace : str
    named : sequence of str or None
        Topics of both images and both camera_infos where they have other names.
    settings : RangeNodeSettings

    """

    def __init__(self, node, namespace, named, settings):
        from rclpy.qos import qos_profile_sensor_data
        from sensor_msgs.msg import CameraInfo, Image
        self._node, self._settings, self._named = node, settings, namespace.strip('/')
        prefix = f'/{self._named}/' if self._named else '/'
        compressed = settings.input.transport == 'compressed'
        usual = [name + '/compressed' * (compressed and 'image' in name)
                 for name in STEREO_TOPICS.names]
        topics = [given or prefix + name for given, name in zip(named, usual)]
        self._outputs = Collector(node, self._named, dict.fromkeys(OUTPUTS, Image))
        self._pairs = LivePairs(node, topics[:2], compressed)
        self._raw, self._infos, self._calibration = {}, {}, None
        self._kept = [node.create_subscription(
            CameraInfo, topic, lambda info, side=side: self._learn(side, info),
            qos_profile_sensor_data) for side, topic in zip(('left', 'right'), topics[2:])]
        self._last, self._complaint = None, None
        self.names = [prefix + 'depth/image', *topics]
        """Topics that a frame needs, among others."""

    def _learn(self, side, info):
        """Take a camera_info."""
        if self._infos.get(side) == info:
            return
        self._infos[side] = info
        if len(self._infos) == 2:
            try:
                self._calibration = StereoCalibration.from_camera_info(
                    self._infos['left'], self._infos['right'])
            except CalibrationError as error:
                self._calibration, self._complaint = None, str(error)

    def spin(self):
        """Take what has come, for a tenth of a second at most."""
        import rclpy
        rclpy.spin_once(self._node, timeout_sec=0.1)
        pair = self._pairs.latest()
        if pair is not None:
            self._raw[pair.stamp] = pair
            while len(self._raw) > KEPT:
                del self._raw[next(iter(self._raw))]

    def take(self):
        """Return the Frame that has come since the last call, or None."""
        messages = self._outputs.complete_set()
        if messages is None or self._calibration is None:
            return None
        stamp = stamp_ns(messages['depth/image'].header)
        if stamp == self._last:
            return None
        self._last = stamp
        self._outputs.forget()
        try:
            return self._frame(stamp, messages)
        except ColorStereoError as error:
            self._complaint = str(error)
            return None

    def _frame(self, stamp, messages):
        pair = self._raw.get(stamp)
        pair = pair and rgb_pair(pair)
        result = result_from(messages, self._calibration.geometry, self._settings.core.range)
        return Frame(f'live, stamp {seconds(stamp)} s', result, self._calibration,
                     pair and pair.left, pair and pair.right, self._settings.input.rectified)

    def first(self, say):
        """
        Wait for the first Frame.

        Parameters
        ----------
        say : callable
            Called with a sentence about what is missing, now and then.

        """
        told = time.monotonic()
        while True:
            self.spin()
            frame = self.take()
            if frame is not None:
                return frame
            if time.monotonic() - told > PATIENCE:
                say(self.missing())
                told = time.monotonic()

    def missing(self):
        """Return what a frame lacks, as a sentence."""
        if self._complaint:
            return self._complaint
        silent = [topic for topic, count in self._outputs.received.items() if not count]
        silent += [f'{side}/camera_info' for side in ('left', 'right') if side not in self._infos]
        if silent:
            return f'nothing comes on {", ".join(silent)}: does range_node run there?'
        return 'the outputs come, but never all of one stamp'

    def feed(self, page):
        """Give a page each new frame, not faster than a browser draws; ends by an interrupt."""
        shown = 0.0
        while True:
            self.spin()
            page.tick()
            if page.held or time.monotonic() - shown < PERIOD:
                continue
            frame = self.take()
            if frame is not None:
                page.show(frame, moving=True)
                shown = time.monotonic()


def result_from(messages, geometry, limits):
    """
    Return the RangeResult that a set of published messages amounts to.

    Parameters
    ----------
    messages : dict
        Names of OUTPUTS to sensor_msgs/Image of one stamp.
    geometry : RectifiedGeometry
        Of the rectified pair.
    limits : RangeSettings
        The depths that are searched.

    Raises
    ------
    ImageError
        If an output has another size than the cameras.

    """
    depth = depth_of(messages['depth/image'])
    if depth.shape != (geometry.height, geometry.width):
        raise ImageError(f'depth/image has {depth.shape[1]} x {depth.shape[0]} px, the cameras '
                         f'have {geometry.width} x {geometry.height}: the page needs '
                         'output.decimation 1')
    disparity = disparity_from_depth(depth, geometry).astype(np.float32)
    std = values_of(messages['depth_std/image'])
    # dZ = Z^2 / (f B) dd, as in `RangeResult.depth_std`
    return RangeResult(
        disparity=disparity, depth=depth, confidence=values_of(messages['confidence/image']),
        status=values_of(messages['status/image']),
        disparity_std=std * np.float32(geometry.focal_baseline) / (depth * depth),
        views=values_of(messages['views/image']),
        image_source=image_to_rgb(messages['left/image_rect_color']), geometry=geometry,
        disparity_limits=disparity_limits(geometry, limits))


@contextmanager
def live_frames(namespace, named, settings):
    """
    Listen while the block runs, see LiveFrames.

    Raises
    ------
    ModuleNotFoundError
        If rclpy is not installed.

    """
    with ros_node('color_stereo_view') as node:
        yield LiveFrames(node, namespace, named, settings)
