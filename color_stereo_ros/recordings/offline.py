# SPDX-License-Identifier: Apache-2.0
"""
What `range_node` does, from one recording into another: every pair, none dropped, without ROS.

Pairing, calibration, processing and the contents of the messages are the node's own, so the
outputs hold the same values.

"""

from collections import deque

from ..core import ColorStereo, ColorStereoError, ImageError, RecordingError
from ..core.doubts import Doubts
from ..messages.calibration_watch import CalibrationWatch, check_use
from ..messages.contents import CompressedImage, Header, Image
from ..messages.decompressing import opened
from ..messages.frames import frames_of, TOPIC
from ..messages.outputs import Context, OUTPUTS
from ..messages.projector import projector_info, ProjectorNews, TOPIC as PROJECTOR
from ..messages.reading import image_to_rgb, stamp_ns
from ..messages.significant_bits import SignificantBits
from ..messages.synchronizer import Synchronizer
from ..messages.trimming import trimmed
from ..patience import patience
from .reading import seconds
from .refusals import Refusals, TOLD
from .times import OutputTimes

DEFAULT_TOPICS = 'points', 'depth/image', 'depth/camera_info'
VIEWS = 'views/image'
"""Joins the default topics where the projector may be a third view."""

WAITING = 50
"""Pairs that wait for a calibration; older ones are given up."""


