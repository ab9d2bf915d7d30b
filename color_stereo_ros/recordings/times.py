# SPDX-License-Identifier: Apache-2.0
"""At which times of a recording the outputs stand."""


class OutputTimes:
    """
    Gives each output the time of its stamp, where the stamps are usable.

    A stamp of zero or less comes from a clock that had not started. If the first one is such a
    stamp, no stamp of the recording is trusted: all outputs stand at the time at which the pair
    was recorded. A later one stands as far from the other outputs as its pair was recorded from
    theirs.

    """

    def __init__(self):
        self._trusted = None
        self._offset = 0

    def of(self, stamp, recorded):
        """
        Return the time of the outputs of a pair.

        Parameters
        ----------
        stamp : int
            Of the left image, ns.
        recorded : int
            When the pair was recorded, ns.

        Returns
        -------
        time_ns : int
            Not negative: recordings hold no other times.

        """
        if self._trusted is None:
            self._trusted = stamp > 0
        if self._trusted and stamp > 0:
            self._offset = stamp - recorded
            return stamp
        return max(recorded + self._offset, 0)
