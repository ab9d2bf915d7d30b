# SPDX-License-Identifier: Apache-2.0
"""The range sensor inside of range_node and its lifecycle twin: inputs, worker, outputs."""

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration

from .inputs import StereoInputs
from .outputs import Outputs
from .worker import Setup, Worker

_LOOK_AFTER_PERIOD = 0.25


class RangeSensor:
    """
    Measures what the input topics bring and publishes what is wanted.

    Parameters
    ----------
    node : rclpy.node.Node
    parameters : NodeParameters

    """

    def __init__(self, node, parameters):
        self._node = node
        self._parameters = parameters
        self.outputs = Outputs(node)
        self.worker = Worker(Setup(None, parameters.settings), self._publish, node.get_logger())
        self.inputs = StereoInputs(node, parameters, self._take_pair, self._recalibrate)
        self._verdict = None
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_LOOK_AFTER_PERIOD, self._look_after, clock=steady)
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=False),
            post_callback=lambda jump: self.inputs.synchronizer.jump_back(
                node.get_clock().now().nanoseconds))
        self.worker.start()

    def configure(self, settings):
        """Take new settings from the next pair on."""
        self.inputs.configure(settings.sync)
        self.worker.configure(Setup(self.inputs.calibration.calibration, settings))

    def _recalibrate(self):
        watch = self.inputs.calibration
        self.worker.configure(Setup(watch.calibration, self._parameters.settings))
        logger = self._node.get_logger()
        if watch.error is not None:
            logger.error(f'calibration refused: {watch.error}')
        elif watch.calibration is not None:
            geometry = watch.calibration.geometry
            logger.info(
                f'calibration taken: {geometry.width} x {geometry.height} px, focal length '
                f'{geometry.focal_x:.1f} px, baseline {geometry.baseline * 1000:.1f} mm')
            for warning in watch.warnings:
                logger.warning(warning)

    def _take_pair(self, pair):
        if self.outputs.wanted():
            self.worker.submit(pair)

    def _publish(self, result, pair, setup):
        topics = self.outputs.wanted()
        rotation = setup.calibration.left.R.T
        first, others = topics[:1], topics[1:]
        self.outputs.publish(first, result, pair.left.header, setup.settings, rotation)
        self.worker.note_published(pair)
        self.outputs.publish(others, result, pair.left.header, setup.settings, rotation)

    def _look_after(self):
        self.inputs.follow()
        complaint = self.inputs.synchronizer.complaint(self._parameters.settings.sync.warn_after)
        if complaint:
            self._node.get_logger().warning(complaint, throttle_duration_sec=5.0)

    def destroy(self):
        """Stop working and leave all topics."""
        self._jumps.unregister()
        self._node.destroy_timer(self._timer)
        self.inputs.destroy()
        self.worker.stop()
        self.outputs.destroy()
