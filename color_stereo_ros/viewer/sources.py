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
"""Where frames come from: a recording, or image files; measured when somebody asks for them."""

from collections import OrderedDict
from threading import RLock

from .frame import Frame
from ..calibration.pairs import find_pairs
from ..core import RecordingError
from ..recordings.carrying import TaskStereo
from ..recordings.measuring import make_stereo, PairSensor
from ..recordings.reading import seconds
from ..recordings.tasks import readable_plan, tasks_of

KEPT = 8
"""Frames; chosen: a look back costs nothing, and some 100 MB are enough."""


class MeasuredFrames:
    """
    Frames by their number, the last ones of which are kept.

    A subclass gives `__len__`, `name(index)` and `_measured(index)`, which returns a Frame and the
    ColorStereo that has measured it.

    """

    def __init__(self):
        self._kept, self._lock = OrderedDict(), RLock()

    def frame(self, index):
        """
        Return a frame.

        Raises
        ------
        ColorStereoError
            If the pair cannot be read or measured.

        """
        with self._lock:
            if index not in self._kept:
                self._kept[index] = self._measured(index)
            self._kept.move_to_end(index)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
            return self._kept[index][0]

    def curve(self, index, column, row):
        """
        Return the CostCurve of a pixel of a frame that is kept, see `ColorStereo.cost_curve`.

        Nothing is read: any thread may ask, though some recordings are bound to the one that
        opened them. None: there is no curve, or the frame is not kept any more.

        """
        with self._lock:
            if index not in self._kept:
                return None
            frame, stereo = self._kept[index]
            return stereo.cost_curve(frame.left, frame.right, (column, row),
                                     frame.result.alignment)


class RecordedFrames(MeasuredFrames):
    """
    The pairs of a recording.

    A pair has the result that `convert` would give it as the first one of a task: what is carried
    from pair to pair comes from the first pairs of the recording, and from those just before it.

    Parameters
    ----------
    recording : Recording
        Stays open as long as frames are asked for.
    topics : StereoTopics
    settings : RangeNodeSettings
    say, tick : callable
        As for `readable_plan`.

    Raises
    ------
    RecordingError
        If no pair can be read.

    """

    def __init__(self, recording, topics, settings, say=print, tick=lambda message: None):
        super().__init__()
        self._recording, self._settings = recording, settings
        plan = readable_plan(recording, topics, settings, say, tick)
        self._tasks = tasks_of(plan.rows, 1)
        self._stereo = TaskStereo(topics, settings, plan.calibrations.__getitem__)
        self._sensor = PairSensor(topics, settings, say=lambda text: None)

    def __len__(self):
        """Return how many pairs there are."""
        return len(self._tasks)

    def name(self, index):
        """Return number and time of a pair."""
        stamp = int(self._tasks[index].rows[0]['left_stamp'])
        return f'pair {index} of {len(self)}, stamp {seconds(stamp)} s'

    def _measured(self, index):
        task = self._tasks[index]
        stereo = self._stereo.before(self._recording, task)
        for pair in self._stereo.pairs(self._recording, task.rows):
            left, right = self._sensor.images_of(pair)
            frame = Frame(self.name(index), stereo.process(left, right), pair.calibration, left,
                          right, self._settings.input.rectified)
            return frame, stereo
        raise RecordingError(f'{self._recording.path}: {self.name(index)} is not there any more')


class FileFrames(MeasuredFrames):
    """
    Pairs of image files, each of which is measured as `color_stereo process` does.

    Parameters
    ----------
    pairs : list of ImagePair
    calibration : StereoCalibration
    settings : RangeNodeSettings

    """

    def __init__(self, pairs, calibration, settings):
        super().__init__()
        self._pairs, self._calibration, self._settings = pairs, calibration, settings
        self._stereo = make_stereo(calibration, settings)

    @classmethod
    def of_folder(cls, folder, calibration, settings):
        """Return the frames of the image pairs in a folder, see `calibration.pairs.find_pairs`."""
        return cls(find_pairs(folder).pairs, calibration, settings)

    def __len__(self):
        """Return how many pairs there are."""
        return len(self._pairs)

    def name(self, index):
        """Return the name of the left file, and how many there are."""
        return f'{self._pairs[index].name}, pair {index} of {len(self)}'

    def _measured(self, index):
        left, right = self._pairs[index].images()
        self._stereo.reset()
        frame = Frame(self.name(index), self._stereo.process(left, right), self._calibration,
                      left, right, self._settings.input.rectified)
        return frame, self._stereo
