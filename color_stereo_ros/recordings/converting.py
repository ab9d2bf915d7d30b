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
"""A recording of pairs in, a recording of outputs out."""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from .accounts import Tally, Teller
from .engine import run_tasks
from .mcap_writing import DEFAULT_COMPRESSION
from .memory import keep_memory
from .parts import Parts
from .tasks import pairs_per_task, readable_plan, tasks_of
from .working import for_workers, Run, Writing
from .writing import check_writable
from .. import __version__
from ..core.settings import flat
from ..errors import RecordingError
from ..files.atomic import check_place


@dataclass(frozen=True)
class Work:
    """Who works, and what is done with a result that is there."""

    workers: int = 1
    """Processes of this machine."""
    scheduler: str = None
    """Address of a Dask scheduler; None: this machine works."""
    overwrite: bool = False
    """Replace the result, if it is a recording."""
    resume: bool = False
    """Go on with the parts of a run that was stopped."""
    restart: bool = False
    """Remove them."""


class Conversion:
    """
    One run of `color_stereo convert`.

    Parameters
    ----------
    recording : Recording
    result : str or Path
        Folder to make; it appears when it is complete.
    topics : StereoTopics
    settings : RangeNodeSettings
    outputs : sequence of str or None
        Relative topics to write, see OutputWriter.
    namespace : str or None
        Goes before the outputs; None = what the names of both images begin with.
    work : Work
    compression : str
        One of `mcap_writing.COMPRESSIONS`.

    Raises
    ------
    RecordingError
        If the result may not be written.

    """

    def __init__(self, recording, result, topics, settings, outputs=None, namespace=None,
                 work=Work(), compression=DEFAULT_COMPRESSION):
        check_writable(result, work.overwrite)
        check_place(result)
        self._recording, self._result, self._topics = recording, Path(result), topics
        self._settings = for_workers(settings)
        self._outputs, self._work = outputs and tuple(outputs), work
        self._compression = compression
        self._namespace = (topics.common_namespace if namespace is None
                           else f'/{namespace}/'.replace('//', '/'))
        self._parts = Parts(self._result.resolve())
        if not (work.resume or work.restart):
            self._parts.check_none()
        self.plan = None
        """The Plan, once it is made."""
        self.tally = Tally()

    @property
    def path(self):
        """Return the path of the recording."""
        return self._recording.path

    @property
    def loss(self):
        """Return what cannot be read of a damaged recording, as text, or None."""
        return self._recording.loss

    def pair(self, say, tick=lambda message: None):
        """Find the pairs, see `readable_plan`."""
        keep_memory()
        self.plan = readable_plan(self._recording, self._topics, self._settings, say, tick)

    def measure(self, say, tick=lambda count: None):
        """
        Measure the pairs and write the result.

        Parameters
        ----------
        say : callable
            Called with a sentence about a pair that is refused, or odd.
        tick : callable
            Called with a number of pairs that are done.

        Raises
        ------
        RecordingError
            If not a single pair could be measured: then there is no result to keep.

        """
        if self._work.restart:
            self._parts.remove()
        tasks = tasks_of(self.plan.rows, pairs_per_task(self._settings))
        with self._parts.opened(self._identity(), self._settings,
                                self.plan.calibrations, resume=self._work.resume):
            try:
                self._measure(tasks, Teller(say), tick)
            except BaseException:
                if kept := len(self._parts.done()):
                    say(f'{kept} of {len(tasks)} parts are done and kept; the same command with '
                        '--resume goes on')
                raise
            if not self.tally.measured:
                self._parts.remove()
                raise RecordingError(f'{self._recording.path}: {self.tally.reason()}')
            self._parts.join(len(tasks), overwrite=self._work.overwrite)

    def _measure(self, tasks, teller, tick):
        done = set(self._parts.done())
        for index in done:
            self.tally.add(self._parts.account(index))
            tick(len(tasks[index].rows))
        left = [task for task in tasks if task.index not in done]
        with closing(run_tasks(self._run(), left, workers=self._work.workers,
                               scheduler=self._work.scheduler, tick=tick)) as accounts:
            for account in accounts:
                self.tally.add(account)
                for text in account['said']:
                    teller.tell(text)

    def _run(self):
        return Run(str(self._recording.path.resolve()), str(self._parts.folder),
                   self._topics.names,
                   Writing(self._outputs, self._namespace, self._compression), uuid4().hex,
                   self._recording.loss is not None)

    def _identity(self):
        """Return what the parts depend on."""
        path = self._recording.path.resolve()
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        return {'version': __version__, 'recording': str(path),
                'bytes': sum(file.stat().st_size for file in files if file.is_file()),
                'pairs': len(self.plan.rows), 'topics': list(self._topics.names),
                'outputs': self._outputs and list(self._outputs), 'namespace': self._namespace,
                'compression': self._compression,
                'settings': flat(self._settings)}
