# SPDX-License-Identifier: Apache-2.0
"""
What `range_node` does, from one recording into another: every pair, none dropped.

Pairing, calibration, processing and messages are the node's own, so the outputs are the same
bytes.

"""

from collections import deque

from rclpy.serialization import deserialize_message, serialize_message

from ..cli.replay import message_class
from ..core import ColorStereo, ColorStereoError, RecordingError
from ..messages.calibration_watch import CalibrationWatch
from ..messages.images import image_to_rgb, stamp_ns
from ..messages.synchronizer import Synchronizer
from ..nodes.sensor.outputs import Outputs
from ..patience import patience
from .recording import IMAGE

WAITING = 50
"""Pairs that wait for a calibration; older ones are given up."""


class OfflineNode:
    """
    Takes recorded messages in their order, appends outputs to a recording.

    Parameters
    ----------
    writer : RecordingWriter
    topics : StereoTopics
    settings : RangeNodeSettings
    outputs : sequence of str
        Relative topics to write.
    say : callable
        Called with a sentence about a pair or calibration that is refused.

    """

    def __init__(self, writer, topics, settings, outputs, say=print):
        namespace = topics.left_image.removesuffix('left/image_raw')
        self._topics = topics
        self._settings = settings
        self._wanted = list(outputs)
        self._say = say
        self._now = 0
        self._outputs = Outputs(_RecordingGraph(writer, namespace))
        self._synchronizer = Synchronizer(settings.sync.tolerance, settings.sync.queue_size,
                                          clock=self._clock)
        self._watch = CalibrationWatch(self._recalibrate, clock=self._clock)
        self._stereo = None
        self._waiting = deque(maxlen=WAITING)
        self.measured = 0
        """Pairs that gave a result."""
        self.failed = 0
        """Pairs that were refused."""
        self.unpaired = 0
        """Images that found no partner, or no calibration in time."""

    def _clock(self):
        return self._now * 1e-9

    def take(self, message):
        """Take a RecordedMessage of one of the four input topics."""
        self._now = message.time_ns
        content = deserialize_message(message.data, message_class(message.type))
        side = 'left' if message.topic in (self._topics.left_image,
                                           self._topics.left_info) else 'right'
        if message.type != IMAGE:
            self._watch.add(side, content)
        else:
            pair = self._synchronizer.add(side, stamp_ns(content.header), content)
            if pair is not None:
                self._waiting.append(pair)
        self._watch.tick()
        self._measure_waiting()

    def finish(self, recording):
        """
        Count what is left over.

        Raises
        ------
        RecordingError
            If not a single pair could be measured: then there is no result to keep.

        """
        self.unpaired = (recording.counts[self._topics.left_image]
                         + recording.counts[self._topics.right_image]
                         - 2 * (self.measured + self.failed))
        if not self.measured:
            raise RecordingError(f'{recording.path}: no pair could be measured: '
                                 f'{self._watch.error or self._reason()}')

    def _reason(self):
        if self._watch.missing:
            return f'no camera_info of the {" and the ".join(self._watch.missing)} camera'
        if self.failed:
            return f'all {self.failed} pairs were refused'
        return 'no left and right image have stamps that fit together'

    def _recalibrate(self):
        self._stereo = None
        if self._watch.error is not None:
            self._say(f'calibration refused: {self._watch.error}')
        elif self._watch.calibration is not None:
            with patience():
                self._stereo = ColorStereo(self._watch.calibration, self._settings.core,
                                           rectified_input=self._settings.input.rectified)

    def _measure_waiting(self):
        while self._stereo is not None and self._waiting:
            pair = self._waiting.popleft()
            try:
                result = self._stereo.process(image_to_rgb(pair.left), image_to_rgb(pair.right))
            except ColorStereoError as error:
                self.failed += 1
                self._say(f'pair of stamp {stamp_ns(pair.left.header)} ns refused: {error}')
                continue
            rotation = self._watch.calibration.left.R.T
            self._outputs.publish(self._wanted, result, pair.left.header, self._settings, rotation)
            self.measured += 1


class _RecordingGraph:
    """Stands where `Outputs` expects a node: publishing appends to a recording."""

    def __init__(self, writer, namespace):
        self._writer = writer
        self._namespace = namespace

    def create_publisher(self, kind, topic, *_, **__):
        """Return an object with the method `publish`."""
        return _RecordingPublisher(self._writer, kind, self._namespace + topic)


class _RecordingPublisher:

    def __init__(self, writer, kind, topic):
        package = kind.__module__.partition('.')[0]
        self._writer, self._topic = writer, topic
        self._type = f'{package}/msg/{kind.__name__}'

    def publish(self, message):
        """Append a message at its own stamp."""
        self._writer.write(self._topic, self._type, stamp_ns(message.header),
                           serialize_message(message))
