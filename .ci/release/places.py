# SPDX-License-Identifier: Apache-2.0
"""Where the checks run: copies of the repository, environments of several Pythons, logs."""

from functools import cached_property
import os
from pathlib import Path
import shutil
import subprocess
import sys


class Failed(Exception):
    """A check has found something; the text says what."""


class LeftOut(Exception):
    """A check does not run by intention; the text says why. It is no failure."""


class NotHere(Exception):
    """A check cannot run on this machine; the text says what is missing."""


class Places:
    """Folders and environments that the checks share; each is made when it is first asked for."""

    def __init__(self, root, output):
        """Begin with empty folders."""
        self.root, self.output = root, output
        self.log = output / 'first.log'
        self._environments = {}
        output.mkdir(parents=True)

    def run(self, *command, cwd=None, environment=None, passes=True, timeout=3600):
        """
        Run a command; what it prints is kept in the log.

        Parameters
        ----------
        command : str or Path
            Program and arguments.
        cwd : Path, optional
            Default: an empty folder.
        environment : dict, optional
            Changes of the variables; None removes one.
        passes : bool
            Another exit status than 0 is a failure of the check.
        timeout : float
            s.

        Returns
        -------
        ran : subprocess.CompletedProcess
            With stdout and stderr as one text, without colors.

        Raises
        ------
        Failed
            With the last line that was printed.

        """
        variables = {**os.environ, 'NO_COLOR': '1', 'PYTHONDONTWRITEBYTECODE': '1',
                     'PIP_DISABLE_PIP_VERSION_CHECK': '1', **(environment or {})}
        variables = {name: value for name, value in variables.items() if value is not None}
        try:
            ran = subprocess.run([str(word) for word in command], cwd=cwd or self.empty(),
                                 env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                 stdin=subprocess.DEVNULL, text=True, timeout=timeout)
        except subprocess.TimeoutExpired as error:
            raise Failed(f'{Path(str(command[0])).name}: no end within {timeout} s') from error
        with self.log.open('a', encoding='utf-8') as log:
            log.write(f'$ {" ".join(map(str, command))}\n{ran.stdout}\nstatus {ran.returncode}\n')
        if passes and ran.returncode:
            said = [line for line in ran.stdout.splitlines() if line.strip()] or ['no output']
            raise Failed(f'{Path(str(command[0])).name}: {said[-1].strip()[:200]}')
        return ran

    def empty(self):
        """Return an empty folder."""
        folder = self.output / 'empty'
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return folder

    @cached_property
    def tree(self):
        """Return a copy of the files of the repository as they are now, committed or not."""
        names = subprocess.run(
            ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
            cwd=self.root, capture_output=True, text=True)
        if names.returncode:
            raise NotHere('this is no clone of the repository')
        for name in filter(None, names.stdout.split('\0')):
            target = self.output / 'tree' / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if (self.root / name).exists():
                shutil.copy2(self.root / name, target)
        return self.output / 'tree'

    @cached_property
    def clone(self):
        """Return a clone whose only commit is the tree, with a remote that takes a push."""
        clone, remote = self.output / 'clone', self.output / 'remote.git'
        shutil.copytree(self.tree, clone)
        self.run('git', 'init', '--quiet', '--bare', remote)
        for words in (['init', '--quiet', '--initial-branch=main'],
                      ['config', 'user.name', 'release check'],
                      ['config', 'user.email', 'release-check@localhost'], ['add', '--all'],
                      ['commit', '--quiet', '--message', 'The tree'],
                      ['remote', 'add', 'origin', remote],
                      ['push', '--quiet', '--set-upstream', 'origin', 'main']):
            self.run('git', *words, cwd=clone)
        return clone

    @property
    def wheel(self):
        """Return the wheel that the check build has made."""
        return self._built('*.whl')

    @property
    def sdist(self):
        """Return the source distribution that the check build has made."""
        return self._built('*.tar.gz')

    def _built(self, pattern):
        found = sorted((self.output / 'dist').glob(pattern))
        if len(found) != 1:
            raise Failed(f'there is no {pattern} in dist/')
        return found[0]

    def python(self, version):
        """Return an interpreter of a version, such as '3.12'."""
        found = subprocess.run([self.root / '.ci/python', version], capture_output=True, text=True)
        if found.returncode:
            raise NotHere(f'no Python {version} on this machine')
        return found.stdout.strip()

    def environment(self, name, *requirements, version=None):
        """
        Return the Python of a virtual environment that holds some requirements.

        Parameters
        ----------
        name : str
            Of the environment; asked for again, it gets what it has not got yet.
        requirements : str or Path
            For pip; `-r FILE` as two words.
        version : str, optional
            Of Python, default that of this process.

        """
        folder = self.output / 'environments' / name
        if folder not in self._environments:
            self.run(sys.executable if version is None else self.python(version), '-m', 'venv',
                     folder)
            self._environments[folder] = set()
        if requirements and requirements not in self._environments[folder]:
            self.run(folder / 'bin/python', '-m', 'pip', 'install', '--quiet', *requirements)
            self._environments[folder].add(requirements)
        return folder / 'bin/python'

    @property
    def tools(self):
        """Return the Python that has the tools of tools.txt."""
        return self.environment('tools', '-r', self.root / '.ci/release/tools.txt')
