# SPDX-License-Identifier: Apache-2.0
"""The input topics of range_node: what arrives, is refused, or is paired."""

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.serialization import deserialize_message

from sensor_msgs.msg import CameraInfo, Image

from ...errors import ImageError
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
        self._complain = Complaints(lambda text: logger.error(text))
        self._warn = Complaints(lambda text: logger.warning(text))
        self._settings = parameters.settings
        sync = self._settings.sync
        self.synchronizer = Synchronizer(sync.tolerance, sync.queue_size)
        self.calibration = CalibrationWatch(
            on_calibration, check=lambda calibration: check_use(calibration, self._settings))
        self.refused = dict.fromkeys(SIDES, 0)
        """Images that were refused, by side."""
        self.refusals = dict.fromkeys(SIDES)
        """Why the latest image was refused, or None if it was not, by side."""
        self._image_frame = None
        self.zero_stamps = False
        """The latest image had a stamp of zero."""
        self.subscriptions = [self._subscribe(parameters, side, kind)
                              for side in SIDES for kind in (Image, CameraInfo)]
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=False), post_callback=self._jump_back)

    def _jump_back(self, _):
        self.synchronizer.jump_back(self._node.get_clock().now().nanoseconds)

    def _subscribe(self, parameters, side, kind):
        topic = f'{side}/{"image_raw" if kind is Image else "camera_info"}'
        take = self._take_image if kind is Image else self.calibration.add
        # images are read from their bytes: rclpy's conversion holds the interpreter for 1 ms each
        return FollowingSubscription(self._node, kind, topic, lambda msg: take(side, msg),
                                     parameters, raw=kind is Image)

    def _take_image(self, side, data):
        try:
            msg = read_image(data, otherwise=_deserialized_image)
            check_image(msg)
        except ImageError as error:
            self.refused[side] += 1
            self.refusals[side] = f'{side} image refused: {error}'
            self._complain(self.refusals[side])
            return
        self.refusals[side] = None
        self._look_at_header(side, msg)
        pair = self.synchronizer.add(side, stamp_ns(msg.header), msg)
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
    def frame_warning(self):
        """Return how the frames of the latest left image and camera_info differ, or None."""
        calibrated, frame = self.calibration.frame_id, self._image_frame
        if None in (calibrated, frame) or frame == calibrated:
            return None
        return (f'left image has frame_id {frame!r}, left camera_info {calibrated!r}: the outputs '
                'carry that of the image')

    def configure(self, settings):
        """Take new settings."""
        used = [(each.input.rectified, each.output.frame) for each in (self._settings, settings)]
        self._settings = settings
        self.synchronizer.tolerance = settings.sync.tolerance
        self.synchronizer.queue_size = settings.sync.queue_size
        if used[0] != used[1]:
            self.calibration.review()

    def follow(self):
        """Look after the subscriptions and a calibration that settles."""
        for subscription in self.subscriptions:
            subscription.follow()
        self.calibration.tick()

    def destroy(self):
        """Unsubscribe from everything."""
        self._jumps.unregister()
        for subscription in self.subscriptions:
            subscription.destroy()


def _deserialized_image(data):
    """Return the Image in bytes of a middleware whose format only rclpy knows."""
    return deserialize_message(data, Image)
