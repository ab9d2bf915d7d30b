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
"""
The parts of a conversion: kept until all are there, then joined to one recording.

The parts lie in a hidden folder beside the result, with a file that says of which run they are.
A run that was stopped leaves them; `--resume` goes on with them.

"""

from contextlib import contextmanager
import os
from pathlib import Path
import shutil

import yaml

from .working import ACCOUNT, part_name, prepare, read_account
from ..errors import RecordingError
from ..files.atomic import folder_written_whole, naming, write_text
from ..files.claim import held
from ..files.yaml import yaml_text

RUN = 'run.yaml'
METADATA = 'metadata.yaml'


class Parts:
    """
    The folder in which the parts of one result are written.

    Parameters
    ----------
    result : Path
        The recording to make.

    """

    def __init__(self, result):
        self._result = Path(result)
        self.folder = self._result.with_name(f'.{self._result.name}.color_stereo_parts')

    @contextmanager
    def opened(self, identity, settings, calibrations, *, resume):
        """
        Hold the folder; it is removed unless the block is left by an error after a part was done.

        Parameters
        ----------
        identity : dict
            What the parts depend on, as YAML can hold it.
        settings : RangeNodeSettings
            For the workers.
        calibrations : sequence of StereoCalibration
            For the workers.
        resume : bool
            Go on with the parts of an earlier run.

        Raises
        ------
        RecordingError
            If another process holds the folder, there are parts and `resume` is not given, or
            they are of another run.

        """
        mark = self.folder.with_name(f'{self.folder.name}.lock')
        with naming(self._result, self.folder.name):
            self.folder.parent.mkdir(parents=True, exist_ok=True)
        with held(mark, self._result), naming(self._result, self.folder.name):
            self._prepare(identity, resume)
            prepare(self.folder, settings, calibrations)
            try:
                yield
            except BaseException:
                if self.done():
                    raise
                self.remove()
                raise
            self.remove()

    def _prepare(self, identity, resume):
        if not self.done():
            self.remove()
        elif not resume:
            self.check_none()
        else:
            self._check(identity)
        self.folder.mkdir(exist_ok=True)
        write_text(self.folder / RUN, yaml_text(identity))

    def check_none(self):
        """Raise RecordingError if there are parts of an earlier run."""
        if count := len(self.done()):
            raise RecordingError(f'{self._result}: {count} parts of an earlier run lie in '
                                 f'{self.folder}: --resume goes on with them, --restart removes '
                                 'them')

    def _check(self, identity):
        """Refuse parts of another run."""
        kept = yaml.safe_load((self.folder / RUN).read_text(encoding='utf-8'))
        name = next((name for name in identity if kept.get(name) != identity[name]), None)
        if name is None:
            return
        before, now = kept.get(name), identity[name]
        if isinstance(before, dict) and isinstance(now, dict):
            name = next(each for each in {**before, **now} if before.get(each) != now.get(each))
            before, now = before.get(name), now.get(name)
        raise RecordingError(f'{self.folder}: holds parts of another run: {name} was {before!r}, '
                             f'now it is {now!r}; --restart removes them')

    def done(self):
        """Return the indices of the parts that are whole, in order."""
        return sorted(int(path.parent.name.rpartition('_')[2])
                      for path in self.folder.glob(f'part_*/{ACCOUNT}'))

    def account(self, index):
        """Return the account of a part."""
        return read_account(self.folder / part_name(index))

    def join(self, count, *, overwrite):
        """
        Make the recording of parts 0 .. count - 1; it appears when it is whole.

        Parameters
        ----------
        count : int
            Number of the parts.
        overwrite : bool
            Replace a recording that is there.

        """
        with folder_written_whole(self._result, replace=overwrite) as unfinished:
            unfinished.mkdir()
            found = [self._moved(index, unfinished) for index in range(count)]
            found = [information for information in found if information['message_count']]
            write_text(unfinished / METADATA, yaml.safe_dump(
                {'rosbag2_bagfile_information': joined(found)}, sort_keys=False))

    def _moved(self, index, folder):
        """Give the file of a part its place in a folder; return its information."""
        part = self.folder / part_name(index)
        metadata = yaml.safe_load((part / METADATA).read_text(encoding='utf-8'))
        information = metadata['rosbag2_bagfile_information']
        if information['message_count']:
            name = f'{self._result.name}_{index}.mcap'
            _link(part / information['relative_file_paths'][0], folder / name)
            information['relative_file_paths'] = [name]
            information['files'][0]['path'] = name
        return information

    def remove(self):
        """Remove the folder with everything in it."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _link(source, target):
    """Let a file have a second name: the part stays whole until the result is."""
    try:
        os.link(source, target)
    except OSError:  # a file system without links
        shutil.copyfile(source, target)


def joined(parts):
    """
    Return the information of a recording of several files.

    Parameters
    ----------
    parts : list of dict
        `rosbag2_bagfile_information` of recordings of one file each, in their order.

    Returns
    -------
    information : dict

    """
    start = min(_start(part) for part in parts)
    end = max(_start(part) + part['duration']['nanoseconds'] for part in parts)
    topics = {}
    for entry in (entry for part in parts for entry in part['topics_with_message_count']):
        known = topics.setdefault(entry['topic_metadata']['name'], {**entry, 'message_count': 0})
        known['message_count'] += entry['message_count']
    return parts[0] | {
        'relative_file_paths': [part['relative_file_paths'][0] for part in parts],
        'duration': {'nanoseconds': end - start},
        'starting_time': {'nanoseconds_since_epoch': start},
        'message_count': sum(part['message_count'] for part in parts),
        'topics_with_message_count': list(topics.values()),
        'files': [part['files'][0] for part in parts]}


def _start(part):
    return part['starting_time']['nanoseconds_since_epoch']
