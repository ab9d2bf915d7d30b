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
"""A ColorStereo is ready when it is made: whatever comes, nothing is compiled any more."""

from dataclasses import fields
from itertools import chain, combinations, islice

from color_stereo_ros.core import ColorStereo, ColorStereoError, Settings
from color_stereo_ros.core.compiled import decorators, told_of_compiling
from color_stereo_ros.core.compiled.decorators import Kernel
from color_stereo_ros.core.methods import METHODS
from color_stereo_ros.core.settings.fields import flat
from color_stereo_ros.core.surface.warm_up import SIZE, some_calibration
import numba
import numpy as np
import pytest

CALIBRATION = some_calibration()
RANGE = {'range.min_depth': 0.25, 'range.max_depth': 0.8}
FIXED = {'pattern.width', 'pattern.height', 'matching.method', 'color.calibration', *RANGE}


def choices():
    """Return every setting with other values: all choices, both switches, both ends of a range."""
    found = []
    for name, default in flat(Settings()).items():
        group, key = name.split('.')
        spec = next(each for each in fields(getattr(Settings(), group)) if each.name == key)
        if name in FIXED:
            continue
        if isinstance(default, bool):
            values = [not default]
        elif spec.metadata.get('choices') is not None:
            values = [each for each in spec.metadata['choices'] if each != default]
        else:
            values = [value for value in (spec.metadata['minimum'], spec.metadata['maximum'])
                      if value != default and abs(value) < 1000]
        found += [(name, value) for value in values]
    return found


def all_settings(method, first=0, step=1):
    """
    Return sets of changes: none, each alone, and all pairs of what switches or chooses.

    Of the pairs only every `step`-th one, from number `first` on.

    """
    switches = [each for each in choices() if isinstance(each[1], (bool, str))]
    both = islice(combinations(switches, 2), first, None, step)
    changes = chain([()], ((each,) for each in choices()), both)
    return [{**RANGE, 'matching.method': method, **dict(each)} for each in changes]


def pairs():
    """Yield what may come: colors, noise, white; written to, read-only, a part of an array."""
    rng = np.random.default_rng(4)
    shape = (SIZE[1], SIZE[0], 3)
    ramp = np.add.outer(np.arange(shape[0]), 3 * np.arange(shape[1]))
    colors = np.stack([127 + 100 * np.sin(ramp / 15 + phase) for phase in (0, 2, 4)], axis=-1)
    colors = colors.astype(np.uint8)
    yield colors, np.roll(colors, -3, axis=1)
    noise = rng.integers(0, 256, (2, *shape), dtype=np.uint8)
    yield noise[0], np.frombuffer(noise[1].tobytes(), np.uint8).reshape(shape)
    noise.flags.writeable = False
    yield noise[0], noise[1]
    wide = np.zeros((shape[0], 2 * shape[1], 3), np.uint8)
    wide[:, ::2] = colors
    yield wide[:, ::2], np.asfortranarray(colors)
    yield np.full(shape, 255, np.uint8), colors


@pytest.fixture
def called(monkeypatch):
    """Return the set of kernels and types of their arguments that are called."""
    found = set()
    original = Kernel.__call__

    def call(kernel, *args):
        found.add((kernel.__module__, kernel.__name__, tuple(map(numba.typeof, args))))
        return original(kernel, *args)

    monkeypatch.setattr(Kernel, '__call__', call)
    return found


@pytest.mark.long
@pytest.mark.parametrize('rectified', [False, True])
@pytest.mark.parametrize('method', METHODS)
def test_every_kernel_that_runs_has_run_in_the_constructor(method, rectified, called, effort):
    """
    Kernels are compiled for the types of their arguments: the same types, nothing compiled.

    At short length raw and rectified images share the pairs of changes: each is tried with one.

    """
    tried = 0
    for values in all_settings(method, *((0, 1) if effort.full else (int(rectified), 2))):
        try:
            settings = Settings().updated(values)
            called.clear()
            stereo = ColorStereo(CALIBRATION, settings, rectified_input=rectified)
        except ColorStereoError:
            continue  # settings that contradict each other
        ready = set(called)
        for pair in pairs():
            stereo.process(*pair)
        late = [(module, name) for module, name, _ in called - ready]
        assert not late, (values, late)
        tried += 1
    assert tried > 50


def test_who_asks_is_told_of_compiling_once():
    told = []
    with told_of_compiling(lambda: told.append('compiling')):
        function = numba.njit(lambda number: number + 1)
        function(1)
        function(1.0)
    function(True)
    assert told == ['compiling']


def test_kernels_keep_no_code_that_only_other_functions_would_need():
    """Kernels that were compiled just now have none: they get some, as from the cache."""
    ColorStereo(CALIBRATION, Settings())
    called = {each for kernel in decorators._WAY.kernels for each in kernel.called()}
    assert called
    found = [library for kernel in set(decorators._WAY.kernels) - called
             for library in libraries(kernel)]
    assert len(found) > 50
    for library in found:
        library._shared_module = 'code'
    ColorStereo(CALIBRATION, Settings())
    assert all(library._shared_module is None for library in found)


def libraries(kernel):
    """Return the compiled code of a kernel, one for each types of arguments."""
    return [compiled.library for made in kernel._made.values()
            for compiled in made.overloads.values()]
