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
from contextlib import closing, contextmanager, ExitStack
from dataclasses import dataclass
from pathlib import Path
import re
import shutil
from uuid import uuid4

import numpy as np

from .accounts import Tally, Teller
from .engine import run_tasks
from .export_tasks import ChosenTask, Exporting, film_picture
from .memory import keep_memory
from .products import DEFAULT_PRODUCTS, MILLIMETERS, PRODUCTS
from .reading import seconds
from .tasks import pairs_per_task, readable_plan, tasks_of
from .working import for_workers, prepare, Run
from ..errors import RecordingError, SettingsError
from ..files.atomic import naming, sweep
from ..files.claim import claimed
from ..files.film import film

FRAMES = re.compile(r'-?\d+|(-?\d+)?:(-?\d+)?(:\d+)?')
SLOWEST, FASTEST = 0.1, 120.0
"""Pictures a second of a film."""
HIDDEN = '.color_stereo_export_parts'
"""Folder within the result: settings for the workers, and pictures until they are in a film."""


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
    workers : int
        Processes of this machine.
    scheduler : str, optional
        Address of a Dask scheduler: its workers measure.

    """

    def __init__(self, recording, folder, topics, settings, wanted=Wanted(), workers=1,
                 scheduler=None):
        self._recording, self._folder, self._topics = recording, Path(folder), topics
        self._settings, self._wanted = for_workers(settings), wanted
        self._workers, self._scheduler = workers, scheduler
        self._products = [PRODUCTS[name] for name in dict.fromkeys(wanted.products)]
        self.plan = self.frames = None
        """The Plan, and the indices of the chosen pairs, once they are known."""
        self.tally = Tally()
        """How the chosen pairs fared."""
        self.files = 0
        """Files that were written."""

    def pair(self, say, tick=lambda message: None):
        """Find the pairs, see `readable_plan`, and choose among them."""
        keep_memory()
        self.plan = readable_plan(self._recording, self._topics, self._settings, say, tick)
        self.frames = chosen_frames(self._wanted.frames, len(self.plan.rows))

    def tasks(self):
        """
        Return the tasks that hold chosen pairs, up to the last of these.

        A pair is measured within the task in which `color_stereo convert` measures it, after the
        same pairs. Therefore its values are the same.

        Returns
        -------
        tasks : list of ChosenTask

        """
        names = stems(self.plan.rows)
        chosen, tasks, first = set(self.frames), [], 0
        for task in tasks_of(self.plan.rows, pairs_per_task(self._settings)):
            found = {place: names[first + place] for place in range(len(task.rows))
                     if first + place in chosen}
            first += len(task.rows)
            if found:
                tasks.append(ChosenTask(len(tasks), task.rows[:max(found) + 1], task.warm_up,
                                        task.settling, found))
        return tasks

    @property
    def pairs(self):
        """Return how many pairs are measured, those before chosen ones included."""
        return sum(len(task.rows) for task in self.tasks())

    def measure(self, say, tick=lambda count: None):
        """
        Measure the chosen pairs and write their files, each whole or not at all.

        Parameters
        ----------
        say : callable
            Called with a sentence about a pair that is refused, or odd.
        tick : callable
            Called with a number of pairs that are done.

        Raises
        ------
        RecordingError
            If the folder holds foreign files of the same names, or not a single pair could be
            measured.

        """
        tasks = self.tasks()
        single = [item for item in self._products if not item.film]
        films = [item for item in self._products if item.film]
        files = [f'{name}_{item.ending}' for task in tasks for name in task.names.values()
                 for item in single]
        with claimed(self._folder, 'export', files + [item.ending for item in films],
                     overwrite=self._wanted.overwrite), self._parts() as parts, \
                ExitStack() as reels:
            adders = [(item, reels.enter_context(film(self._folder / item.ending, self._rate())))
                      for item in films]
            teller = Teller(say)
            with closing(run_tasks(self._run(parts), tasks, workers=self._workers,
                                   scheduler=self._scheduler, tick=tick)) as accounts:
                for account in in_order(accounts):
                    self._take(account, teller, parts, adders)
            if not self.tally.measured:
                raise RecordingError(f'{self._recording.path}: {self.tally.reason()}')
        self.files = self.tally.measured * len(single) + len(films)

    def _take(self, account, teller, parts, adders):
        """Count a task, and give its pictures to the films."""
        self.tally.add(account)
        for text in account['said']:
            teller.tell(text)
        for name in account['names']:
            for item, add in adders:
                picture = film_picture(parts, name, item)
                add(np.load(picture))
                picture.unlink()

    @contextmanager
    def _parts(self):
        """Yield the hidden folder, with what the workers need."""
        parts = self._folder.resolve() / HIDDEN
        try:
            with naming(self._folder, HIDDEN):
                shutil.rmtree(parts, ignore_errors=True)
                parts.mkdir()
                prepare(parts, self._settings, self.plan.calibrations)
                yield parts
        finally:
            shutil.rmtree(parts, ignore_errors=True)
            sweep(self._folder)  # workers that were ended in the middle of a file

    def _run(self, parts):
        job = Exporting(str(self._folder.resolve()), tuple(dict.fromkeys(self._wanted.products)),
                        self._wanted.depth_scale)
        return Run(str(self._recording.path.resolve()), str(parts), self._topics.names, job,
                   uuid4().hex, self._recording.loss is not None)

    def _rate(self):
        """Return the pictures a second of a film."""
        if self._wanted.rate is not None:
            return self._wanted.rate
        steps = np.diff(self.plan.rows['time'][self.frames])
        steps = steps[steps > 0]
        return float(np.clip(1e9 / np.median(steps), SLOWEST, FASTEST)) if steps.size else 1.0


def in_order(accounts):
    """Yield the accounts of tasks in the order of their indices, each as soon as it can be."""
    waiting, following = {}, 0
    for account in accounts:
        waiting[account['index']] = account
        while following in waiting:
            yield waiting.pop(following)
            following += 1
