# SPDX-License-Identifier: Apache-2.0
"""Copies of the two source trees that are compared."""

from dataclasses import dataclass
import os
from pathlib import Path
import shutil
import subprocess


class GateError(Exception):
    """The comparison cannot be made; the text says why."""


@dataclass(frozen=True)
class Tree:
    """One of the two source trees, in a folder of its own."""

    name: str
    """For people: the abbreviated commit or 'this'."""
    folder: Path
    """Root of the copy; holds color_stereo_ros/."""
    cache: Path
    """Folder of numba's cache, used by no other tree."""


def two_trees(root, revision, folder):
    """
    Copy a revision and the working tree.

    Parameters
    ----------
    root : pathlib.Path
        The working tree.
    revision : str
        Anything that git takes for a commit.
    folder : pathlib.Path
        Where the copies and the empty caches are made.

    Returns
    -------
    before, after : Tree
        The revision and the working tree.

    Raises
    ------
    GateError
        If git does not know the revision.

    """
    commit = commit_of(root, revision)
    before = Tree(commit[:10], folder / 'revision', folder / 'revision_cache')
    after = Tree('this', folder / 'this', folder / 'this_cache')
    check_out(root, commit, before.folder)
    copy_working_tree(root, after.folder)
    for tree in (before, after):
        tree.cache.mkdir()
    return before, after


def commit_of(root, revision):
    """Return the full hash of a revision, or raise GateError."""
    return _git(root, 'rev-parse', '--verify', '--quiet', f'{revision}^{{commit}}',
                otherwise=f'git knows no revision {revision!r}').decode().strip()


def check_out(root, commit, folder):
    """Write all files of a commit into a new folder."""
    archive = _git(root, 'archive', '--format=tar', commit,
                   otherwise=f'git cannot write the files of {commit}')
    folder.mkdir()
    subprocess.run(['tar', '-x', '-C', str(folder)], input=archive, check=True)


def copy_working_tree(root, folder):
    """Copy all files that git tracks or would track, as they are now, into a new folder."""
    names = _git(root, 'ls-files', '-z', '--cached', '--others', '--exclude-standard',
                 otherwise=f'{root} is no working tree of git').decode().split('\0')
    folder.mkdir()
    for name in filter(None, names):
        if os.path.lexists(root / name):  # tracked files may have been deleted
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, target, follow_symlinks=False)


def _git(root, *arguments, otherwise):
    """Return what git writes, bytes, or raise GateError with a text and git's own."""
    ran = subprocess.run(['git', '-C', str(root), *arguments], capture_output=True)
    if ran.returncode:
        raise GateError(f'{otherwise} {ran.stderr.decode(errors="replace").strip()}'.strip())
    return ran.stdout
