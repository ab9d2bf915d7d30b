# SPDX-License-Identifier: Apache-2.0
"""The range sensor inside of range_node and its lifecycle twin: inputs, worker, outputs."""

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import QoSProfile

from std_msgs.msg import Header, String

from ...core.triangulation import disparity_limits
from ...messages.outputs import Context
from ..filling import message_of
from ..pattern_source import latched
from .capture import CaptureServices
from .diagnostics import diagnostic_array
from .inputs import StereoInputs
from .outputs import Outputs
from .pattern_watch import PatternWatch
from .worker import Setup, Worker

_LOOK_AFTER_PERIOD = 0.25
_WARN_PERIOD = 5.0


class RangeSensor:
    """
    Measures what the input topics bring and publishes what is wanted.

    Parameters
    ----------
    node : rclpy.node.Node
    parameters : NodeParameters
    active : bool
        Measure at once. False: take calibrations and get ready, but measure no pair.

    """

    def __init__(self, node, parameters, active=True):
        self._node = node
        self.active = active
        """Whether pairs are measured."""
        self._logger = node.get_logger()
        self.settings = parameters.settings
        self.skipped = 0
        """Pairs that nobody wanted."""
        self.requests = []
        """Open requests of the services."""
        self.outputs = Outputs(node)
        self.pattern = PatternWatch(self.settings.pattern,
                                    lambda text: self._logger.warning(text))
        self.worker = Worker(Setup(None, self.settings), self._publish, self._fail, self._logger,
                             self.outputs.prepare)
        self.inputs = StereoInputs(node, parameters, self._take_pair, self._recalibrate)
        self._create_entities()
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=False),
            post_callback=lambda jump: self.inputs.synchronizer.jump_back(
                node.get_clock().now().nanoseconds))
        self._services = CaptureServices(node, self)
        self.worker.start()

    def _create_entities(self):
        """Create timers and the topics beside inputs and outputs."""
        node, steady = self._node, Clock(clock_type=ClockType.STEADY_TIME)
        no_events = PublisherEventCallbacks(use_default_callbacks=False)  # see `nodes.qos`
        self._acquired = node.create_publisher(Header, '~/acquired', QoSProfile(depth=1),
                                               event_callbacks=no_events)
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics',
                                                  QoSProfile(depth=1), event_callbacks=no_events)
        self._pattern_info = node.create_subscription(
            String, 'pattern/info', lambda msg: self.pattern.take(msg.data), latched(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))
        self._look_after_timer = node.create_timer(_LOOK_AFTER_PERIOD, self._look_after,
                                                   clock=steady)
        self._diagnostics_timer = node.create_timer(self.settings.output.diagnostics_period,
                                                    self.diagnose, clock=steady)

    def check(self, settings):
        """Refuse settings that do not fit the calibration in force, by a ColorStereoError."""
        calibration = self.inputs.calibration.calibration
        if calibration is not None:
            disparity_limits(calibration.geometry, settings.range)

    def configure(self, settings):
        """Take new settings from the next pair on."""
        self.settings = settings
        self.inputs.configure(settings.sync)
        self.pattern.configure(settings.pattern)
        self._diagnostics_timer.timer_period_ns = round(settings.output.diagnostics_period * 1e9)
        self.worker.configure(Setup(self.inputs.calibration.calibration, settings))

    def _recalibrate(self):
        watch = self.inputs.calibration
        self.worker.configure(Setup(watch.calibration, self.settings))
        if watch.error is not None:
            self._logger.error(f'calibration refused: {watch.error}')
        elif watch.calibration is not None:
            geometry = watch.calibration.geometry
            self._logger.info(
                f'calibration taken: {geometry.width} x {geometry.height} px, focal length '
                f'{geometry.focal_x:.1f} px, baseline {geometry.baseline * 1000:.1f} mm')
            for warning in watch.warnings:
                self._logger.warning(warning)

    def _take_pair(self, pair):
        """Hand a pair to the worker if anybody wants it; runs in the executor's thread."""
        if not self.active:
            return
        requested = [request for request in self.requests
                     if not request.acquired and request.accepts(pair)]
        for request in requested:
            request.acquired = pair
        if requested:
            self._acquired.publish(message_of(pair.left.header))
        streaming = self.settings.input.mode == 'stream' and self.outputs.wanted()
        if requested or streaming:
            self.worker.submit(pair)
        else:
            self.skipped += 1

    def _publish(self, result, pair, setup):
        """Publish a result, the points first; runs in the worker's thread."""
        topics = self.outputs.wanted()
        context = Context(pair.left.header, setup.settings, setup.calibration.left.R.T)
        self.outputs.publish(topics[:1], result, context)
        self.worker.note_published(pair)
        self.outputs.publish(topics[1:], result, context)
        for request in self._requests_for(pair):
            request.finish(result=result, header=context.header, rotation=context.rotation)

    def _fail(self, pair, text):
        for request in self._requests_for(pair):
            request.finish(text)

    def _requests_for(self, pair):
        """Return the requests that a pair answers: theirs, or one that replaced it."""
        return [request for request in list(self.requests)
                if request.acquired and request.acquired.arrival <= pair.arrival]

    def why_no_result(self, patience):
        """Say why a request got no result in time."""
        watch = self.inputs.calibration
        refusals = [text for text in self.inputs.refusals.values() if text]
        if not self.active:
            return 'the node is inactive'
        if self.worker.state != 'ready':
            return f'the node is {self.worker.state}'
        if refusals:
            return '; '.join(refusals)
        return watch.error or self.inputs.synchronizer.complaint(0.0) or (
            f'no pair that was taken after the call has arrived within {patience:.1f} s')

    def _look_after(self):
        self.inputs.follow()
        self.outputs.look_for_mismatches()
        complaint = self.inputs.synchronizer.complaint(self.settings.sync.warn_after)
        if complaint:
            self._logger.warning(complaint, throttle_duration_sec=_WARN_PERIOD)
        elif self.inputs.calibration.calibration is None and self.inputs.calibration.missing:
            if self.inputs.synchronizer.report().pairs:
                self._logger.warning(
                    f'images arrive, but no {" and no ".join(self.inputs.calibration.missing)} '
                    'camera_info', throttle_duration_sec=_WARN_PERIOD)

    def diagnose(self):
        """Publish the diagnostics now."""
        self._diagnostics.publish(diagnostic_array(
            self, self._node.get_fully_qualified_name(), self._node.get_clock().now().to_msg()))

    def destroy(self):
        """Stop working and leave all topics and services."""
        self._services.destroy()
        self._jumps.unregister()
        node = self._node
        for timer in (self._look_after_timer, self._diagnostics_timer):
            node.destroy_timer(timer)
        node.destroy_subscription(self._pattern_info)
        self.inputs.destroy()
        self.worker.stop()
        self.outputs.destroy()
        for publisher in (self._acquired, self._diagnostics):
            node.destroy_publisher(publisher)
