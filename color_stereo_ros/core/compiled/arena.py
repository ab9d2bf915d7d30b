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

import numpy as np

BLOCK = 1 << 24  # bytes
ALIGNMENT = 64   # bytes: a cache line
STAGGER = 320    # bytes between arrays: at a distance of whole pages they would share cache sets


class Arena:
    """
    Gives out arrays that live as long as whoever holds them.

    A pair goes through dozens of arrays of some hundred kilobytes: more pages than a processor
    remembers the places of. NumPy asks Linux for huge pages where it allocates 4 MB or more, which
    these arrays get by lying in one block.

    """

    def __init__(self):
        """Begin without any block."""
        self._block = np.empty(0, np.uint8)
        self._used = 0

    def empty(self, shape, dtype):
        """Return an array without content."""
        size = math.prod(shape) * np.dtype(dtype).itemsize
        if self._used + size > self._block.size:
            self._block = np.empty(max(BLOCK, size + ALIGNMENT), np.uint8)
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
