# SPDX-License-Identifier: Apache-2.0
"""The range sensor inside of range_node and its lifecycle twin: inputs, worker, outputs."""

from rclpy.clock import Clock, ClockType

from ...core.triangulation import disparity_limits
from ...errors import bounded
from ...messages.calibration_watch import check_use
from ...messages.outputs import Context
from ...messages.trimming import trimmed
from .capture import Capture
from .diagnostics import Diagnostics
from .inputs import StereoInputs
from .outputs import Outputs
from .pattern_watch import PatternWatch
from .projector_info import ProjectorInfo
from .save import Save
from .services import ServiceThread
from .static_frames import StaticFrames
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
    folder : SaveFolder
    active : bool
        Measure at once. False: take calibrations and get ready, but measure no pair.

    """

    def __init__(self, node, parameters, folder, active=True):
        self._node = node
        self.active = active
        """Whether pairs are measured."""
        self._logger = node.get_logger()
        self.settings = parameters.settings
        self.skipped = 0
        """Pairs that nobody wanted."""
        self.outputs = Outputs(node)
        self.pattern = PatternWatch(node, parameters)
        self.projector = ProjectorInfo(node)
        self.frames = StaticFrames(node)
        self.worker = Worker(Setup(None, self.settings), self._publish, self._fail, self._logger,
                             self.outputs.prepare)
        self.inputs = StereoInputs(node, parameters, self._take_pair, self._recalibrate)
        self.diagnostics = Diagnostics(node, self)
        self._services = ServiceThread(node)
        self.capture = Capture(node, self._services, self)
        self.save = Save(node, self._services, self, self.capture, folder)
        self._look_after_timer = node.create_timer(_LOOK_AFTER_PERIOD, self._look_after,
                                                   clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._services.start()
        self.worker.start()

    def check(self, settings):
        """Refuse settings that do not fit the calibration in force, by a ColorStereoError."""
        calibration = self.inputs.calibration.calibration
        if calibration is not None:
            check_use(calibration, settings)
            disparity_limits(calibration.geometry, settings.range)

    def configure(self, settings):
        """Take new settings from the next pair on."""
        self.settings = settings
        self.inputs.configure(settings)
        self.pattern.configure(settings.pattern)
        self.diagnostics.configure(settings)
        self.worker.configure(Setup(self.inputs.calibration.calibration, settings))

    def _recalibrate(self):
        watch = self.inputs.calibration
        self.worker.configure(Setup(watch.calibration, self.settings))
        if watch.error is not None:
            self._logger.error(bounded(f'calibration refused: {watch.error}'))
        elif watch.calibration is not None:
            geometry = watch.calibration.geometry
            self._logger.info(
                f'calibration taken: {geometry.width} x {geometry.height} px, focal length '
                f'{geometry.focal_x:.1f} px, baseline {geometry.baseline * 1000:.1f} mm')
            for warning in watch.warnings:
                self._logger.warning(bounded(warning))

    def _take_pair(self, pair):
        """Hand a pair to the worker if anybody wants it; runs in the executor's thread."""
        if not self.active:
            return
        self._note_frames(pair)
        requested = self.capture.takes(pair)
        streaming = self.settings.input.mode == 'stream' and self.outputs.wanted()
        if requested or streaming:
            self.worker.submit(pair)
        else:
            self.skipped += 1

    def _note_frames(self, pair):
        """Publish the transform between the cameras before anything that needs it."""
        calibration = self.inputs.calibration.calibration
        if calibration is not None:
            self.frames.note(pair.left.header.frame_id, calibration, self.settings.output)

    def _publish(self, result, pair, setup):
        """Publish a result, the points first; runs in the worker's thread."""
        topics = self.outputs.wanted()
        context = Context.of(pair.left.header, setup.settings, setup.calibration)
        shown = trimmed(result, context)
        self.outputs.publish(topics[:1], shown, context)
        self.worker.note_published(pair)
        self.outputs.publish(topics[1:], shown, context)
        self.projector.note(result.projector, context.header)
        self.capture.succeed(pair, result, context)

    def _fail(self, pair, text):
        self.capture.fail(pair, text)

    def why_no_result(self, request, patience):
        """
        Say why a request got no result in time.

        Parameters
        ----------
        request : capture.Request
        patience : float
            s for which it has waited.

        Returns
        -------
        text : str

        """
        watch = self.inputs.calibration
        if not self.active:
            return 'the node is inactive'
        if self.worker.state != 'ready':
            return f'the node is {self.worker.state}'
        if request.acquired:
            return (f'the pair has arrived, but it is not measured yet, {patience:.1f} s after '
                    'the call: raise sync.warn_after')
        return (self.inputs.refusal() or watch.error or self.inputs.complaint(patience)
                or self._about_pairs_before(request, patience))

    @staticmethod
    def _about_pairs_before(request, patience):
        """Say how old the pairs are that do arrive."""
        text = f'no pair that was taken after the call has arrived within {patience:.1f} s'
        if request.age is None:
            return text
        return (f'{text}: pairs arrive, but their stamps are {request.age * 1e-9:.1f} s old then; '
                'the clocks of cameras and node differ, or the images are under way for so long')

    def _look_after(self):
        self.inputs.follow()
        self.pattern.follow()
        self.outputs.look_for_mismatches()
        complaint = self.inputs.complaint(self.settings.sync.warn_after)
        if self.inputs.refusal():
            pass  # said when it came
        elif complaint:
            self._logger.warning(bounded(complaint), throttle_duration_sec=_WARN_PERIOD)
        elif self.inputs.calibration.calibration is None and self.inputs.calibration.missing:
            if self.inputs.synchronizer.report().pairs:
                self._logger.warning(
                    f'images arrive, but no {" and no ".join(self.inputs.calibration.missing)} '
                    'camera_info', throttle_duration_sec=_WARN_PERIOD)

    def destroy(self):
        """Stop working and leave all topics and services."""
        self._services.destroy()
        self._node.destroy_timer(self._look_after_timer)
        self.pattern.destroy()
        self.projector.destroy()
        self.frames.destroy()
        self.inputs.destroy()
        self.worker.stop()
        self.outputs.destroy()
        self.capture.destroy()
        self.diagnostics.destroy()
