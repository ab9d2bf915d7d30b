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
"""Compiled code is never stale: the stamp covers every file that a kernel contains parts of."""

import ast
import functools
import importlib
import os
from pathlib import Path
import shutil
import subprocess
import sys

from color_stereo_ros.core.compiled.decorators import Kernel
from color_stereo_ros.core.compiled.stamp import PACKAGE, SOURCES, stamp, stamped_files
import pytest

pytestmark = pytest.mark.processes  # the simulator has kernels, too

PASSING_ON = {'errors.py', 'files/yaml.py', 'files/atomic.py'}
"""Files that raise errors or read files: none of their values is compiled in."""


def modules():
    """Return the modules that define kernels or parts."""
    found = [path for path in sorted(PACKAGE.rglob('*.py'))
             if 'compiled import' in path.read_text() or path.parent.name == 'compiled']
    return [importlib.import_module('.'.join(
        ('color_stereo_ros', *path.relative_to(PACKAGE).with_suffix('').parts)).removesuffix(
            '.__init__')) for path in found]


@functools.cache
def kernels():
    """Return all kernels of the package by their full name."""
    return {f'{value.__module__}.{value.__name__}': value
            for module in modules() for value in vars(module).values()
            if isinstance(value, Kernel)}


@functools.cache
def bindings(path):
    """Return the statements outside of functions that bind each name of a module."""
    found = {}

    def bind(name, node):
        found.setdefault(name, []).append(node)

    def look(statements):
        for node in statements:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                for alias in node.names:
                    bind((alias.asname or alias.name).split('.')[0], (node, alias.name))
            elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                bind(node.name, node)
            else:
                for each in ast.walk(node):
                    if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store):
                        bind(each.id, node)
                    if isinstance(each, (ast.Import, ast.ImportFrom)):
                        look([each])

    look(ast.parse(path.read_text()).body)
    return found


def imported(path, node, name, seen):
    """Follow what a module imports from this package."""
    if isinstance(node, ast.Import) or node.level == 0:
        return
    folder = path.parents[node.level - 1]
    place = folder.joinpath(*(node.module or '').split('.')) if node.module else folder
    for file in (place.with_suffix('.py'), place / '__init__.py'):
        if node.module and file.is_file() and name in bindings(file):
            return follow(file, name, seen)
    whole = place / f'{name}.py'
    whole = whole if whole.is_file() else place / name / '__init__.py'
    for each in bindings(whole):
        follow(whole, each, seen)


def follow(path, name, seen):
    """Collect the (file, name) of everything on which the value of a name depends."""
    if (path, name) in seen or path.relative_to(PACKAGE).as_posix() in PASSING_ON:
        return
    seen.add((path, name))
    for node in bindings(path).get(name, ()):
        if isinstance(node, tuple):
            imported(path, *node, seen)
            continue
        for each in ast.walk(node):
            if isinstance(each, ast.Name):
                follow(path, each.id, seen)


def needed_files(kernel):
    """Return the files on which a kernel depends, from the source text alone."""
    path = Path(kernel.__wrapped__.__code__.co_filename)
    seen = set()
    follow(path, kernel.__name__, seen)
    return {file for file, _ in seen}


def test_each_source_is_there():
    for pattern in SOURCES:
        assert list(PACKAGE.glob(pattern)), pattern


def test_there_are_kernels_in_all_rooms():
    rooms = {name.split('.')[1] for name in kernels()}
    assert {'core', 'messages', 'sim'} <= rooms and len(kernels()) > 25


def test_the_stamp_covers_every_file_of_which_a_kernel_contains_something():
    for name, kernel in kernels().items():
        needed = needed_files(kernel)
        assert Path(kernel.__wrapped__.__code__.co_filename) in needed
        assert needed <= set(stamped_files(kernel.__wrapped__)), name


def test_the_files_behind_a_kernel_are_found_through_functions_and_constants():
    names = {path.relative_to(PACKAGE).as_posix() for path in needed_files(
        kernels()['color_stereo_ros.core.surface.pixel_kernels.expand'])}
    assert {'core/status.py', 'core/surface/trust_kernels.py', 'core/surface/grid_kernels.py',
            'core/compiled/decorators.py'} <= names


def test_all_kernels_in_the_cache_carry_the_stamp():
    for name, kernel in kernels().items():
        assert kernel.py_func.__qualname__.endswith(stamp(kernel.__wrapped__)), name


REASONS = """
import numpy as np
from color_stereo_ros.core.paper.kernels import correct_colors
reason = np.empty((2, 2), np.uint8)
zero, one = np.zeros(3, np.float32), np.ones(3, np.float32)
correct_colors(np.zeros((2, 2, 3), np.uint8), np.ones((2, 2), bool), zero, one, np.float32(5),
               250, False, np.float32(0), np.empty((2, 2, 4), np.float32), reason)
print(reason[0, 0], sum(correct_colors.stats.cache_hits.values()))
"""

FRAME = """
import numpy as np
from color_stereo_ros.core.surface.view_kernels import add_color_sums
shape = 40, 40
flat = [np.ones(shape, np.float32) for _ in range(6)]
normal, target = np.zeros((3, 3)), np.zeros((3, 2))
misfit = np.ones(shape, np.float32)
misfit[9, 9] = 0
add_color_sums(*flat[:5], misfit, np.float32(0.5), 4, 4, 1, 1, normal, target)
print(int(normal[2, 2]), sum(add_color_sums.stats.cache_hits.values()))
"""


@pytest.mark.parametrize('code, file, change, expected', [
    (REASONS, 'core/status.py', lambda text: text.replace('DARK = 2', 'DARK = 42'),
     [(2, 0), (2, 1), (42, 0)]),
    (FRAME, 'core/surface/grid_kernels.py', lambda text: text + '\nPAD = 12\n',
     [(1, 0), (1, 1), (0, 0)])])
def test_a_changed_constant_of_another_file_compiles_kernels_anew(tmp_path, code, file, change,
                                                                  expected):
    place = tmp_path / 'color_stereo_ros'
    shutil.copytree(PACKAGE, place, ignore=shutil.ignore_patterns('__pycache__'))

    def found():
        output = subprocess.run(
            [sys.executable, '-B', '-c', code], check=True, capture_output=True, text=True,
            cwd=tmp_path, env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'cache'),
                               'PYTHONPATH': str(tmp_path)}).stdout
        return tuple(map(int, output.split()))

    assert [found(), found()] == expected[:2]
    changed = place / file
    text = change(changed.read_text())
    assert text != changed.read_text()
    changed.write_text(text)
    assert found() == expected[2]
