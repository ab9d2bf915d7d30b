# SPDX-License-Identifier: Apache-2.0
"""Notice that kernels are compiled, which takes long, instead of loaded, which does not."""

from contextlib import contextmanager

from numba.core import event


class _FirstOnly(event.Listener):
    """Calls a function when the first compilation starts."""

    def __init__(self, tell):
        self._tell = tell

    def on_start(self, event):
        """Tell, once."""
        tell, self._tell = self._tell, None
        if tell is not None:
            tell()

    def on_end(self, event):
        """Nothing: the next one follows."""


@contextmanager
def listening(tell):
    """Call `tell` once if something is compiled during the block, when that begins."""
    with event.install_listener('numba:compile', _FirstOnly(tell)):
        yield
