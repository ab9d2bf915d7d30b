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
"""Where a process may not do what it usually does: keep compiled code, run after a fork."""

import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys

import pytest

FOLDER = Path(__file__).parent
PACKAGE = FOLDER.parent / 'color_stereo_ros'
MEASURE = """
from color_stereo_ros.core import ColorStereo
from scenes import hue_pair, paper_settings, parallel_rig
SETTINGS = paper_settings(range__min_depth=0.5, range__max_depth=4.0)
def measure(_=None):
    return ColorStereo(parallel_rig(), SETTINGS).process(*hue_pair(5.0)).density
"""
PAIR = MEASURE + 'print(measure())'
KERNELS = """
import numpy as np
from color_stereo_ros.core.color_kernels import correct_colors
from color_stereo_ros.core.normal_kernels import read_planes
image, zero, ones = np.full((8, 8, 3), 9, np.uint8), np.float32(0), np.ones((3, 256), np.float32)
correct_colors(image, ones, np.ones((8, 8, 3), np.float32), np.eye(3, dtype=np.float32), 255, zero,
               np.float32(255), np.uint8(255), image)
planes = np.zeros((3, 6, 6), np.float32)
read_planes(np.ones((8, 8), np.float32), 1, *planes)
print(min(image.min(), planes[0, 1:5, 1:5].min()))
"""
"""A parallel kernel and one with a part; like PAIR it prints more than 0.5."""
FORK = MEASURE + """
import multiprocessing
fork = multiprocessing.get_context('fork')
def tried(_):
    try:
        return measure()
    except ValueError as error:
        return f'{type(error).__name__}: {error}'
with fork.Pool(1) as pool:
    print(pool.map(tried, [0])[0])
stereo = ColorStereo(parallel_rig(), SETTINGS)
uses = measure, lambda _: stereo.process(*hue_pair(5)), lambda _: stereo.rectify(*hue_pair(5))
for use in uses:
    def inherited(_, use=use):
        try:
            return use(0)
        except ValueError as error:
            return f'{type(error).__name__}: {error}'
    receiving, sending = fork.Pipe(False)
    child = fork.Process(target=lambda: sending.send(str(inherited(0))))
    child.start()
    print(receiving.recv() if receiving.poll(60) else 'no answer')
    child.kill()
print(measure())
"""
SPAWN = MEASURE + """
import multiprocessing
if __name__ == '__main__':
    print(measure())
    with multiprocessing.get_context('spawn').Pool(1) as pool:
        print(pool.map(measure, [0])[0])
"""


NODE = """
from color_stereo_ros.nodes.range_node import main
raise SystemExit(main(['--ros-args', '-p', 'matching.method:=paper']))
"""


def run(arguments, package=PACKAGE.parent, **changes):
    """Return a finished process that finds a package and the tests; None removes a variable."""
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join([str(package), str(FOLDER)]),
                   **changes}
    return subprocess.run(
        [sys.executable, *map(str, arguments)], cwd=FOLDER, capture_output=True, text=True,
        timeout=300,
        env={name: value for name, value in environment.items() if value is not None})


@pytest.fixture
def nowhere(tmp_path):
    """Return a copy of the package and an environment in which nothing can be cached."""
    shutil.copytree(PACKAGE, tmp_path / PACKAGE.name,
                    ignore=shutil.ignore_patterns('__pycache__'))
    for folder in [path for path in (tmp_path / PACKAGE.name).rglob('*') if path.is_dir()]:
        (folder / '__pycache__').touch()  # a file where the folder would be: also for root
    (tmp_path / PACKAGE.name / '__pycache__').touch()
    return tmp_path, {'HOME': '/dev/null', 'XDG_CACHE_HOME': '/dev/null/cache',
                      'NUMBA_CACHE_DIR': None, 'PYTHONDONTWRITEBYTECODE': '1'}


@pytest.fixture
def use(effort):
    """Return code that uses kernels: two, or at full length all that a pair needs."""
    return PAIR if effort.full else KERNELS


def test_without_a_folder_for_compiled_kernels_one_line_says_so(nowhere, use):
    package, environment = nowhere
    ran = run(['-c', use], package, **environment)
    assert ran.returncode == 0, ran.stderr
    assert float(ran.stdout) > 0.5
    assert ran.stderr.count('\n') == 1 and 'NUMBA_CACHE_DIR' in ran.stderr


def test_a_node_without_a_folder_for_compiled_kernels_says_so_and_goes_on(nowhere, tmp_path):
    package, environment = nowhere
    environment = {**os.environ, **environment, 'PYTHONPATH': str(package),
                   'ROS_LOG_DIR': str(tmp_path / 'log'),
                   'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    del environment['NUMBA_CACHE_DIR']
    said = []
    with subprocess.Popen([sys.executable, '-c', NODE], cwd=FOLDER, text=True, env=environment,
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as node:
        for line in node.stderr:
            said.append(line)
            if 'ready after' in line:
                node.send_signal(signal.SIGINT)
    assert node.returncode == 0, ''.join(said)
    assert 'Traceback' not in ''.join(said) and 'ready after' in ''.join(said)
    assert ''.join(said).count('NUMBA_CACHE_DIR') == 1


def test_a_folder_that_numba_cache_dir_names_is_used(nowhere, tmp_path):
    package, environment = nowhere
    cache = tmp_path / 'kernels'
    ran = run(['-c', KERNELS], package, **{**environment, 'NUMBA_CACHE_DIR': str(cache)})
    assert ran.returncode == 0 and not ran.stderr
    for name in ('correct_colors', 'read_planes'):
        assert list(cache.rglob(f'*{name}*.nbc')), name


def test_a_full_disk_costs_the_cache_only(tmp_path, use):
    """A limit of the size of files: folders can be made, but nothing can be written."""
    limit = 'import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n'
    ran = run(['-W', 'ignore', '-c', limit + use],
              NUMBA_CACHE_DIR=str(tmp_path / 'kernels'), PYTHONDONTWRITEBYTECODE='1')
    assert ran.returncode == 0, ran.stderr
    assert float(ran.stdout) > 0.5
    assert ran.stderr.count('NUMBA_CACHE_DIR') == 1 and 'Traceback' not in ran.stderr


def test_a_fork_before_use_computes_and_a_fork_after_use_is_refused():
    ran = run(['-c', FORK])
    assert ran.returncode == 0, ran.stderr
    before, *after, own = ran.stdout.splitlines()
    assert before == own and float(own) > 0.5
    assert len(after) == 3
    for text in after:
        assert text.startswith('ForkError: process ') and "get_context('spawn')" in text


def test_a_spawned_process_computes_after_use(tmp_path):
    (tmp_path / 'script.py').write_text(SPAWN)
    ran = run([tmp_path / 'script.py'])
    assert ran.returncode == 0, ran.stderr
    first, second = ran.stdout.splitlines()
    assert first == second and float(first) > 0.5
