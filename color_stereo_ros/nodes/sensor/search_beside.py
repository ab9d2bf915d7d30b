# SPDX-License-Identifier: Apache-2.0
"""A search in a thread of its own, while pairs go on."""

import threading


class SearchBeside:
    """Runs one search at a time."""

    NAME = 'search'
    """Of the thread."""

    def __init__(self):
        self._thread = None

    def begin(self, search, *arguments):
        """Call search(*arguments) in a thread of its own; call it only where nothing is `busy`."""
        self._thread = threading.Thread(target=search, args=arguments, name=self.NAME, daemon=True)
        self._thread.start()

    @property
    def busy(self):
        """Return whether a search is under way."""
        return self._thread is not None and self._thread.is_alive()
