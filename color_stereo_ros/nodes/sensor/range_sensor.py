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
"""The range sensor inside of range_node and its lifecycle twin: inputs, worker, outputs."""

from rclpy.clock import Clock, ClockType

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
from ...core.color_calibration import check_color
from ...core.triangulation import disparity_limits
from ...errors import bounded
from ...messages.calibration_watch import check_use
from ...messages.outputs import Context
from ...messages.trimming import trimmed

_LOOK_AFTER_PERIOD = 0.25
_WARN_PERIOD = 5.0
_SHARE = 0.9
"""Of the time that a capture waited: without a pair for so long, none came since the call."""


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
        self._latest = self._kept = None  # the latest pair; the same if nobody wanted it yet
        self.outputs = Outputs(node, parameters)
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
        """Refuse settings that do not fit the calibrations in force, by a ColorStereoError."""
        calibration = self.inputs.calibration.calibration
        if calibration is not None:
            check_use(calibration, settings)
            disparity_limits(calibration.geometry, settings.range)
        check_color(settings.core, calibration)

    def configure(self, settings):
        """Take new settings from the next pair on."""
        self.settings = settings
        self.outputs.configure(settings.input.mode)
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
            self.capture.note(pair)
            return
        self._note_frames(pair)
        requested = self.capture.takes(pair)
        self._latest, self._kept = pair, None
        if requested or self.streams:
            self.worker.submit(pair)
        else:
            self.skipped += 1
            self._kept = pair

    def _measure_latched(self):
        """Measure a latched pair that came before a listener or a calibration: none follows."""
        if not self.inputs.are_latched:
            self._latest = self._kept = None
            return
        pair = self._latest
        waits = pair is not None and (pair is self._kept or pair is self.worker.unmeasured)
        if (waits and self.active and self.streams
                and self.inputs.calibration.calibration is not None):
            self._kept = None
            self.worker.submit(pair)

    @property
    def streams(self):
        """Return whether every pair is measured, because somebody listens."""
        return self.settings.input.mode == 'stream' and bool(self.outputs.wanted())

    def _note_frames(self, pair):
        """Publish the transform between the cameras before anything that needs it."""
        calibration = self.inputs.calibration.calibration
        if calibration is not None:
            self.frames.note(pair.left.header.frame_id, calibration, self.settings.output)

    def _publish(self, result, pair, setup):
        """Publish a result, the points first; runs in the worker's thread."""
        result = self.capture.merged(pair, result)
        if result is None:
            return
        context = Context.of(pair.left.header, setup.settings, setup.calibration)
        self.outputs.publish(trimmed(result, context), context,
                             lambda: self.worker.note_published(pair))
        self.projector.note(result.projector, context.header)
        self.capture.succeed(pair, result, context)

    def _fail(self, pair, text):
        self.capture.fail(pair, text)

    def why_no_result(self, timeout, about_pairs=None):
        """
        Say why a capture got no result in time.

        Parameters
        ----------
        timeout : float
            s for which it has waited.
        about_pairs : str, optional
            What is to be said of pairs that came in this time.

        Returns
        -------
        text : str

        """
        watch = self.inputs.calibration
        if not self.active:
            return 'the node is inactive'
        if self.worker.state != 'ready':
            return f'the node is {self.worker.state}'
        reason = self.inputs.refusal() or watch.error
        if reason:
            return reason
        patience = _SHARE * min(timeout, self.settings.sync.warn_after)
        reasons = filter(None, (self.inputs.complaint(patience), about_pairs))
        return '; '.join(reasons) or f'no pair has arrived within {timeout:.1f} s after the call'

    def _look_after(self):
        self.inputs.follow()
        self.pattern.follow()
        self.outputs.look_for_mismatches()
        self.outputs.publish_to_late()
        self._measure_latched()
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
