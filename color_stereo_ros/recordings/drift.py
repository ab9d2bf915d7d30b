# SPDX-License-Identifier: Apache-2.0
"""By how much the cameras of a recording have moved since they were calibrated."""

from ..errors import RecordingError
from .offline import OfflineSensor


class DriftSensor(OfflineSensor):
    """
    Measures the pairs of a recording as `OfflineSensor` does, and writes nothing.

    Parameters
    ----------
    recording : Recording
    topics : StereoTopics
    settings : RangeNodeSettings
    say : callable

    """

    def __init__(self, recording, topics, settings, say=print):
        super().__init__(recording, None, topics, settings, None, say=say)
        self.health = None
        """The Health after the last pair; None: no pair was measured."""

    @property
    def calibration(self):
        """Return the StereoCalibration of the recording, or None."""
        return self._watch.calibration

    def _recalibrate(self):
        """Refuse a second calibration: the drift refers to one."""
        if self.health is not None:
            raise RecordingError(f'{self._recording.path}: the calibration changes within the '
                                 'recording; the drift belongs to one calibration')
        super()._recalibrate()

    def _write(self, result, header, time_ns):
        self.health = result.health
