# SPDX-License-Identifier: Apache-2.0
"""Folders that a command fills: nothing foreign in them is replaced, and one process has them."""

from contextlib import contextmanager, suppress
import os
from pathlib import Path

from ..errors import RecordingError
from .atomic import open_and_lock


@contextmanager
def claimed(folder, command, names, *, overwrite=False):
    """
    Hold a folder for one run of a command, which replaces the files of its own earlier runs.

    A hidden file `.color_stereo_COMMAND` in the folder says whose it is. If the block fails before
    anything is written, folder and mark are as before.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    command : str
        For example 'process'.
    names : iterable of str
        The files that the command writes.
    overwrite : bool
        Replace these files even if the folder is not marked.

    Raises
    ------
    RecordingError
        If one of the files is there and the folder is not marked, or another process holds the
        folder.

    """
    folder = Path(folder)
    mark = folder / f'.color_stereo_{command}'
    if not overwrite and not mark.exists():
        for name in names:
            if os.path.lexists(folder / name):
                raise RecordingError(f'{folder / name}: exists already, and is not of an earlier '
                                     f'`color_stereo {command}`; --overwrite replaces it')
    was_there, was_marked = folder.exists(), mark.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with held(mark, folder):
            mark.write_text(f'`color_stereo {command}` made this folder and replaces its own '
                            'files in it.\n', encoding='utf-8')
            yield
    except BaseException:
        if not was_marked and not any((folder / name).exists() for name in names):
            with suppress(OSError):
                mark.unlink(missing_ok=True)
                if not was_there:
                    folder.rmdir()
        raise


@contextmanager
def held(mark, folder):
    """
    Hold the lock of a file that stands for a folder.

    Raises
    ------
    RecordingError
        If another process holds it.

    """
    try:
        lock = open_and_lock(mark, os.O_RDWR | os.O_CREAT)
    except BlockingIOError:
        raise RecordingError(f'{folder}: another process is writing into it; wait for its end, or '
                             'name another folder') from None
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)
