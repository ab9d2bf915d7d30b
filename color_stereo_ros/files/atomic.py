# SPDX-License-Identifier: Apache-2.0
"""The one way to write results: beside the name first, then renamed, so none is half written."""

from contextlib import contextmanager
import os
from pathlib import Path
import tempfile


@contextmanager
def written_whole(path, *, make_folders=True, durable=False):
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

    Yields
    ------
    partial : Path
        Has the suffix of `path`: some writers choose a format by it.

    """
    path = Path(path)
    with _room_beside(path, make_folders) as partial:
        yield partial
        if durable:
            _flush(partial)
        os.replace(partial, path)


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

    """
    path = Path(path)
    with _room_beside(path, make_folders=True) as unfinished:
        yield unfinished
        replaced = unfinished.with_name(f'{path.name}.replaced')
        if replace and path.exists():
            path.rename(replaced)
        try:
            os.replace(unfinished, path)
        except OSError:
            if replaced.exists():
                replaced.rename(path)
            raise


@contextmanager
def _room_beside(path, make_folders):
    """Yield the path of the same name in a temporary folder, on the same file system."""
    if make_folders:
        path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f'.{path.name}.', dir=path.parent) as temporary:
        yield Path(temporary) / path.name


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
