# SPDX-License-Identifier: Apache-2.0
"""
All constants of the projector's geometry: value, unit, reason and provenance of each.

The scenes and disturbances named here are those of docs/third_view.md.

"""

from dataclasses import dataclass

from ..constants import chosen, constant, Constants, derived, unexplained


@dataclass(frozen=True)
class MatchingTuning(Constants):
    """The matches from nothing: SIFT on two chromaticities."""

    largest_width: int = constant(
        800, 'px', 'Width up to which images are searched as they are; wider ones are reduced.',
        derived('The time of the search stays below 1 s.'))
    features: int = constant(
        3000, '1', 'Largest number of features per image and chromaticity.',
        derived('Bounds the time of matching.'))
    ratio: float = constant(
        0.75, '1', 'Largest ratio of the best to the second best distance (Lowe 2004).',
        unexplained('The usual value; 90 % and more of the matches agree.'))


@dataclass(frozen=True)
class Tuning(Constants):
    """All constants of the projector's geometry."""

    matching: MatchingTuning = MatchingTuning()


TUNING = Tuning()
