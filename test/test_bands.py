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
"""Parallel kernels made of functions of one band."""

import os
from pathlib import Path
import subprocess
import sys

from color_stereo_ros.core.compiled import band, banded, BANDS
import numba
import numpy as np
import pytest

SCRIPT = """
import numpy as np
from test_bands import marked
print(marked(40, 3))
"""


@banded()
def mark(k, values, offsets, factor, out):
    """Write factor values + the second offset into every BANDS-th place."""
    for i in range(k, out.size, BANDS):
        out[i] += factor * values[i] + offsets[1]


@banded(count=3)
def count_calls(k, calls):
    """Count how often a band was done."""
    calls[k] += 1


def marked(size, factor):
    """Return the sum of what `mark` writes."""
    out = np.zeros(size)
    mark(np.arange(size, dtype=float), (7.0, 0.5), factor, out)
    np.testing.assert_array_equal(out, factor * np.arange(size) + 0.5)
    return out.sum()


@pytest.mark.parametrize('threads', sorted({1, numba.config.NUMBA_NUM_THREADS}))
def test_every_band_is_done_once_whatever_the_number_of_threads(threads):
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        calls = np.zeros(3, np.int64)
        for turn in range(1, 200):
            count_calls(calls)
            np.testing.assert_array_equal(calls, turn)
        marked(1000, 2)
    finally:
        numba.set_num_threads(before)


def test_arrays_scalars_and_tuples_of_several_types_arrive():
    for size in (5, 64):
        for factor in (3, np.float32(0.25)):
            marked(size, factor)


def test_bands_cover_everything_once():
    for size in (0, 1, 7, 8, 61):
        bands = [band.py_func(k, size) for k in range(BANDS)]
        assert [i for first, last in bands for i in range(first, last)] == list(range(size))


@pytest.mark.parametrize('options', [{}, {'NUMBA_DISABLE_JIT': '1'}])
def test_another_process_finds_the_kernel_in_the_cache_or_does_without(tmp_path, options):
    folder = Path(__file__).parent
    for _ in range(2):  # compiled, then loaded
        output = subprocess.run(
            [sys.executable, '-c', SCRIPT], check=True, capture_output=True, text=True,
            env={**os.environ, **options, 'NUMBA_CACHE_DIR': str(tmp_path),
                 'PYTHONPATH': os.pathsep.join([str(folder.parent), str(folder)])}).stdout
        assert float(output) == marked(40, 3)
    assert any(tmp_path.rglob('*mark*.nbc')) == (not options)


@pytest.mark.parametrize('count', [0, 64])
def test_more_bands_than_bits_are_refused(count):
    with pytest.raises(ValueError, match=f'count = {count}'):
        banded(count=count)


def test_names_and_documentation_of_the_function_are_kept():
    assert mark.__name__ == 'mark'
    assert mark.__doc__.startswith('Write factor values')
