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
"""One door to numba: what happens where numba is not as known, or not there."""

import ast
from functools import cache
import os
from pathlib import Path
import re
import subprocess
import sys

from color_stereo_ros.core import ColorStereo, ColorStereoError
from color_stereo_ros.core.compiled import decorators, plain
from color_stereo_ros.core.compiled.requirement import REQUIREMENT, TESTED
from color_stereo_ros.errors import InstallationError
import numba
import numpy as np
import pytest
from surface_pairs import plane_pair, rig, surface_settings

FOLDER = Path(__file__).parent
ROOM = 'core/compiled/'
PACKAGE = FOLDER.parent / 'color_stereo_ros'
CACHE = FOLDER.parent / '.numba_cache' / 'broken'
"""Kept from run to run, apart from the usual one: what is there need not be compiled."""

SETTINGS = {'matching__third_view': 'off', 'matching__row_alignment': 'off'}
"""Half of the kernels of the surface method."""
METHODS = ('paper', 'surface')
"""
Those with few kernels first. What compiles kernels does not know what they are for, so the paper's
method and `total` tell what the surface method would tell in seven times the time.
"""

BREAK = """
import sys
import numba

def ours():
    # the caller of the caller
    return sys._getframe(2).f_globals.get('__name__', '').startswith('color_stereo_ros')

def changed(place, name):
    # for all but numba itself
    function = getattr(place, name)
    def refusing(*args, **options):
        if ours():
            raise TypeError(f'{name}() takes other arguments')
        return function(*args, **options)
    setattr(place, name, refusing)
"""
MEASURE = """
import sys
import numpy as np
from test_compiled import decorators, measured, plain, total
result = measured(sys.argv[2])
np.savez(sys.argv[1], disparity=result.disparity, status=result.status)
print(total(np.ones(8, np.float32), np.float32(3), np.empty(8, np.float32)),
      decorators._WAY.chosen is plain)
"""
BREAKS = {
    'a class that is gone':
        'import numba.core.codegen\ndel numba.core.codegen.JITCodeLibrary',
    'a pass with another name':
        'import numba.core.typed_passes as place\n'
        'place.Lowering = place.NativeLowering\ndel place.NativeLowering',
    'an option of njit that is gone':
        'original = numba.njit\n'
        'def njit(*args, _nrt=None, **options):\n'
        '    if _nrt is not None: raise KeyError("Unrecognized options: _nrt")\n'
        '    return original(*args, **options)\n'
        'numba.njit = njit',
    'flags that cannot be copied':
        'import numba.core.compiler\nchanged(numba.core.compiler.Flags, "__init__")',
    'a flag that is gone':
        'from numba.core.targetconfig import TargetConfig\n'
        'def no(flags, name, value):\n'
        '    if name == "noalias" and ours(): raise AttributeError(name)\n'
        '    object.__setattr__(flags, name, value)\n'
        'TargetConfig.__setattr__ = no',
    'passes that are added otherwise':
        'from numba.core.compiler_machinery import PassManager\n'
        'changed(PassManager, "add_pass_after")',
    'arrays that are made otherwise':
        'import numba.np.arrayobj\nchanged(numba.np.arrayobj, "populate_array")',
    'a dispatcher without results':
        'from numba.core.dispatcher import Dispatcher\n'
        'changed(Dispatcher, "get_compile_result")',
}


def run(code, *args, **environment):
    """Return the finished process of some code that finds the package and the tests."""
    return subprocess.run(
        [sys.executable, '-c', code, *map(str, args)], capture_output=True, text=True,
        env={**os.environ, **environment,
             'PYTHONPATH': os.pathsep.join([str(FOLDER.parent), str(FOLDER)])})


def measured(method):
    """Return what a method measures of a plane."""
    settings = surface_settings(4, 40, matching__method=method, **SETTINGS)
    return ColorStereo(rig(160, 96), settings).process(*plane_pair(160, 96, 12.25))


@pytest.fixture(scope='module')
def usual():
    """Return by method the result of the same pair as compiled the fast way."""
    return cache(measured)


