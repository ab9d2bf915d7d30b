# SPDX-License-Identifier: Apache-2.0
"""The search for the projector in a thread of its own, while two views measure."""

from .search_beside import SearchBeside


class ProjectorSearch(SearchBeside):
    """Searches a pair that does not show the projector where it is expected."""

    NAME = 'projector search'

    def look(self, stereo, result):
        """
        Begin a search if this pair calls for one and none is under way.

        Parameters
        ----------
        stereo : ColorStereo
            The sensor.
        result : RangeResult
            Holds images of its own.

        """
        if result.projector is None or not result.projector.due or self.busy:
            return
        self.begin(_search, stereo, result)


def _search(stereo, result):
    found = stereo.search_projector(result)
    if not stereo.projector.agreeing:  # else it was dark for a moment, and is where it was
        stereo.adopt_projector(found)
