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
"""What the readers of damaged files find: topics, messages, and what is lost."""

from dataclasses import dataclass, field


@dataclass(eq=False)
class Connection:
    """One topic of a damaged recording."""

    topic: str
    msgtype: str
    is_latched: bool
    msgcount: int = 0


class Connections:
    """The topics of a damaged recording, each once, whichever file names it."""

    def __init__(self):
        self._by_topic = {}

    def of(self, topic, msgtype, quality):
        """
        Return the Connection of a topic.

        Parameters
        ----------
        topic, msgtype : str
            As the recording names them.
        quality : str
            The offered quality of service, as recorders write it.

        """
        return self._by_topic.setdefault(topic, Connection(
            topic, msgtype, 'transient_local' in quality or 'durability: 1' in quality))

    def used(self):
        """Return the topics that have messages."""
        return [connection for connection in self._by_topic.values() if connection.msgcount]


@dataclass
class Loss:
    """What cannot be read."""

    cut: list = field(default_factory=list)
    """Texts about files that end early."""
    pieces: int = 0
    """Chunks that are damaged."""
    messages: int = 0
    """Messages that are damaged, or missing among the others."""

    def __str__(self):
        damaged = [f'damaged {what}: {count}' for count, what in (
            (self.pieces, 'chunks'), (self.messages, 'messages')) if count]
        return '; '.join([*self.cut, *damaged]) or 'only the index is lost'