@pytest.mark.parametrize('what', BREAKS)
def test_where_numba_has_changed_a_pair_is_measured_all_the_same(tmp_path, usual, what, effort):
    """Only the first case compiles for long: the others find its kernels in the cache."""
    method = METHODS[effort.count(1, 2) - 1]
    for path in CACHE.rglob('*.nb?'):
        if '_plain' not in path.name:
            path.unlink()  # what is compiled already cannot fail to compile
    ran = run(BREAK + BREAKS[what] + MEASURE, tmp_path / 'found.npz', method,
              NUMBA_CACHE_DIR=str(CACHE), NUMBA_OPT='1')
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout == '24.0 True\n'
    warnings = ran.stderr.splitlines()
    assert len(warnings) == 1 and REQUIREMENT in warnings[0], ran.stderr
    with np.load(tmp_path / 'found.npz') as found:
        disparity, status = found['disparity'], found['status']
    expected = usual(method)
    known = np.isfinite(disparity)
    assert np.mean(known) > 0.9
    both = known & np.isfinite(expected.disparity)
    # the two ways round differently, which a few pixels at borders amplify
    assert np.mean(status == expected.status) > 0.995
    assert np.mean(np.abs(disparity - expected.disparity)[both] < 1e-3) > 0.995


@pytest.mark.parametrize('version', ['99.1.0', '0.69.0rc1', 'dev'])
def test_a_release_that_was_not_tested_is_used_the_plain_way(version):
    """A kernel alone: numba takes nothing from the cache of another version."""
    ran = run(f'import numba\nnumba.__version__ = {version!r}\n'
              'import numpy as np\nfrom test_compiled import decorators, plain, total\n'
              'print(total(np.ones(8, np.float32), np.float32(3), np.empty(8, np.float32)), '
              'decorators._WAY.chosen is plain)')
    assert (ran.returncode, ran.stdout) == (0, '24.0 True\n'), ran.stderr
    assert len(ran.stderr.splitlines()) == 1
    assert f'numba {version} ' in ran.stderr and REQUIREMENT in ran.stderr


def test_where_numba_is_as_known_nothing_is_said_and_the_fast_way_is_taken(tmp_path):
    ran = run(MEASURE, tmp_path / 'found.npz', 'surface')
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, '24.0 False\n', '')


@decorators.banded(fastmath={'contract'})
def scaled(k, values, factor, out):
    """Write factor times values, through a part and a stack row."""
    first, last = decorators.band(k, values.size)
    row = decorators.stack_row()
    for i in range(first, last):
        row[0] = values[i]
        out[i] = doubled(row[0]) * factor / 2


@decorators.part()
def doubled(value):
    """Return twice a number."""
    return 2 * value


@decorators.serial()
def total(values, factor, scratch):
    """Return the sum of what `scaled` writes: a kernel that calls another one."""
    scaled(values, factor, scratch)
    return scratch.sum()


@pytest.mark.parametrize('kernel, arguments', [(scaled, 3), (total, 3)])
def test_both_ways_give_the_same_numbers(kernel, arguments):
    values, out = np.arange(40, dtype=np.float32), [np.empty(40, np.float32) for _ in range(2)]
    found = [kernel(values, np.float32(3), out[0]),
             kernel.made(plain)(values, np.float32(3), out[1])]
    np.testing.assert_array_equal(out[0], 3 * values)
    np.testing.assert_array_equal(out[1], 3 * values)
    assert found[0] == found[1]


LINKED = """
from color_stereo_ros.core.compiled import serial

@serial()
def inner(values):
    return values.sum()

@serial()
def other(values):
    return values.max()

@serial()
def outer(values):
    return 2 * inner(values)
"""
LATE = """
from color_stereo_ros.core.compiled import serial
from linked import inner, other

@serial()
def late(values):
    return inner(values) + other(values)
"""
FORGET = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from color_stereo_ros.core.compiled import decorators, forget_bitcode, plain
from linked import inner, other, outer

def kept(kernel):
    return [compiled.library._shared_module is not None
            for compiled in kernel.overloads.values()]

values = np.ones(8, np.float32)
print(inner(values), other(values), kept(inner), kept(other),
      sum(inner.stats.cache_hits.values()), sum(other.stats.cache_hits.values()))
