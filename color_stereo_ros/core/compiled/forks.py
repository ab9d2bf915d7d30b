# SPDX-License-Identifier: Apache-2.0
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
