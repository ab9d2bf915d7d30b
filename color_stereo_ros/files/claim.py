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
"""Folders that a command fills: nothing foreign in them is replaced, and one process has them."""

from contextlib import contextmanager, suppress
import os
from pathlib import Path

from .atomic import open_and_lock
from ..errors import RecordingError


@contextmanager
def claimed(folder, command, names, *, overwrite=False):
    """
    Hold a folder for one run of a command, which replaces the files of its own earlier runs.

    A folder is of an earlier run if it holds all files of the command. While the block runs, a
    hidden file `.color_stereo_COMMAND` is there, too: it is locked, and where a killed process
    left it, the folder is of an earlier run as well.

    Parameters
    ----------
    folder : Path
        Made if it is not there; removed again if the block fails and it is empty.
    command : str
        For example 'process'.
    names : iterable of str
        The files that the command writes.
    overwrite : bool
        Replace these files even if the folder is not of an earlier run.

    Raises
    ------
    RecordingError
        If one of the files is there and the folder is not of an earlier run, or another process
        holds the folder.

    """
    folder = Path(folder)
    mark = folder / f'.color_stereo_{command}'
    foreign = [folder / name for name in names if os.path.lexists(folder / name)]
    if foreign and len(foreign) < len(list(names)) and not (overwrite or mark.exists()):
        raise RecordingError(f'{foreign[0]}: exists already, and is not of an earlier '
                             f'`color_stereo {command}`; --overwrite replaces it')
    was_there = folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with held(mark, folder):
            yield
    except BaseException:
        if not was_there:
            with suppress(OSError):
                folder.rmdir()
        raise


@contextmanager
def held(mark, folder):
    """
    Hold the lock of a file that stands for a folder, and remove it at the end.

    Raises
    ------
    RecordingError
        If another process holds it.

    """
    lock = _lock_of(mark, folder)
    try:
        yield
    finally:
        mark.unlink(missing_ok=True)
        if lock is not None:
            os.close(lock)


def _lock_of(mark, folder):
    while True:
        try:
            lock = open_and_lock(mark, os.O_RDWR | os.O_CREAT)
        except BlockingIOError:
            raise RecordingError(f'{folder}: another process is writing into it; wait for its '
                                 'end, or name another folder') from None
        if lock is None or _is_still(mark, lock):
            return lock
        os.close(lock)  # its holder has removed it in this moment


def _is_still(path, descriptor):
    try:
        return os.path.samestat(os.stat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False