forget_bitcode()
print(kept(inner), kept(other))
"""


def test_what_a_kernel_calls_can_be_linked_after_the_rest_is_forgotten(tmp_path):
    """
    Kernels from the cache: only what is kept of them can be linked.

    The first process fills the cache. `late` is defined when `other` is forgotten already.

    """
    (tmp_path / 'linked.py').write_text(LINKED)
    (tmp_path / 'late.py').write_text(LATE)
    calls = ('',
             'print(outer(values), other(values), other(np.ones(3)))\n',
             'from late import late\nforget_bitcode()\nprint(late(values), other(values))\n')
    outputs = []
    for call in calls:
        ran = run(FORGET + call + 'print(decorators._WAY.chosen is plain)\n', tmp_path,
                  NUMBA_CACHE_DIR=str(tmp_path / 'cache'))
        assert (ran.returncode, ran.stderr) == (0, '')
        outputs.append(ran.stdout.splitlines())
    first = '8.0 1.0 [True] [True] 1 1'
    assert outputs[1] == [first, '[True] [False]', '16.0 1.0 1.0', 'False']
    assert outputs[2] == [first, '[True] [False]', '9.0 1.0', 'False']  # loaded once more


def test_wrong_arguments_are_no_reason_to_give_the_fast_way_up(caplog):
    with pytest.raises(Exception, match='argument'):
        scaled(np.zeros(3, np.float32))
    assert decorators._WAY.chosen is not plain and not caplog.records


def test_an_error_that_a_kernel_raises_itself_is_not_hidden():
    @decorators.serial()
    def raising(value):
        raise IndexError('its own')

    with pytest.raises(IndexError, match='its own'):
        raising(1)
    assert decorators._WAY.chosen is not plain


NOT_THERE = """
import sys

class Nowhere:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] == 'numba':
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Nowhere())
"""
COMMAND = """
from color_stereo_ros.cli.main import main
sys.exit(main(["process", "nowhere"]))
"""


@pytest.mark.parametrize('stub, words', [
    (None, 'numba is not installed'),
    ('raise ImportError("Numba needs NumPy 2.5 or less. Got NumPy 2.9.")',
     'Numba needs NumPy 2.5 or less. Got NumPy 2.9.'),
    ('raise ImportError("Numba needs Python 3.10 or greater. Got Python 3.9.")', 'Python 3.9'),
    ('raise SystemError("initialization of _internal failed")', '_internal failed')])
def test_without_a_numba_that_fits_one_line_says_what_to_install(tmp_path, stub, words):
    block = NOT_THERE
    if stub is not None:
        (tmp_path / 'numba').mkdir()
        (tmp_path / 'numba/__init__.py').write_text(stub)
        block = f'import sys\nsys.path.insert(0, {str(tmp_path)!r})\n'
    ran = run(block + COMMAND)
    assert ran.returncode == 1
    assert ran.stderr.startswith('color_stereo: numba ') and ran.stderr.count('\n') == 1
    assert words in ran.stderr and f"pip install '{REQUIREMENT}'" in ran.stderr
    ran = run(block + 'import color_stereo_ros.core')
    last = ran.stderr.splitlines()[-1]
    assert last.startswith('color_stereo_ros.errors.InstallationError: numba ') and words in last


def test_the_error_of_a_missing_package_is_an_import_error_and_one_of_ours():
    assert issubclass(InstallationError, ImportError)
    assert issubclass(InstallationError, ColorStereoError)


def test_setup_py_asks_for_what_was_tested():
    asked = re.search(r"'(numba[^']*)'", (FOLDER.parent / 'setup.py').read_text()).group(1)
    assert asked == REQUIREMENT
    assert asked.endswith(f'<{TESTED[0]}.{TESTED[1] + 1}')
    assert tuple(map(int, numba.__version__.split('.')[:2])) <= TESTED


def foreign_imports(path):
    """Yield the modules that a file imports from other packages, and what from them."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((alias.name, '') for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield from ((node.module, alias.name) for alias in node.names)


@pytest.mark.parametrize('path', sorted(PACKAGE.rglob('*.py')),
                         ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_numba_is_used_behind_the_door_only_and_its_private_parts_in_one_folder(path):
    name = path.relative_to(PACKAGE).as_posix()
    for module, _ in foreign_imports(path):
        if module.partition('.')[0] in ('numba', 'llvmlite'):
            assert name.startswith(ROOM)
            assert module == 'numba' or name.startswith(ROOM + 'internals/')
    if not name.startswith(ROOM):
        inside = re.findall(r'from [.\w]*\bcompiled\.(\w+) import', path.read_text())
        assert not inside  # the modules of the room are behind the door
