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
"""What a process does that measures tasks of a recording: one at a time, each into a part."""

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
from ..core.settings import updated
from ..files.atomic import folder_written_whole, write_text
from ..files.yaml import yaml_text
from ..parameters.files import read_settings
from ..parameters.groups import RangeNodeSettings

ACCOUNT = 'account.yaml'
"""File of a part that tells how its task went."""
SETTINGS = 'settings.yaml'
_workers = {}


def calibration_names(index):
    """Return the names of both files of a calibration."""
    return f'left_{index}.yaml', f'right_{index}.yaml'


def part_name(index):
    """Return the name of the folder of a part."""
    return f'part_{index:06d}'


@dataclass(frozen=True)
class Run:
    """
    What all tasks of a conversion have in common; plain values, for any machine.

    Settings and calibrations lie as YAML in the folder, which every process sees.
    """

    recording: str
    folder: str
    """Where the parts are written."""
    topics: tuple
    """Names of the four topics."""
    outputs: tuple | None
    """Relative topics to write, see OutputWriter."""
    namespace: str
    token: str
    """Another one for each run: nothing is kept from one run to the next."""
    salvaged: bool = False
    """The recording is damaged: what can be read of it is taken."""
    version: str = __version__


def measure_task(run, task, tick=lambda: None):
    """
    Measure a task of a run and write its part, whole or not at all.

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
        index, measured, failed: int; first_failure: str or None; said: list of str.

    Raises
    ------
    RecordingError
        If recording or part cannot be read or written, or this process runs another version of
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
    _workers.clear()


class Worker:
    """
    Measures tasks of one run; what is expensive is made once.

    Parameters
    ----------
    run : Run

    """

    def __init__(self, run):
        self._run, self._folder = run, Path(run.folder)
        self._topics = StereoTopics(*run.topics)
        defaults = RangeNodeSettings()
        self._settings = updated(defaults, read_settings(self._folder / SETTINGS, defaults))
        self._tasks = TaskStereo(self._topics, self._settings, self._calibration)

    def measure(self, task, tick):
        """Measure a task, see `measure_task`."""
        said, now = [], [0]
        sensor = PairSensor(self._topics, self._settings, said.append, lambda: now[0] * 1e-9)
        with Recording(self._run.recording, self._run.salvaged) as recording, \
                folder_written_whole(self._folder / part_name(task.index), replace=True) as part:
            stereo = self._tasks.before(recording, task)
            with open_writer(part) as writer:
                outputs = OutputWriter(writer, self._settings, self._run.outputs,
                                       self._run.namespace)
                for pair in self._tasks.pairs(recording, task.rows):
                    now[0] = pair.recorded
                    result = sensor.measure(stereo, pair)
                    if result is not None:
                        outputs.write(result, pair)
                    tick()
            account = {'index': task.index, 'measured': sensor.measured, 'failed': sensor.failed,
                       'first_failure': sensor.first_failure, 'said': said}
            write_text(part / ACCOUNT, yaml_text(account))
        return account

    def _calibration(self, index):
        return StereoCalibration.from_yaml(
            *(self._folder / name for name in calibration_names(index)))


def read_account(part):
    """Return the account in the folder of a part."""
    return yaml.safe_load((Path(part) / ACCOUNT).read_text(encoding='utf-8'))
