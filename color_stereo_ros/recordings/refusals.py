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
"""The account of the messages of a recording that cannot be decoded."""

from collections import Counter

TOLD = 5
"""So many messages are told one by one; the rest is counted."""


class Refusals:
    """
    Counts the messages that were refused, and tells of the first ones.

    Parameters
    ----------
    say : callable
        Called with a sentence.

    """

    def __init__(self, say):
        self._say = say
        self._counts = Counter()
        self.first = None
        """Why the first one was refused, or None."""

    def add(self, message, reason):
        """
        Count a message.

        Parameters
        ----------
        message : RecordedMessage
            That cannot be read.
        reason : object
            A sentence, or an error with such a text.

        """
        self._counts[message.topic] += 1
        self.first = self.first or reason
        if len(self) <= TOLD:
            self._say(f'refused: {reason}')
        elif len(self) == TOLD + 1:
            self._say('more are refused; they are counted at the end')

    def count(self, topic):
        """Return how many messages of a topic were refused."""
        return self._counts[topic]

    def __len__(self):
        return self._counts.total()

    def __str__(self):
        topics = ', '.join(f'{count} on {topic}' for topic, count in sorted(self._counts.items()))
        return f'{len(self)} messages refused ({topics or "none"})'
