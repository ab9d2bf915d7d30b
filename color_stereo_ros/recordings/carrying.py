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
"""The sensor of tasks: before each one, what is carried from pair to pair is in its true state."""

from .measuring import make_stereo, PairSensor
from .tasks import read_pairs


class TaskStereo:
    """
    Makes the ColorStereo for tasks, and brings it to the state before a task.

    What is expensive is made once: the ColorStereo of a calibration, and its settled state.

    Parameters
    ----------
    topics : StereoTopics
    settings : RangeNodeSettings
    calibration_of : callable
        Returns the StereoCalibration of an index.

    """

    def __init__(self, topics, settings, calibration_of):
        self._topics, self._settings = topics, settings
        self._calibration_of = calibration_of
        self._index = self._stereo = self._calibration = self._settled = None

    def before(self, recording, task):
        """
        Return the ColorStereo in the state before the first pair of a task.

        Parameters
        ----------
        recording : Recording
            An open recording.
        task : Task
            A part of the recording.

        Returns
        -------
        stereo : ColorStereo

        """
        self._use(task.calibration)
        stereo = self._stereo
        stereo.reset()
        if not len(task.settling):
            return stereo
        if self._settled is None:
            self._pass_over(recording, task.settling)
            self._settled = stereo.alignment, stereo.projector, stereo.health
        alignment, projector, health = self._settled
        stereo.adopt(alignment)
        stereo.adopt_projector(projector)
        stereo.adopt_health(health)
        self._pass_over(recording, task.warm_up)
        return stereo

    def pairs(self, recording, rows):
        """Yield the FoundPairs of rows of the task in use, see `read_pairs`."""
        return read_pairs(recording, self._topics, rows, self._calibration)

    def _use(self, index):
        """Make the ColorStereo of a calibration, unless it is the one in use."""
        if index != self._index:
            self._calibration = self._calibration_of(index)
            self._stereo = make_stereo(self._calibration, self._settings)
            self._index, self._settled = index, None

    def _pass_over(self, recording, rows):
        """Measure pairs for what they show of the rig alone."""
        sensor = PairSensor(self._topics, self._settings, say=lambda text: None)
        for pair in self.pairs(recording, rows):
            sensor.measure(self._stereo, pair)
