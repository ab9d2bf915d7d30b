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
"""The input topics of range_node: what arrives, is refused, or is paired."""

from functools import partial
import time

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.serialization import deserialize_message

from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from ..complaints import Complaints
from ..following import FollowingSubscription
from ...errors import bounded, brief, ImageError
from ...messages.calibration_watch import CalibrationWatch, check_use
from ...messages.decompressing import look_at
from ...messages.reading import check_image, read_compressed_image, read_image, stamp_ns
from ...messages.synchronizer import SIDES, Synchronizer

_COMPRESSED = '/compressed'
_TRANSPORTS = 'compressed', 'theora', 'ffmpeg', 'zstd'


class StereoInputs:
    """
    Both cameras: images checked and paired, calibrations watched.

    Parameters
    ----------
    node : rclpy.node.Node
    parameters : NodeParameters
    on_pair : callable
        Called with a `Pair` of `messages.contents.Image`.
    on_calibration : callable
        Called when `calibration` has changed for better or worse.

    """

    def __init__(self, node, parameters, on_pair, on_calibration):
        self._node = node
        self._on_pair = on_pair
        logger = node.get_logger()
        # (rclpy knows a call by its line, and wants one severity for each)
        self._complain = Complaints(lambda text: logger.error(bounded(text)))
        self._warn = Complaints(lambda text: logger.warning(bounded(text)))
        self._settings = parameters.settings
        sync = self._settings.sync
        self.synchronizer = Synchronizer(sync.tolerance, sync.queue_size)
        self.calibration = CalibrationWatch(
            on_calibration, check=lambda calibration: check_use(calibration, self._settings))
        self.refused = dict.fromkeys(SIDES, 0)
        """Images that were refused, by side."""
        self._refusals = {}  # side -> (why the latest image was refused, when)
        self._patience = sync.warn_after
        self._image_frame = None
        self.zero_stamps = False
        """The latest image had a stamp of zero."""
        self.color_doubts = {}
        """What is odd about the color of the latest compressed image, by side."""
        self._parameters = parameters
        self.images = {side: self._subscribe_image(side) for side in SIDES}
        self._infos = {side: self._subscribe_info(side) for side in SIDES}
        self.shared = []
        """Sentences about topics with more than one publisher."""
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=False), post_callback=self._jump_back)

    def _jump_back(self, _):
        self.synchronizer.jump_back(self._node.get_clock().now().nanoseconds)

    @property
    def subscriptions(self):
        """Return all subscriptions, those of the left camera first."""
        return [subscription for side in SIDES
                for subscription in (self.images[side], self._infos[side])]

    def _subscribe_info(self, side):
        return FollowingSubscription(self._node, CameraInfo, f'{side}/camera_info',
                                     lambda msg: self.calibration.add(side, msg),
                                     self._parameters)

    def _subscribe_image(self, side):
        # images are read from their bytes: rclpy's conversion holds the interpreter for 1 ms each
        topic, kind, take = f'{side}/image_raw', Image, self._take_image
        if self._settings.input.transport == 'compressed':
            # image_transport appends its name to what the topic of the images is remapped to
            topic = f'{self._node.resolve_topic_name(topic)}{_COMPRESSED}'
            kind, take = CompressedImage, self._take_compressed_image
        return FollowingSubscription(self._node, kind, topic, partial(take, side),
                                     self._parameters, raw=True)

    def _take_image(self, side, data, received):
        try:
            msg = read_image(data, otherwise=_deserialized(Image))
            check_image(msg)
        except ImageError as error:
            self._refuse(side, error)
        else:
            self._take(side, msg, received)

    def _take_compressed_image(self, side, data, received):
        try:
            msg = read_compressed_image(data, otherwise=_deserialized(CompressedImage))
            doubt = look_at(msg).doubt
        except ImageError as error:
            self._refuse(side, error)
            return
        self.color_doubts[side] = doubt and f'{side} image is {doubt}'
        if doubt:
            self._warn(self.color_doubts[side])
        self._take(side, msg, received)

    def _refuse(self, side, error):
        self.refused[side] += 1
        text = f'{side} image refused: {error}'
        self._refusals[side] = text, time.monotonic()
        self._complain(text)

    def _take(self, side, msg, received):
        self._refusals.pop(side, None)
        self._look_at_header(side, msg)
        stamp = stamp_ns(msg.header)
        pair = self.synchronizer.add(side, stamp, msg, received)
        if pair is None and side == 'left' and self._settings.input.survive_right_loss:
            pair = self.synchronizer.alone(stamp, msg, self._patience)
        if pair is not None:
            self._on_pair(pair)

    def _look_at_header(self, side, msg):
        self.zero_stamps = stamp_ns(msg.header) == 0
        if self.zero_stamps:
            self._warn(f'{side} image has a stamp of zero: pairs cannot be told apart')
        if side == 'left':
            self._image_frame = msg.header.frame_id
            if self.frame_warning:
                self._warn(self.frame_warning)

    @property
    def are_latched(self):
        """Return whether the images of both cameras were published once for all who come."""
        return all(subscription.is_latched for subscription in self.images.values())

    def refusal(self):
        """Return why the images that arrive are refused, or None."""
        now = time.monotonic()
        texts = [self._refusals[side][0] for side in SIDES if side in self._refusals
                 and now - self._refusals[side][1] <= self._patience]
        return '; '.join(texts) or None

    def complaint(self, patience):
        """Say why nothing pairs up, and what to do where that is known; None while it does."""
        text = self.synchronizer.complaint(patience)
        if text is None:
            return None
        refused = [f'the last one was refused: {text}' for text, _ in self._refusals.values()]
        return '; '.join([text, *refused, *filter(None, map(self._about_transport,
                                                            self.images.values()))])

    def _about_transport(self, subscription):
        """Say what to do about images that come in another form only, or None."""
        others = self._other_forms(subscription)
        if not others:
            return None
        text = f'nobody publishes {subscription.name}, but {others[0]} has a publisher'
        raw = subscription.name.removesuffix(_COMPRESSED)
        known = {raw: 'raw', raw + _COMPRESSED: 'compressed'}.get(others[0])
        if known:
            return (f'{text}: set input.transport to {known} ("ros2 param set '
                    f'{self._node.get_fully_qualified_name()} input.transport {known}")')
        transport = others[0].rpartition('/')[2]
        return (f'{text}: the node reads raw images, JPEG and PNG; run "ros2 run image_transport '
                f'republish --ros-args -p in_transport:={transport} -p out_transport:=raw '
                f'-r in/{transport}:={others[0]} -r out:={raw}" and set input.transport to raw')

    def _other_forms(self, subscription):
        """Return the topics beside that of a subscription on which its images have publishers."""
        if subscription.publishers:
            return []
        raw = subscription.name.removesuffix(_COMPRESSED)
        names = [raw, *(f'{raw}/{transport}' for transport in _TRANSPORTS)]
        return [name for name in names if self._node.count_publishers(name)]

    @property
    def frame_warning(self):
        """Return how the frames of the latest left image and camera_info differ, or None."""
        calibrated, frame = self.calibration.frame_id, self._image_frame
        if None in (calibrated, frame) or frame == calibrated:
            return None
        return (f'left image has frame_id {brief(frame)}, left camera_info {brief(calibrated)}: '
                'the outputs carry that of the image')

    def configure(self, settings):
        """Take new settings."""
        used = [(each.input.rectified, each.output.frame) for each in (self._settings, settings)]
        other = settings.input.transport != self._settings.input.transport
        self._settings = settings
        if other:
            self._subscribe_images_again()
        self.synchronizer.tolerance = settings.sync.tolerance
        self.synchronizer.queue_size = settings.sync.queue_size
        self._patience = settings.sync.warn_after
        if used[0] != used[1]:
            self.calibration.review()

    def _subscribe_images_again(self):
        for side, subscription in self.images.items():
            subscription.destroy()
            self.images[side] = self._subscribe_image(side)
        self._refusals.clear()
        self.color_doubts.clear()

    def follow(self):
        """Look after the subscriptions and a calibration that settles."""
        for subscription in self.subscriptions:
            subscription.follow()
        shared = [text for text in map(_about_publishers, self.subscriptions) if text]
        for text in shared:
            if text not in self.shared:
                self._warn(text)
        self.shared = shared
        self.calibration.tick()

    def destroy(self):
        """Unsubscribe from everything."""
        self._jumps.unregister()
        for subscription in self.subscriptions:
            subscription.destroy()


def _about_publishers(subscription):
    """Say by name who shares a topic that one camera should have, or None."""
    names = subscription.publishers
    if len(names) < 2:
        return None
    return (f'{len(names)} publishers on {subscription.name} ({", ".join(sorted(names))}): their '
            'messages are taken in turn; stop or remap all but one')


def _deserialized(kind):
    """Return what reads a message in bytes of a middleware whose format only rclpy knows."""
    return lambda data: deserialize_message(data, kind)
