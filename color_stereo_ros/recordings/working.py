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
"""What a process does that measures tasks of a recording, one at a time."""

from dataclasses import dataclass
from pathlib import Path

import yaml

from .carrying import TaskStereo
from .measuring import OutputWriter, PairSensor
from .reading import Recording
from .topics import StereoTopics
from .writing import open_writer
from .. import __version__
from ..core import RecordingError, StereoCalibration
from ..core.settings import flat, updated
from ..files.atomic import folder_written_whole, write_text
from ..files.yaml import yaml_text
from ..parameters.files import read_settings, settings_text
from ..parameters.groups import RangeNodeSettings

ACCOUNT = 'account.yaml'
"""File of a part that tells how its task went."""
SETTINGS = 'settings.yaml'
FILES = 'color.calibration', 'health.covariance'
"""Settings that name files."""
_workers = {}


def calibration_names(index):
    """Return the names of both files of a calibration."""
    return f'left_{index}.yaml', f'right_{index}.yaml'


def part_name(index):
    """Return the name of the folder of a part."""
    return f'part_{index:06d}'


def for_workers(settings):
    """Return settings whose files have their full names: a worker may have another folder."""
    files = {name: str(Path(flat(settings)[name]).resolve())
             for name in FILES if flat(settings)[name]}
    return updated(settings, files)


def prepare(folder, settings, calibrations):
    """Write what all workers of a run need into its folder, RangeNodeSettings and calibrations."""
    write_text(folder / SETTINGS, settings_text(flat(settings)))
    for index, calibration in enumerate(calibrations):
        calibration.to_yaml(*(folder / name for name in calibration_names(index)))


@dataclass(frozen=True)
class Run:
    """
    What all tasks of a run have in common; plain values, for any machine.

    Settings and calibrations lie as YAML in the folder, which every process sees.
    """

    recording: str
    folder: str
    """Where `prepare` has written, and the tasks write."""
    topics: tuple
    """Names of the four topics."""
    job: object
    """What is done with the results: its `measure(worker, task, tick)` returns an account."""
    token: str
    """Another one for each run: nothing is kept from one run to the next."""
    salvaged: bool = False
    """The recording is damaged: what can be read of it is taken."""
    version: str = __version__


def measure_task(run, task, tick=lambda: None):
    """
    Measure a task of a run.

    Parameters
    ----------
    run : Run
        The results of one method.
    task : Task
        A part of the recording.
    tick : callable
        Called after each pair.

    Returns
    -------
    account : dict
        See `account_of`; the job may add to it.

    Raises
    ------
    RecordingError
        If recording or result cannot be read or written, or this process runs another version of
        the package.

    """
    if run.version != __version__:
        raise RecordingError(f'a worker has version {__version__} of color_stereo_ros, the '
                             f'command has {run.version}: install the same everywhere')
    if run.token not in _workers:
        forget_runs()
        _workers[run.token] = Worker(run)
    return _workers[run.token].measure(task, tick)


def forget_runs():
    """Free what is kept from task to task."""
    while _workers:
        _workers.popitem()[1].close()


class Worker:
    """
    Measures tasks of one run; what is expensive is made once.

    Parameters
    ----------
    run : Run

    """

    def __init__(self, run):
        self._run = run
        self.folder = Path(run.folder)
        self.topics = StereoTopics(*run.topics)
        defaults = RangeNodeSettings()
        self.settings = updated(defaults, read_settings(self.folder / SETTINGS, defaults))
        """RangeNodeSettings of the run."""
        self._tasks = TaskStereo(self.topics, self.settings, self._calibration)
        self._recording = None

    def measure(self, task, tick):
        """Measure a task, see `measure_task`."""
        return self._run.job.measure(self, task, tick)

    def pairs(self, task):
        """
        Yield the pairs of a task, and the ColorStereo that is to measure them in turn.

        Yields
        ------
        stereo : ColorStereo
        pair : FoundPair

        """
        if self._recording is None:
            self._recording = Recording(self._run.recording, self._run.salvaged)
        stereo = self._tasks.before(self._recording, task)
        for pair in self._tasks.pairs(self._recording, task.rows):
            yield stereo, pair

    def close(self):
        """Close the recording."""
        if self._recording is not None:
            self._recording.__exit__()
            self._recording = None

    def _calibration(self, index):
        return StereoCalibration.from_yaml(
            *(self.folder / name for name in calibration_names(index)))


def account_of(task, sensor, said):
    """
    Return the account of a task, as YAML can hold it.

    Parameters
    ----------
    task : Task
        Whose pairs these were.
    sensor : PairSensor
        Has measured the pairs that count.
    said : list of str
        Warnings of the pairs, for the user.

    Returns
    -------
    account : dict
        index, pairs, measured, failed: int; first_failure: str or None; said: list of str.

    """
    return {'index': task.index, 'pairs': len(task.rows), 'measured': sensor.measured,
            'failed': sensor.failed, 'first_failure': sensor.first_failure, 'said': said}


@dataclass(frozen=True)
class Writing:
    """The job of `convert`: each task becomes a part of a recording."""

    outputs: tuple | None
    """Relative topics to write, see OutputWriter."""
    namespace: str
    compression: str
    """One of `mcap_writing.COMPRESSIONS`."""

    def measure(self, worker, task, tick):
        """Measure a task and write its part, whole or not at all; return its account."""
        said = []
        sensor = PairSensor(worker.topics, worker.settings, said.append)
        with folder_written_whole(worker.folder / part_name(task.index), replace=True) as part:
            with open_writer(part, self.compression) as writer:
                outputs = OutputWriter(writer, worker.settings, self.outputs, self.namespace)
                for stereo, pair in worker.pairs(task):
                    result = sensor.measure(stereo, pair)
                    if result is not None:
                        outputs.write(result, pair)
                    tick()
            account = account_of(task, sensor, said)
            write_text(part / ACCOUNT, yaml_text(account))
        return account


def read_account(part):
    """Return the account in the folder of a part."""
    return yaml.safe_load((Path(part) / ACCOUNT).read_text(encoding='utf-8'))
