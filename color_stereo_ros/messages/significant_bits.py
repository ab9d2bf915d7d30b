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
"""Whether the values of 16-bit Bayer images fit the number of bits that they are said to have."""

from .reading import largest_value

ENOUGH = 10
"""Pairs after which a largest value says something."""
FULL = 16
SUSPICIOUS = 14
"""Images that need no more bits than this are dark, or fill the low bits only."""
UNLIKE = 4
"""Factor between the largest values of the cameras: that of two more bits."""


class SignificantBits:
    """
    Keeps the largest values of both cameras and says what is odd about them.

    A 12-bit camera that fills the low bits and a dark scene before a 16-bit camera look the same.
    Therefore nothing is scaled by a guess: the user decides by `input.significant_bits`.

    """

    def __init__(self):
        self._largest = [-1, -1]  # of the left and of the right camera, -1 = no 16-bit image
        self._pairs = 0
        self._said = set()

    def note(self, pair):
        """Take down the largest values of a `Pair` of images that can be read."""
        found = largest_value(pair.left), largest_value(pair.right)
        self._pairs += max(found) >= 0
        self._largest = [max(values) for values in zip(self._largest, found)]

    def doubt(self, bits):
        """
        Return what is odd.

        Parameters
        ----------
        bits : int
            `input.significant_bits`.

        Returns
        -------
        doubt : str or None

        """
        return self._found(bits)[1]

    def news(self, bits):
        """Return a doubt that has not been returned yet, or None; once for each kind."""
        kind, doubt = self._found(bits)
        if doubt is None or (bits, kind) in self._said:
            return None
        self._said.add((bits, kind))
        return doubt

    def _found(self, bits):
        """Return (kind, doubt), or (None, None)."""
        largest, smaller = max(self._largest), min(self._largest)
        if largest >= 1 << bits:
            return 'too large', (
                f'the largest value of the 16-bit images is {largest}, but '
                f'input.significant_bits = {bits} expects 0 .. {(1 << bits) - 1}: larger '
                'values count as overexposed')
        if self._pairs < ENOUGH:
            return None, None
        if bits == FULL and largest < 1 << SUSPICIOUS:
            return 'too small', (
                f'the largest value of the 16-bit images is {largest} of 65535: if the '
                'camera fills the low bits only, set input.significant_bits to their number '
                f'({max(10, largest.bit_length())} or more; 10, 12 and 14 are usual), '
                'or most of the signal is lost; if the scene is dark, expose longer')
        if smaller >= 0 and largest >= max(UNLIKE * smaller, 1 << bits - 2):
            left, right = self._largest
            return 'unlike', (
                f'the largest value of the 16-bit images is {left} on the left and {right} on '
                'the right: the cameras fill different numbers of bits, or one of them gets '
                'little light; let both send the same pixel format, and expose both alike')
        return None, None
