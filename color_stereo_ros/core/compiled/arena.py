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
"""Buffers beside each other in large blocks of memory."""

import math
import mmap

import numpy as np

BLOCK = 1 << 24  # bytes
HUGE = 1 << 21   # bytes of a huge page of Linux
ALIGNMENT = 64   # bytes: a cache line
STAGGER = 320    # bytes between arrays: at a distance of whole pages they would share cache sets


class Arena:
    """
    Gives out arrays that live as long as whoever holds them.

    A pair goes through dozens of arrays of some hundred kilobytes: more pages than a processor
    remembers the places of. In one block they can have huge pages. The system gives a block, not
    the C library: what of it is never used takes no memory, and what is free goes back at once.

    """

    def __init__(self):
        """Begin without any block."""
        self._block = np.empty(0, np.uint8)
        self._used = 0

    def empty(self, shape, dtype):
        """Return an array without content."""
        size = math.prod(shape) * np.dtype(dtype).itemsize
        if self._used + size > self._block.size:
            self._block = memory(max(BLOCK, size + ALIGNMENT))
            self._used = -self._block.ctypes.data % ALIGNMENT
        found = self._block[self._used:self._used + size].view(dtype).reshape(shape)
        self._used += size + -size % ALIGNMENT + STAGGER
        return found

    def full(self, shape, value, dtype):
        """Return an array filled with a value."""
        found = self.empty(shape, dtype)
        found.fill(value)
        return found

    def zeros(self, shape, dtype):
        """Return an array of zeros."""
        return self.full(shape, 0, dtype)

    def copy(self, array):
        """Return a copy of an array."""
        found = self.empty(array.shape, array.dtype)
        found[...] = array
        return found


def memory(size):
    """Return new bytes, uint8 (size,), at the start of a huge page where the system has them."""
    if not hasattr(mmap, 'MAP_ANONYMOUS'):
        return np.empty(size, np.uint8)
    block = mmap.mmap(-1, size + HUGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, 'MADV_HUGEPAGE'):
        try:
            block.madvise(mmap.MADV_HUGEPAGE)
        except OSError:  # Linux without huge pages
            pass
    whole = np.frombuffer(block, np.uint8)
    first = -whole.ctypes.data % HUGE
    return whole[first:first + size]
