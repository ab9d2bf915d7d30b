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
"""The frames of pattern_node in a recording, as the cameras saw them."""

from .pairs import pairs_of
from ..errors import ImageError, RecordingError
from ..messages.pairs import rgb_pair

INFO = 'pattern/info'
NANOSECONDS = 1e9


def read_recorded_frames(recording, stream, left, right, info, say):
    """
    Give the pairs of a recording to a FrameStream.

    A pair has the time of its stamp, a text of pattern/info that at which it was recorded: both
    clocks must be the same.

    Parameters
    ----------
    recording : Recording
        An open recording.
    stream : FrameStream
        Takes the frames.
    left, right, info : str
        Topics of the images and of pattern/info.
    say : callable
        Called with a sentence about a message that cannot be read.

    Raises
    ------
    RecordingError
        If the recording does not say what was shown.

    """
    if not recording.counts.get(info):
        raise RecordingError(f'{recording.path}: holds no message of {info}, which says what the '
                             'projector shows; record it, too')

    def shown(message):
        stream.shown(recording.decoded(message).data, message.time_ns / NANOSECONDS)

    for pair in pairs_of(recording, left, right, say, {info: shown}):
        try:
            pair = rgb_pair(pair)
        except ImageError as error:
            say(str(error))
            continue
        stream.take(pair.left, pair.right, pair.stamp / NANOSECONDS)
