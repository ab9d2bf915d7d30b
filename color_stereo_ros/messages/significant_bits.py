# SPDX-License-Identifier: Apache-2.0
"""Whether the values of 16-bit Bayer images fit the number of bits that they are said to have."""

from .reading import largest_value

ENOUGH = 10
"""Pairs after which a largest value says something."""
FULL = 16
SUSPICIOUS = 14
"""Images that need no more bits than this are dark, or fill the low bits only."""


class SignificantBits:
    """
    Keeps the largest value of the images and says what is odd about it.

    A 12-bit camera that fills the low bits and a dark scene before a 16-bit camera look the same.
    Therefore nothing is scaled by a guess: the user decides by `input.significant_bits`.

    """

    def __init__(self):
        self.largest = -1
        """Largest value of a 16-bit image so far, -1 = there was none."""
        self._pairs = 0
        self._said = set()

    def note(self, pair):
        """Take down the largest value of a `Pair` of images that can be read."""
        found = max(largest_value(pair.left), largest_value(pair.right))
        if found >= 0:
            self._pairs += 1
            self.largest = max(self.largest, found)

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
        if self.largest >= 1 << bits:
            return (f'the largest value of the 16-bit images is {self.largest}, but '
                    f'input.significant_bits = {bits} expects 0 .. {(1 << bits) - 1}: larger '
                    'values count as overexposed')
        if bits == FULL and self._pairs >= ENOUGH and self.largest < 1 << SUSPICIOUS:
            return (f'the largest value of the 16-bit images is {self.largest} of 65535: if the '
                    'camera fills the low bits only, set input.significant_bits to their number '
                    f'({max(10, self.largest.bit_length())} or more; 10, 12 and 14 are usual), '
                    'or most of the signal is lost; if the scene is dark, expose longer')
        return None

    def news(self, bits):
        """Return a doubt that has not been returned yet, or None; once for each kind."""
        doubt, kind = self.doubt(bits), (bits, self.largest >= 1 << bits)
        if doubt is None or kind in self._said:
            return None
        self._said.add(kind)
        return doubt
