# SPDX-License-Identifier: Apache-2.0
"""The processes that measure, seen from the one that asks."""

import json
import os
from pathlib import Path
import subprocess
import sys

from .trees import GateError

FOREIGN = 'PYTHON', 'NUMBA_', 'OMP_', 'GOMP_', 'MALLOC_'
"""Beginnings of the environment variables that a worker does not inherit."""


class Child:
    """
    A process that runs `gate.worker` with the package of one tree.

    Parameters
    ----------
    tree : Tree
    threads : int
        Of numba and OpenCV.
    cache : pathlib.Path, optional
        Folder of numba's cache, by default that of the tree.
    fill : int, optional
        Complement of the byte that memory holds before it is written, 1..255; by default it
        holds anything.

    """

    def __init__(self, tree, threads, cache=None, fill=0):
        """Start the process."""
        self.tree = tree
        self._process = subprocess.Popen(
            [sys.executable, '-P', '-m', 'gate.worker', str(tree.folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=tree.folder,
            env={**environment(tree, threads, cache or tree.cache), 'MALLOC_PERTURB_': str(fill)})

    def __enter__(self):
        """Return the child."""
        return self

    def __exit__(self, kind, *_):
        """End the process: at once after an error, else when it has done what was asked."""
        if kind:
            self._process.kill()
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def ask(self, do, **values):
        """Return the answer to a request."""
        self.start(do, **values)
        return self.answer()

    def start(self, do, **values):
        """Send a request and do not wait for the answer."""
        try:
            self._process.stdin.write(json.dumps({'do': do, **values}) + '\n')
            self._process.stdin.flush()
        except BrokenPipeError:
            self._complain()

    def answer(self):
        """Wait for the answer to the request that was started."""
        line = self._process.stdout.readline()
        if not line:
            self._complain()
        answer = json.loads(line)
        if 'failure' in answer:
            raise GateError(f'The tree {self.tree.name} failed:\n{answer["failure"]}')
        return answer

    def _complain(self):
        raise GateError(f'The process of the tree {self.tree.name} ended with status '
                        f'{self._process.wait()}')


def environment(tree, threads, cache):
    """
    Return the environment of a worker, the same for both trees but for the paths.

    Idle OpenMP threads spin for a short time only, whatever the tree would choose: a process that
    waits for its turn must not take time from the one that is measured.

    """
    inherited = {name: value for name, value in os.environ.items()
                 if not name.startswith(FOREIGN)}
    path = os.pathsep.join([str(tree.folder), str(Path(__file__).resolve().parents[1])])
    return {**inherited, 'PYTHONPATH': path, 'PYTHONHASHSEED': '0', 'GOMP_SPINCOUNT': '2000',
            'NUMBA_CACHE_DIR': str(cache), 'NUMBA_NUM_THREADS': str(threads)}
