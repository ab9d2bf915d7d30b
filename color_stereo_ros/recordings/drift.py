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
"""By how much the cameras of a recording have moved since they were calibrated."""

from .measuring import make_stereo, PairSensor
from .pairing import Pairing
from ..core.settings import updated
from ..errors import RecordingError


class DriftSensor:
    """
    Measures the pairs of a recording as the node does, and writes nothing.

    Parameters
    ----------
    recording : Recording
    topics : StereoTopics
    settings : RangeNodeSettings
    say : callable

    """

    def __init__(self, recording, topics, settings, say=print):
        if settings.health.correct == 'off':  # ask all cells, see docs/health.md
            settings = updated(settings, {'health.correct': 'suggest'})
        self._recording, self._settings = recording, settings
        self._pairing = Pairing(recording, topics, settings, say)
        self._sensor = PairSensor(topics, settings, say)
        self._stereo = None
        self.health = None
        """The Health after the last pair; None: no pair was measured."""
        self.calibration = None
        """The StereoCalibration of the recording, or None."""

    @property
    def measured(self):
        """Return how many pairs gave a result."""
        return self._sensor.measured

    def take(self, message):
        """
        Take a RecordedMessage of one of the four input topics.

        Raises
        ------
        RecordingError
            If the calibration changes: the drift refers to one.

        """
        for pair in self._pairing.take(message):
            self._use(pair.calibration)
            result = self._sensor.measure(self._stereo, pair)
            if result is not None:
                self.health = result.health

    def _use(self, calibration):
        if self._stereo is None:
            self.calibration = calibration
            self._stereo = make_stereo(calibration, self._settings)
        elif calibration is not self.calibration:
            raise RecordingError(f'{self._recording.path}: the calibration changes within the '
                                 'recording; the drift belongs to one calibration')

    def finish(self):
        """Raise RecordingError if not a single pair could be measured."""
        if not self.measured:
            reason = self._sensor.first_failure or self._pairing.reason()
            raise RecordingError(f'{self._recording.path}: no pair could be measured: {reason}')
