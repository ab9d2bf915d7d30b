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
Refuse to compute in a process that was forked from one that has computed.

fork copies the memory of a process, but only one of its threads. numba and OpenCV go on as if
their threads were there, and the child dies or waits for ever. Nothing can start them again.

"""

import os

from ...errors import ForkError


class _History:
    """What this process and its parents have done."""

    def __init__(self):
        self.used = False
        self.forked_after_use = False

    def note_fork(self):
        """Note it; runs in the child."""
        self.forked_after_use = self.used


_HISTORY = _History()
os.register_at_fork(after_in_child=_HISTORY.note_fork)


def refuse_after_fork():
    """
    Note that this process computes.

    Raises
    ------
    ForkError
        If it was forked from a process that had computed before.

    """
    if _HISTORY.forked_after_use:
        raise ForkError(
            f'process {os.getpid()} was forked from one that had used ColorStereo, and has none '
            "of its threads: start it with multiprocessing.get_context('spawn') instead, and make "
            'a ColorStereo of its own in it')
    _HISTORY.used = True
