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
"""Large fields piece by piece: the bytes of a whole computation, the memory of a piece."""

import numpy as np

PIECE = 1 << 17
"""Numbers of a piece, 1 MB of float64."""
BAND = (32 << 20) // 8 + 1
"""Numbers of a band: above 32 MB the C library gives memory back at once (M_MMAP_THRESHOLD)."""


class RowColors:
    """
    The colors of a pattern that are made when they are asked for.

    Parameters
    ----------
    make : callable
        Called with a slice of rows, returns their colors: numbers 0 .. 1 that broadcast to
        (rows, width, 3). Each slice is asked for once, in the order of the rows.
    least : int
        Rows of a slice that are worth a call.

    """

    def __init__(self, make, least=1):
        self.make = make
        self.least = least


def slices(count, size, least=1):
    """
    Yield slices that cover 0 .. count in pieces.

    Parameters
    ----------
    count : int
        Rows or columns.
    size : int
        Numbers in each of them.
    least : int
        Rows or columns of a piece.

    """
    step = max(least, PIECE // size)
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))


class Bands:
    """
    A field of numbers and, before, its spectrum in the same memory, in bands of rows.

    A band is given back to the system as soon as the rows behind it are asked for.

    Parameters
    ----------
    height, width : int
        Of the field.

    """

    def __init__(self, height, width):
        self._width = width
        self._half = width // 2 + 1
        step = max(1, -(-BAND // (2 * self._half)))
        self._rows = [slice(first, min(first + step, height)) for first in range(0, height, step)]
        self._memory = [np.empty((rows.stop - rows.start) * 2 * self._half) for rows in self._rows]

    def spectrum(self):
        """Yield (rows, complex128 (rows, width // 2 + 1)) of each band, to be read and written."""
        for rows, memory in zip(self._rows, self._memory):
            yield rows, memory.view(np.complex128).reshape(-1, self._half)

    def _values(self, index):
        """Return the numbers of a band, float64 (n,), without copying them."""
        rows = self._rows[index]
        return self._memory[index][:(rows.stop - rows.start) * self._width]

    def _between(self, first, last):
        """Return the numbers first .. last - 1 of the whole field, contiguous."""
        parts = []
        for index, rows in enumerate(self._rows):
            start, stop = rows.start * self._width, rows.stop * self._width
            if start < last and first < stop:
                parts.append(self._values(index)[max(first - start, 0):last - start])
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def total(self, function):
        """
        Return the sum of a function of all numbers, to the bit as `numpy.sum` adds them.

        Parameters
        ----------
        function : callable
            Takes float64 (n,), returns as many numbers.

        """
        return self._total(function, 0, self._rows[-1].stop * self._width)

    def _total(self, function, first, count):
        if count <= PIECE:
            return np.add.reduce(function(self._between(first, first + count)))
        # NumPy adds in halves, each a multiple of 8 (pairwise_sum in loops_utils.h.src)
        half = count // 2
        half -= half % 8
        return (self._total(function, first, half)
                + self._total(function, first + half, count - half))

    def subtract(self, number):
        """Subtract a number from all."""
        for index in range(len(self._rows)):
            values = self._values(index)
            values -= number

    def rows(self, wanted):
        """Return some rows, float64 (rows, width); earlier bands are forgotten."""
        for index, rows in enumerate(self._rows):
            if rows.stop <= wanted.start:
                self._memory[index] = None
        return self._between(wanted.start * self._width, wanted.stop * self._width).reshape(
            -1, self._width)
