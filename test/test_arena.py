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
"""Buffers beside each other in one block."""

import mmap

from color_stereo_ros.core.compiled.arena import ALIGNMENT, Arena, BLOCK, HUGE, memory
import numpy as np
import pytest


def test_arrays_are_aligned_writable_and_apart():
    arena = Arena()
    arrays = [arena.full((3, 5), index, dtype)
              for index, dtype in enumerate((np.uint8, np.float32, np.int16, bool, np.float64))]
    for index, array in enumerate(arrays):
        assert array.ctypes.data % ALIGNMENT == 0 and array.flags.c_contiguous
        assert (array == (index if array.dtype != bool else True)).all()


def test_arrays_share_a_block_until_it_is_full():
    arena = Arena()
    first, second = (arena.zeros((1000,), np.float32) for _ in range(2))
    assert 4000 < second.ctypes.data - first.ctypes.data < 5000
    large = arena.zeros((BLOCK,), np.uint8)
    assert not np.shares_memory(first.base, large.base)


def test_an_array_may_be_larger_than_a_block():
    assert Arena().zeros((BLOCK + 1,), np.uint8).nbytes == BLOCK + 1


@pytest.mark.parametrize('shape', [(0,), (2, 0, 3), ()])
def test_empty_shapes_are_served(shape):
    assert Arena().zeros(shape, np.float32).shape == shape


def test_a_copy_is_independent():
    source = np.arange(6, dtype=np.int32).reshape(2, 3)
    copy = Arena().copy(source)
    source[0, 0] = 9
    assert copy.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_what_is_not_used_takes_no_memory():
    """Of this block alone: what the rest of the process takes and frees does not count."""
    block = memory(8 * BLOCK)
    first = block.ctypes.data
    assert first % HUGE == 0
    assert resident(first) == 0
    block[:BLOCK] = 1
    assert resident(first) == BLOCK
    del block
    assert resident(first) < HUGE  # where it was, the process may have put something small


def resident(first):
    """Return how many of the bytes from an address on, 8 blocks, are in memory or swapped."""
    size, present = mmap.PAGESIZE, 3 << 62
    with open('/proc/self/pagemap', 'rb', buffering=0) as file:  # 8 bytes a page, proc(5)
        file.seek(first // size * 8)
        pages = np.frombuffer(file.read(8 * BLOCK // size * 8), np.uint64)
    return int((pages & np.uint64(present) > 0).sum()) * size
