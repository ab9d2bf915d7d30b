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
"""A pair is measured again until the rows of its views agree."""

import math

from ..rows.alignment import Alignment, RowEvidence
from ..rows.estimate import applicable, failed, field_apart, left_over
from ..rows.tuning import TUNING


class Aligner:
    """
    Measures the rows of pairs and corrects them.

    Parameters
    ----------
    size : (int, int)
        Width and height of the image, px.
    correct : bool
        Correct the rows; False: only measure them.
    turning : bool
        Ask each pair other cells than the one before: the drift of the cameras needs all cells,
        but the rows then move a little from pair to pair.

    """

    def __init__(self, size, correct, turning=False):
        """Take what is the same for all pairs."""
        self.size, self.correct, self.turning = size, correct, turning

    def align(self, prior, measured, search):
        """
        Measure one pair with its rows corrected.

        Parameters
        ----------
        prior : Alignment or None
            What is known of the rows.
        measured : callable
            Measures the pair with the rows of the right view corrected by prior.applied; takes
            an Alignment and returns that which the pair shows.
        search : callable or None
            Searches the pair from nothing; returns an Alignment or None, and a sentence.

        Returns
        -------
        alignment : Alignment
            That of the last call of `measured`.

        """
        turn = prior.next_turn() if self.turning and prior is not None else 0
        prior = Alignment.unknown(self.size) if prior is None else prior
        return self.answered(
            prior, lambda known: measured(known.but(turn=turn)), search).but(turn=turn)

    def answered(self, prior, measured, search):
        """Do what `align` does, where `measured` asks the cells of a turn."""
        found = self.followed(prior, measured)
        if found.agreeing:
            return agreed(found)
        if not found.due:
            return settled(prior, found).but(wait=found.wait - 1)
        if prior.applied.any() and self.correct:
            fresh = self.followed(Alignment.unknown(self.size), measured)
            if better(fresh, found):
                return agreed(fresh)
            found = self.followed(prior, measured)
        if search is None:
            return settled(prior, found)
        return self.after(*search(), prior, found, measured)

    def after(self, start, sentence, prior, found, measured):
        """
        Go on from what a search has found.

        Parameters
        ----------
        start : Alignment or None
            What is known of the rows before; None: nothing.
        sentence : str
            What was found that cannot be corrected.
        prior, found : Alignment
            Before the pair, and what the pair shows without the search.
        measured : callable
            See `align`.

        Returns
        -------
        alignment : Alignment

        """
        if start is not None and self.correct and field_apart(start, found) > TUNING.use.bump:
            other = self.followed(start, measured)
            if better(other, found) or other.agreeing and other.misfit < found.misfit:
                return agreed(other)
            found = self.followed(prior, measured)
        elif start is not None and self.correct and found.observable:
            # two ways to the same rows: the views differ in something else
            return agreed(found.but(agreeing=True))
        if start is not None and not self.correct:
            return failed(start.but(applied=found.applied, agreeing=False, misfit=found.misfit,
                                    tries=found.tries), sentence)
        return failed(settled(prior, found), sentence)

    def followed(self, prior, measured):
        """Measure the pair until nothing is left that its matches show; see `align`."""
        use = TUNING.use
        applied = applicable(prior) if self.correct else prior.applied
        for turn in range(use.turns):
            found = measured(prior.but(applied=applied))
            left = left_over(found)
            if not self.correct or left < use.again or turn == use.turns - 1:
                break
            if not found.agreeing and left < use.followed:
                break
            applied, last = applicable(found), applied
            if not (applied != last).any():
                break
        return found


def agreed(alignment):
    """Return an alignment that is carried on; where it does not agree, a search may wait."""
    if not alignment.agreeing:
        return failed(alignment, '')
    if not (alignment.searched or alignment.wait or alignment.tries):
        return alignment
    return alignment.but(searched='', wait=0, tries=0)


def better(one, other):
    """Return whether the views agree clearly better under one alignment than under another."""
    return one.misfit < TUNING.use.better * other.misfit


def doubt(alignment):
    """
    Return the log-odds that all nodes lose because the views of a pair do not agree.

    The largest loss where a search has refused the pair and its matches fit badly, or no cell has
    matches.

    """
    use, misfit = TUNING.use, alignment.misfit
    if alignment.agreeing or misfit <= use.doubted:
        return 0.0
    if alignment.searched:
        return use.largest_doubt
    if not alignment.scatter > use.chance or math.isinf(misfit):
        return 0.0
    return min(use.doubt * math.log2(misfit / use.doubted), use.largest_doubt)


def settled(prior, found):
    """Return what is carried on of a pair whose views do not agree: what was known before."""
    return found.but(coefficients=prior.coefficients, covariance=prior.covariance,
                     evidence=RowEvidence.none())
