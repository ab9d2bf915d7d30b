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
"""The types that the public classes promise, as mypy sees them in a user's script."""

import inspect
import os
from pathlib import Path
import re
import subprocess
import sys
import typing

from color_stereo_ros import core

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = Path(__file__).parent / 'data/typed'


@pytest.fixture(scope='module')
def complaints(tmp_path_factory):
    """Return what mypy says of both scripts: {(name, line), ...}."""
    ran = subprocess.run(
        [sys.executable, '-m', 'mypy', '--strict', '--follow-imports=silent', '--cache-dir',
         str(tmp_path_factory.mktemp('mypy')), *sorted(map(str, SCRIPTS.glob('*.py')))],
        env={**os.environ, 'MYPYPATH': str(ROOT)}, cwd=SCRIPTS, capture_output=True, text=True,
        timeout=300)
    assert ran.returncode in (0, 1), ran.stdout + ran.stderr
    return {(name, int(line)) for name, line in re.findall(r'^(\S+):(\d+): error', ran.stdout,
                                                           re.MULTILINE)}


def test_a_users_script_passes_the_strict_check(complaints):
    assert not {place for place in complaints if place[0].endswith('right.py')}


def test_every_mistake_of_a_users_script_is_found_and_nothing_else(complaints):
    lines = (SCRIPTS / 'wrong.py').read_text().splitlines()
    marked = {number for number, line in enumerate(lines, 1) if '# mistake' in line}
    assert marked
    assert {line for name, line in complaints if name.endswith('wrong.py')} == marked


def public_functions():
    """Yield (name, function) of all that `core` exports and users call."""
    for name in core.__all__:
        thing = getattr(core, name)
        if inspect.isfunction(thing):
            yield name, thing
        elif not issubclass(thing, Exception):
            for key, value in vars(thing).items():
                function = getattr(value, 'fget', None) or getattr(value, 'func', None) or \
                    getattr(value, '__func__', value)
                if not key.startswith('_') and inspect.isfunction(function):
                    yield f'{name}.{key}', function


def test_every_public_function_has_hints_for_all_arguments_and_its_value():
    missing = []
    for name, function in public_functions():
        hints = typing.get_type_hints(function, vars(core))
        wanted = [*inspect.signature(function).parameters, 'return']
        missing += [f'{name}: {word}' for word in wanted
                    if word not in hints and word not in ('self', 'cls')]
    assert not missing


def test_the_package_says_that_it_is_typed():
    assert (ROOT / 'color_stereo_ros/py.typed').is_file()
