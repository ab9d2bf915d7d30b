# SPDX-License-Identifier: Apache-2.0
"""The search for the projector in a thread of its own, while two views measure."""

import threading


class ProjectorSearch:
    """Searches a pair that does not show the projector where it is expected."""

    def __init__(self):
        self._thread = None

    def look(self, stereo, result):
        """
        Begin a search if this pair calls for one and none is under way.

        Parameters
        ----------
        stereo : ColorStereo
        result : RangeResult
            Holds images of its own.

        """
        if result.projector is None or not result.projector.due or self.busy:
            return
        self._thread = threading.Thread(target=_search, args=(stereo, result),
                                        name='projector search', daemon=True)
        self._thread.start()

    @property
    def busy(self):
        """Return whether a search is under way."""
        return self._thread is not None and self._thread.is_alive()


def _search(stereo, result):
    found = stereo.search_projector(result)
    if not stereo.projector.agreeing:  # else it was dark for a moment, and is where it was
        stereo.adopt_projector(found)
