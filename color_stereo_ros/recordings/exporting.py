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
"""A recording of pairs in, files for other programs out."""

from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
import re

import numpy as np

from .carrying import TaskStereo
from .measuring import PairSensor
from .products import DEFAULT_PRODUCTS, MILLIMETERS, PRODUCTS, Shot
from .reading import seconds
from .tasks import pairs_per_task, readable_plan, tasks_of
from ..errors import RecordingError, SettingsError
from ..files.claim import claimed
from ..files.film import film
from ..messages.contents import Header
from ..messages.outputs import Context
from ..messages.trimming import trimmed

FRAMES = re.compile(r'-?\d+|(-?\d+)?:(-?\d+)?(:\d+)?')
SLOWEST, FASTEST = 0.1, 120.0
"""Pictures a second of a film."""


@dataclass(frozen=True)
class Wanted:
    """What is exported."""

    products: tuple = DEFAULT_PRODUCTS
    """Names of PRODUCTS."""
    frames: str = ''
    """Pairs, see `chosen_frames`."""
    depth_scale: float = MILLIMETERS
    """Numbers a meter of 16-bit depth images."""
    rate: float = None
    """Pictures a second of a film; None: as fast as they were recorded."""
    overwrite: bool = False
    """Replace files that are not of an earlier run."""


def chosen_frames(text, count):
    """
    Return the pairs that a text names.

    Parameters
    ----------
    text : str
        Indices from 0 and slices as in Python, separated by commas: '0,10:20:2'. Negative ones
        count from the end. Empty: all.
    count : int
        Pairs that there are.

    Returns
    -------
    indices : list of int
        In order, each once.

    Raises
    ------
    SettingsError
        If the text is no such list, names a pair that is not there, or none at all.

    """
    found = set()
    for part in (text or ':').replace(' ', '').split(','):
        if not FRAMES.fullmatch(part):
            raise SettingsError(f'--frames {text}: {part!r} is no index and no slice, expected '
                                'such as 0,10:20:2')
        if ':' in part:
            limits = [int(word) if word else None for word in part.split(':')]
            if limits[2:] == [0]:
                raise SettingsError(f'--frames {text}: a step of 0 leads nowhere')
            found |= set(range(count)[slice(*limits)])
        elif -count <= int(part) < count:
            found.add(int(part) % count)
        else:
            raise SettingsError(f'--frames {text}: there is no pair {part}, the recording has '
                                f'{count}: 0 .. {count - 1}')
    if not found:
        raise SettingsError(f'--frames {text}: names none of the {count} pairs')
    return sorted(found)


def stems(rows):
    """Return what the names of the files of each pair begin with: its stamp in s, text."""
    seen, names = Counter(), []
    for stamp in rows['left_stamp'].tolist():
        seen[stamp] += 1
        names.append(seconds(stamp) + (f'_{seen[stamp]}' if seen[stamp] > 1 else ''))
    return names


class Export:
    """
    One run of `color_stereo export`.

    Parameters
    ----------
    recording : Recording
    folder : str or Path
        To fill.
    topics : StereoTopics
    settings : RangeNodeSettings
    wanted : Wanted

    """

    def __init__(self, recording, folder, topics, settings, wanted=Wanted()):
        self._recording, self._folder, self._topics = recording, Path(folder), topics
        self._settings, self._wanted = settings, wanted
        self._products = [PRODUCTS[name] for name in dict.fromkeys(wanted.products)]
        self.plan = self.frames = None
        """The Plan, and the indices of the chosen pairs, once they are known."""
        self.sensor = None
        """The PairSensor, once it has begun: how the pairs fared."""
        self.files = 0
        """Files that were written."""

    def pair(self, say, tick=lambda message: None):
        """Find the pairs, see `readable_plan`, and choose among them."""
        self.plan = readable_plan(self._recording, self._topics, self._settings, say, tick)
        self.frames = chosen_frames(self._wanted.frames, len(self.plan.rows))

    def passes(self):
        """
        Return the tasks that hold chosen pairs, up to the last of these.

        A pair is measured within the task in which `color_stereo convert` measures it, after the
        same pairs. Therefore its values are the same.

        Returns
        -------
        passes : list of (Task, dict)
            The dict has the places of chosen pairs in the task, and their indices in the plan.

        """
        chosen, passes, first = set(self.frames), [], 0
        for task in tasks_of(self.plan.rows, pairs_per_task(self._settings)):
            places = {place: first + place for place in range(len(task.rows))
                      if first + place in chosen}
            first += len(task.rows)
            if places:
                passes.append((replace(task, rows=task.rows[:max(places) + 1]), places))
        return passes

    @property
    def pairs(self):
        """Return how many pairs are measured, those before chosen ones included."""
        return sum(len(task.rows) for task, _ in self.passes())

    def measure(self, say, tick=lambda: None):
        """
        Measure the chosen pairs and write their files, each whole or not at all.

        Parameters
        ----------
        say : callable
            Called with a sentence about a pair that is refused, or odd.
        tick : callable
            Called after each pair.

        Raises
        ------
        RecordingError
            If the folder holds foreign files of the same names, or not a single pair could be
            measured.

        """
        names = stems(self.plan.rows)
        single = [item for item in self._products if not item.film]
        films = [item for item in self._products if item.film]
        files = [f'{names[index]}_{item.ending}' for index in self.frames for item in single]
        with claimed(self._folder, 'export', files + [item.ending for item in films],
                     overwrite=self._wanted.overwrite), ExitStack() as reels:
            adders = [(item, reels.enter_context(film(self._folder / item.ending, self._rate())))
                      for item in films]
            for index, shot in self._shots(say, tick):
                for item in single:
                    item.write(self._folder / f'{names[index]}_{item.ending}', shot)
                for item, add in adders:
                    add(item.write(shot))
                self.files += len(single)
            if not self.sensor.measured:
                raise RecordingError(
                    f'{self._recording.path}: no pair could be measured: all '
                    f'{self.sensor.failed} chosen pairs were refused; the first: '
                    f'{self.sensor.first_failure}')
        self.files += len(films)

    def _shots(self, say, tick):
        """Yield index and Shot of each chosen pair that could be measured."""
        now = [0]
        self.sensor = PairSensor(self._topics, self._settings, say, lambda: now[0] * 1e-9)
        silent = PairSensor(self._topics, self._settings, lambda text: None)
        measured = TaskStereo(self._topics, self._settings, self.plan.calibrations.__getitem__)
        for task, places in self.passes():
            stereo = measured.before(self._recording, task)
            for place, pair in enumerate(measured.pairs(self._recording, task.rows)):
                now[0] = pair.recorded
                sensor = self.sensor if place in places else silent
                result = sensor.measure(stereo, pair)
                if result is not None and place in places:
                    yield places[place], self._shot(result, pair)
                tick()

    def _shot(self, result, pair):
        context = Context.of(Header.of(pair.left.header), self._settings, pair.calibration)
        return Shot(trimmed(result, context), context, pair.stamp, self._wanted.depth_scale)

    def _rate(self):
        """Return the pictures a second of a film."""
        if self._wanted.rate is not None:
            return self._wanted.rate
        steps = np.diff(self.plan.rows['time'][self.frames])
        steps = steps[steps > 0]
        return float(np.clip(1e9 / np.median(steps), SLOWEST, FASTEST)) if steps.size else 1.0
