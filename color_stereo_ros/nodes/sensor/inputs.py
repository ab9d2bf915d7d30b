# SPDX-License-Identifier: Apache-2.0
"""The input topics of range_node: what arrives, is refused, or is paired."""

from functools import partial
import time

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.serialization import deserialize_message

from sensor_msgs.msg import CameraInfo, Image

from ...errors import bounded, brief, ImageError
from ...messages.calibration_watch import CalibrationWatch, check_use
from ...messages.reading import check_image, read_image, stamp_ns
from ...messages.synchronizer import SIDES, Synchronizer
from ..complaints import Complaints
from ..following import FollowingSubscription


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
        self.images = {side: self._subscribe(parameters, side, Image) for side in SIDES}
        infos = {side: self._subscribe(parameters, side, CameraInfo) for side in SIDES}
        self.subscriptions = [subscription for side in SIDES
                              for subscription in (self.images[side], infos[side])]
        self.shared = []
        """Sentences about topics with more than one publisher."""
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=False), post_callback=self._jump_back)

    def _jump_back(self, _):
        self.synchronizer.jump_back(self._node.get_clock().now().nanoseconds)

    def _subscribe(self, parameters, side, kind):
        topic = f'{side}/{"image_raw" if kind is Image else "camera_info"}'
        take = self._take_image if kind is Image else self.calibration.add
        # images are read from their bytes: rclpy's conversion holds the interpreter for 1 ms each
        return FollowingSubscription(self._node, kind, topic, partial(take, side), parameters,
                                     raw=kind is Image)

    def _take_image(self, side, data, received):
        try:
            msg = read_image(data, otherwise=_deserialized_image)
            check_image(msg)
        except ImageError as error:
            self.refused[side] += 1
            text = f'{side} image refused: {error}'
            self._refusals[side] = text, time.monotonic()
            self._complain(text)
            return
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
        return '; '.join([text, *refused, *filter(None, map(_about_transport,
                                                            self.images.values()))])

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
        self._settings = settings
        self.synchronizer.tolerance = settings.sync.tolerance
        self.synchronizer.queue_size = settings.sync.queue_size
        self._patience = settings.sync.warn_after
        if used[0] != used[1]:
            self.calibration.review()

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


def _about_transport(subscription):
    """Say what to do about images that come in another form only, or None."""
    others = subscription.other_transports()
    if not others:
        return None
    topic, transport = others[0], others[0].rpartition('/')[2]
    return (f'nobody publishes {subscription.name}, but {topic} has a publisher: the node reads '
            f'raw images; run "ros2 run image_transport republish --ros-args '
            f'-p in_transport:={transport} -p out_transport:=raw -r in/{transport}:={topic} '
            f'-r out:={subscription.name}"')


def _deserialized_image(data):
    """Return the Image in bytes of a middleware whose format only rclpy knows."""
    return deserialize_message(data, Image)
