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
"""
What `range_node` does with a pair, for the pairs of a recording, without ROS.

Calibration, processing and the contents of the messages are the node's own, so the outputs hold
the same values.

"""

from .reading import seconds
from .refusals import TOLD
from ..core import ColorStereo, ColorStereoError, ImageError
from ..core.doubts import Doubts
from ..messages.contents import Header, new_memory
from ..messages.decompressing import opened
from ..messages.frames import frames_of, TOPIC
from ..messages.outputs import Context, OUTPUTS
from ..messages.projector import projector_info, ProjectorNews, TOPIC as PROJECTOR
from ..messages.reading import image_to_rgb
from ..messages.significant_bits import SignificantBits
from ..messages.synchronizer import Pair
from ..messages.trimming import trimmed
from ..patience import patience

DEFAULT_TOPICS = 'points', 'depth/image', 'depth/camera_info'
VIEWS = 'views/image'
"""Joins the default topics where the projector may be a third view."""


def make_stereo(calibration, settings):
    """Return the ColorStereo of a calibration and RangeNodeSettings."""
    with patience():
        return ColorStereo(calibration, settings.core,
                           rectified_input=settings.input.rectified,
                           covariance=settings.health.read_covariance())


class PairSensor:
    """
    Measures pairs of messages, and accounts for them.

    Parameters
    ----------
    topics : StereoTopics
    settings : RangeNodeSettings
    say : callable
        Called with a sentence about a pair that is refused, or odd.

    """

    def __init__(self, topics, settings, say=print):
        self._topics, self._settings, self._say = topics, settings, say
        self._values = SignificantBits()
        self._recorded = 0
        self._doubts = Doubts(self._doubt, clock=lambda: self._recorded * 1e-9)
        self._told = 0
        self.measured = 0
        """Pairs that gave a result."""
        self.failed = 0
        """Pairs that were refused."""
        self.first_failure = None
        """Which pair was refused first, and why, as text; None if none was."""

    def measure(self, stereo, pair):
        """
        Measure a pair.

        Parameters
        ----------
        stereo : ColorStereo
            The sensor.
        pair : FoundPair
            Where the pair lies in the recording.

        Returns
        -------
        result : RangeResult or None
            None: the pair was refused.

        """
        self._recorded = pair.recorded
        try:
            images = self.images_of(pair)
            result = stereo.process(*images)
        except ColorStereoError as error:
            self._refuse(f'pair of stamp {pair.stamp} ns, recorded at {seconds(pair.recorded)} s, '
                         f'refused: {error}')
            return None
        self.measured += 1
        self._doubts.look(stereo, *images, result)
        return result

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

    def images_of(self, pair):
        """
        Return both images of a FoundPair as RGB; say once what is odd about their values.

        Returns
        -------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)

        Raises
        ------
        ImageError
            If one of them cannot be read.

        """
        bits = self._settings.input.significant_bits
        pair = opened(Pair(pair.left.content, pair.right.content, pair.stamp, 0, 0.0))
        images = (_rgb(pair.left, bits, self._topics.left_image),
                  _rgb(pair.right, bits, self._topics.right_image))
        self._values.note(pair)
        news = self._values.news(bits)
        if news:
            self._say(news)
        return images


class OutputWriter:
    """
    Appends the outputs of results to a recording.

    Parameters
    ----------
    writer : RecordingWriter
    settings : RangeNodeSettings
    outputs : sequence of str or None
        Relative topics to write; None = DEFAULT_TOPICS, and VIEWS under a third view.
    namespace : str
        Goes before the outputs: '/' or '/NAME/'.

    """

    def __init__(self, writer, settings, outputs, namespace):
        self._writer, self._settings = writer, settings
        self._wanted, self._namespace = outputs, namespace
        self._projector = ProjectorNews()
        self._frames = None
        self._kept = {}

    def write(self, result, pair):
        """Append the outputs of a RangeResult of a FoundPair."""
        settings, header = self._settings, Header.of(pair.left.header)
        self._write_frames(frames_of(header.frame_id, pair.calibration, settings.output),
                           pair.time_ns)
        context = Context.of(header, settings, pair.calibration).with_memory(self._memory)
        shown = trimmed(result, context)
        for topic in self._topics_of(result):
            content = OUTPUTS[topic].content(shown, context)
            self._writer.write_content(self._namespace + topic, pair.time_ns, content)
        model = self._projector.model(result.projector, pair.time_ns * 1e-9)
        if model is not None:
            self._writer.write_content(self._namespace + PROJECTOR, pair.time_ns,
                                       projector_info(model, header.stamp), latched=True)

    def _memory(self, size):
        """Return bytes for one message; those of the message before are written by now."""
        if size not in self._kept:
            self._kept = {size: new_memory(size)}
        return self._kept[size]

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