class OfflineSensor:
    """
    Takes recorded messages in their order, appends outputs to a recording.

    Parameters
    ----------
    recording : Recording
        Where the messages come from.
    writer : RecordingWriter
    topics : StereoTopics
    settings : RangeNodeSettings
    outputs : sequence of str or None
        Relative topics to write; None = DEFAULT_TOPICS, and VIEWS under a third view.
    namespace : str or None
        Goes before the outputs; None = what the names of both images begin with.
    say : callable
        Called with a sentence about a message, pair or calibration that is refused.

    """

    def __init__(self, recording, writer, topics, settings, outputs, namespace=None, say=print):
        self._recording = recording
        self._writer = writer
        self._namespace = (topics.common_namespace if namespace is None
                           else f'/{namespace}/'.replace('//', '/'))
        self._topics = topics
        self._settings = settings
        self._wanted = outputs
        self._projector = ProjectorNews()
        self._say = say
        self._times = OutputTimes()
        self._now = 0
        self._synchronizer = Synchronizer(settings.sync.tolerance, settings.sync.queue_size,
                                          clock=self._clock)
        self._watch = CalibrationWatch(
            self._recalibrate, clock=self._clock,
            check=lambda calibration: check_use(calibration, settings))
        self._stereo = self._frames = None
        self._waiting = deque(maxlen=WAITING)
        self._values = SignificantBits()
        self._doubts = Doubts(self._doubt, clock=self._clock)
        self._told = 0
        self.measured = 0
        """Pairs that gave a result."""
        self.failed = 0
        """Pairs that were refused."""
        self.first_failure = None
        """Which pair was refused first, and why, as text; None if none was."""
        self.unpaired = 0
        """Images that found no partner, or no calibration in time."""
        self.refusals = Refusals(say)
        """The messages that could not be decoded."""

    def _clock(self):
        return self._now * 1e-9

    def take(self, message):
        """Take a RecordedMessage of one of the four input topics."""
        self._now = message.time_ns
        try:
            content = self._recording.decoded(message)
        except RecordingError as error:
            self.refusals.add(message, error)
            return
        side = 'left' if message.topic in (self._topics.left_image,
                                           self._topics.left_info) else 'right'
        if message.type not in (Image.TYPE, CompressedImage.TYPE):
            self._watch.add(side, content)
        else:
            pair = self._synchronizer.add(side, stamp_ns(content.header), content)
            if pair is not None:
                self._waiting.append((pair, self._now))
        self._watch.tick()
        self._measure_waiting()

    def finish(self):
        """
        Count what is left over.

        Raises
        ------
        RecordingError
            If not a single pair could be measured: then there is no result to keep.

        """
        counts = self._recording.counts
        self.unpaired = (counts[self._topics.left_image] + counts[self._topics.right_image]
                         - self.refusals.count(self._topics.left_image)
                         - self.refusals.count(self._topics.right_image)
                         - 2 * (self.measured + self.failed))
        if not self.measured:
            raise RecordingError(f'{self._recording.path}: no pair could be measured: '
                                 f'{self._watch.error or self._reason()}')

    @property
    def complete(self):
        """Tell whether nothing was refused."""
        return not self.failed and not self.refusals

    def _reason(self):
        if self.refusals:
            return f'{self.refusals}; the first: {self.refusals.first}'
        if self._watch.missing:
            return f'no camera_info of the {" and the ".join(self._watch.missing)} camera'
        if self.failed:
            return f'all {self.failed} pairs were refused; the first: {self.first_failure}'
        return 'no left and right image have stamps that fit together'

    def _recalibrate(self):
        self._stereo = None
        if self._watch.error is not None:
            self._say(f'calibration refused: {self._watch.error}')
        elif self._watch.calibration is not None:
            with patience():
                self._stereo = ColorStereo(self._watch.calibration, self._settings.core,
                                           rectified_input=self._settings.input.rectified,
                                           covariance=self._settings.health.read_covariance())

    def _measure_waiting(self):
        while self._stereo is not None and self._waiting:
            pair, recorded = self._waiting.popleft()
            try:
                images = self._images_of(pair)
                result = self._stereo.process(*images)
            except ColorStereoError as error:
                self._refuse(f'pair of stamp {pair.stamp} ns, recorded at {seconds(recorded)} s, '
                             f'refused: {error}')
                continue
            header = Header.of(pair.left.header)
            self._write(result, header, self._times.of(pair.stamp, recorded))
            self.measured += 1
            self._doubts.look(self._stereo, *images, result)

    def _refuse(self, text):
        """Count a pair; the first ones are told one by one."""
        self.failed += 1
        self.first_failure = self.first_failure or text
        if self.failed <= TOLD:
            self._say(text)
        elif self.failed == TOLD + 1:
            self._say('more pairs are refused; they are counted at the end')

    def _doubt(self, text):
        """Tell what is odd about a pair; of many doubts only the first ones are told."""
        self._told += 1
        if self._told <= TOLD:
            self._say(f'warning: {text}')
        elif self._told == TOLD + 1:
            self._say('more pairs are odd; that is not told any more')

    def _images_of(self, pair):
        """Return both images of a pair as RGB, and say once what is odd about their values."""
        bits, pair = self._settings.input.significant_bits, opened(pair)
        images = (_rgb(pair.left, bits, self._topics.left_image),
                  _rgb(pair.right, bits, self._topics.right_image))
        self._values.note(pair)
        news = self._values.news(bits)
        if news:
            self._say(news)
        return images

    def _write(self, result, header, time_ns):
        """Append the outputs."""
        calibration, settings = self._watch.calibration, self._settings
        self._write_frames(frames_of(header.frame_id, calibration, settings.output), time_ns)
        context = Context.of(header, settings, calibration)
        shown = trimmed(result, context)
        for topic in self._topics_of(result):
            content = OUTPUTS[topic].content(shown, context)
            self._writer.write_content(self._namespace + topic, time_ns, content)
        model = self._projector.model(result.projector, time_ns * 1e-9)
        if model is not None:
            self._writer.write_content(self._namespace + PROJECTOR, time_ns,
                                       projector_info(model, header.stamp), latched=True)

    def _topics_of(self, result):
        """Return the outputs of a result."""
        if self._wanted is not None:
            return self._wanted
        return DEFAULT_TOPICS if result.projector is None else (*DEFAULT_TOPICS, VIEWS)

    def _write_frames(self, frames, time_ns):
        """Append the transform between physical and rectified camera, where it is news."""
        if frames.differ and frames != self._frames:
            self._writer.write_content(TOPIC, time_ns, frames.transform(time_ns), latched=True)
        self._frames = frames


def _rgb(image, bits, topic):
    """Return the image of a message as RGB; an error names its topic."""
    try:
        return image_to_rgb(image, bits)
    except ImageError as error:
        raise ImageError(f'{topic}: {error}') from error
