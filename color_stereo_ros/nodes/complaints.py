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
"""Say each thing at once, but not again and again."""

import time

_SILENCE = 5.0
_REMEMBERED = 64


class Complaints:
    """
    Passes a text on unless it passed the same text within the last 5 s.

    Parameters
    ----------
    say : callable
        Takes a text, for example the `error` of a logger.
    clock : callable
        Returns s; only its differences matter.

    """

    def __init__(self, say, clock=time.monotonic):
        self._say = say
        self._clock = clock
        self._said = {}  # text -> when, the oldest first

    def __call__(self, text):
        """Say a text if it is news."""
        now = self._clock()
        last = self._said.pop(text, None)
        if last is not None and now - last < _SILENCE:
            self._said[text] = last
            return
        self._said[text] = now
        while len(self._said) > _REMEMBERED:
            del self._said[next(iter(self._said))]
        self._say(text)
