# SPDX-License-Identifier: Apache-2.0
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
