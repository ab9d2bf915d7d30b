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
The one way to write results: beside the name first, then renamed, so none is half written.

Whatever is unfinished lies in a hidden folder beside the result, its *room*. The room is locked
while its process lives. What a killed process left is removed when the next one writes into the
same folder.

"""

from contextlib import contextmanager, suppress
import errno
import fcntl
import os
from pathlib import Path
import shutil
import tempfile
import time

from ..errors import RecordingError

ROOM = '.color_stereo_unfinished_'
"""Names of rooms begin so; what follows is arbitrary."""
NAME = 'name.txt'
"""File in a room that holds the name of the result."""
PATIENCE = 2.0
"""s; another process holds the lock of a folder for milliseconds only."""
_swept = set()


@contextmanager
def written_whole(path, *, make_folders=True, durable=False, replace=True):
    """
    Yield a temporary path beside a file; the file gets its name when the block ends well.

    Parameters
    ----------
    path : str or Path
        A file of that name is replaced. After an error the old file is there as before.
    make_folders : bool
        Make the folder of the file if it is not there; without, that is an OSError.
    durable : bool
        Wait until the disk holds the content, so that a loss of power leaves the old file or
        the new one.
    replace : bool
        Without, a file that is there is a RecordingError, also one that another process has
        written in the meantime.

    Yields
    ------
    partial : Path
        Has the suffix of `path`: some writers choose a format by it.

    """
    path = Path(path)
    if not replace:
        check_free(path)
    with _room_beside(path, make_folders) as room:
        partial = room / 'new' / path.name
        yield partial
        if durable:
            _flush(partial)
        if replace:
            os.replace(partial, path)
        else:
            _place_new(partial, path)


@contextmanager
def folder_written_whole(path, *, replace=False):
    """
    Yield a temporary path beside a folder; the folder gets its name when the block ends well.

    Parameters
    ----------
    path : str or Path
        The folder above it is made if it is not there.
    replace : bool
        Replace a folder of that name as a whole. Without, only an empty one is replaced; another
        one is an OSError.

    Yields
    ------
    unfinished : Path
        Has the name of the folder. The block makes it.

    Raises
    ------
    RecordingError
        If another process is writing a folder of that name.

    """
    path = Path(path)
    with _room_beside(path, make_folders=True, alone=True) as room:
        unfinished = room / 'new' / path.name
        yield unfinished
        replaced = room / 'old' / path.name
        if replace and path.exists():
            path.rename(replaced)
        try:
            os.replace(unfinished, path)
        except OSError:
            if replaced.exists():
                replaced.rename(path)
            raise


def check_free(path):
    """Raise RecordingError if there is something at a path."""
    if os.path.lexists(path):
        raise RecordingError(f'{path}: exists already; --overwrite replaces it')


def _place_new(partial, path):
    """Give a file its name unless there is one of that name, without a moment in between."""
    try:
        os.link(partial, path)
    except FileExistsError:
        check_free(path)
        raise
    except OSError:  # a file system without links
        check_free(path)
        os.replace(partial, path)


@contextmanager
def _room_beside(path, make_folders, alone=False):
    """Yield a hidden folder on the same file system; an OSError in the block names the path."""
    try:
        if make_folders:
            path.parent.mkdir(parents=True, exist_ok=True)
        with _locked_room(path, alone) as room:
            yield room
    except OSError as error:
        raise _naming(path, error) from error


@contextmanager
def _locked_room(path, alone):
    with locked(path.parent, PATIENCE):  # nobody looks for rooms while one is made
        _sweep(path, alone)
        room = Path(tempfile.mkdtemp(prefix=ROOM, dir=path.parent))
        lock = open_and_lock(room)
    try:
        (room / NAME).write_text(path.name, encoding='utf-8')
        (room / 'new').mkdir()
        (room / 'old').mkdir()
        yield room
    finally:
        shutil.rmtree(room, ignore_errors=True)
        _close(lock)


def _sweep(path, alone):
    """
    Remove the rooms of processes that have ended, and put back what these had moved.

    Raises
    ------
    RecordingError
        If nobody else may write a folder of that name, and somebody does.

    """
    folder = path.parent.resolve()
    if folder in _swept and not alone:
        return
    _swept.add(folder)
    for room in folder.glob(f'{ROOM}*'):
        try:
            lock = open_and_lock(room)
        except BlockingIOError:
            if alone and _name_in(room) == path.name:
                raise RecordingError(f'{path}: another process is writing it; wait for its end, '
                                     'or name another result') from None
            continue
        if lock is not None:
            _put_back(room / 'old', folder)
            shutil.rmtree(room, ignore_errors=True)
            _close(lock)


def _name_in(room):
    """Return the name of the result that is written in a room, or None."""
    try:
        return (room / NAME).read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError):
        return None


def _put_back(kept, folder):
    """Give what was moved away its name again, unless the new one has it already."""
    with suppress(OSError):
        for old in kept.iterdir():
            if not os.path.lexists(folder / old.name):
                old.rename(folder / old.name)


@contextmanager
def locked(path, seconds):
    """Hold the lock of a folder; after so many seconds, or where there are no locks, go on."""
    end = time.monotonic() + seconds
    while True:
        try:
            lock = open_and_lock(path)
            break
        except BlockingIOError:
            if time.monotonic() > end:
                lock = None
                break
            time.sleep(0.01)
    try:
        yield
    finally:
        _close(lock)


def open_and_lock(path, flags=os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW):
    """
    Lock a folder or a file.

    Parameters
    ----------
    path : Path
        Of the file.
    flags : int
        Of os.open.

    Returns
    -------
    lock : int or None
        A descriptor that holds the lock until it is closed, or its process ends. None if the
        file system has no locks, or the path cannot be opened.

    Raises
    ------
    BlockingIOError
        If another process holds the lock.

    """
    try:
        descriptor = os.open(path, flags, 0o666)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def _close(lock):
    if lock is not None:
        os.close(lock)


def _naming(path, error):
    """Return an error that names the result, where it names nothing or a file of the room."""
    if error.filename is None or ROOM in str(error.filename):
        code = error.errno or errno.EIO
        return OSError(code, error.strerror or str(error) or os.strerror(code), str(path))
    return error


def _flush(path):
    """Wait until the disk holds a file."""
    with open(path, 'rb') as file:
        os.fsync(file.fileno())


def write_text(path, text, **options):
    """Write a text file; the options are those of `written_whole`."""
    with written_whole(path, **options) as partial:
        partial.write_text(text, encoding='utf-8')


def write_bytes(path, data, **options):
    """Write a binary file; the options are those of `written_whole`."""
    with written_whole(path, **options) as partial:
        partial.write_bytes(data)
