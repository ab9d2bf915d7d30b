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
"""Functions that only kernels call."""

import os
from pathlib import Path
import subprocess
import sys

from color_stereo_ros.core.compiled import part
from numba import njit
import numpy as np
import pytest

SCRIPT = """
import numpy as np
from test_parts import root_mean, squares_mean
print(root_mean(np.array([3.0, 4.0])), len(getattr(squares_mean, 'signatures', ())))
"""


@part()
def square(value):
    """Return a part of a part."""
    return value * value


@part()
def squares_mean(values):
    """Return the mean of the squares."""
    total = 0.0
    for i in range(values.size):
        total += square(values[i])
    return total / values.size


@njit(cache=True)
def root_mean(values):
    """Return a number that takes both parts."""
    return np.sqrt(squares_mean(values))


def test_kernels_take_in_parts_and_parts_of_parts():
    assert root_mean(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert root_mean(np.array([2, -2])) == 2  # of several types


def test_python_cannot_call_a_part_but_its_function():
    with pytest.raises(TypeError):
        square(2.0)
    assert square.py_func(3.0) == 9


@pytest.mark.parametrize('options, compiled', [
    ({}, ['1', '0']), ({'NUMBA_DISABLE_JIT': '1'}, ['0', '0'])])
def test_a_kernel_from_the_cache_contains_its_parts(tmp_path, options, compiled):
    folder = Path(__file__).parent
    outputs = [subprocess.run(
        [sys.executable, '-c', SCRIPT], check=True, capture_output=True, text=True,
        env={**os.environ, **options, 'NUMBA_CACHE_DIR': str(tmp_path),
             'PYTHONPATH': os.pathsep.join([str(folder.parent), str(folder)])}).stdout.split()
        for _ in range(2)]
    assert [float(value) for value, _ in outputs] == [pytest.approx(np.sqrt(12.5))] * 2
    assert [parts for _, parts in outputs] == compiled
    assert not any(tmp_path.rglob('*square*'))
