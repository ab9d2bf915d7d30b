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
"""The pairs of images in a recording, whether its cameras are calibrated or not."""

from ..errors import ImageError, RecordingError
from ..messages.pairs import rgb_pair
from ..messages.reading import stamp_ns
from ..messages.synchronizer import Synchronizer

QUEUE = 20  # images that wait for their partner


def pairs_of(recording, left, right, say, others=None):
    """
    Yield the pairs of a recording as they are; `messages.pairs.rgb_pair` makes images of them.

    Parameters
    ----------
    recording : Recording
        An open recording.
    left, right : str
        Topics of the images, raw or compressed.
    say : callable
        Called with a sentence about a message that cannot be read; its pair is left out.
    others : dict, optional
        Other topics to what is called with each of their messages, a RecordedMessage, in turn.

    Yields
    ------
    pair : Pair
        Of messages.

    """
    synchronizer = Synchronizer(queue_size=QUEUE, clock=lambda: 0.0)
    others = others or {}
    for message in recording.messages({left, right, *others}):
        if message.topic in others:
            others[message.topic](message)
            continue
        side = 'left' if message.topic == left else 'right'
        try:
            content = recording.decoded(message)
        except RecordingError as error:
            say(str(error))
            continue
        pair = synchronizer.add(side, stamp_ns(content.header), content)
        if pair is not None:
            yield pair


def recorded_pairs(recording, left, right, say):
    """
    Yield the pairs of a recording as images.

    Parameters
    ----------
    recording : Recording
        An open recording.
    left, right : str
        Topics of the images, raw or compressed.
    say : callable
        Called with a sentence about an image that cannot be read; its pair is left out.

    Yields
    ------
    pair : Pair
        Of RGB images, uint8 (H, W, 3).

    """
    for pair in pairs_of(recording, left, right, say):
        try:
            yield rgb_pair(pair)
        except ImageError as error:
            say(str(error))
