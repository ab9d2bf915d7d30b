# SPDX-License-Identifier: Apache-2.0
"""What the kind of pattern tells a search before it sees an image."""

from dataclasses import dataclass, replace
import math

APERIODIC = 'hue_field', 'wave_field', 'pseudo_noise'
CYCLIC = SLOW = 'sweep', 'bright_sweep', 'sine'


@dataclass(frozen=True)
class Prior:
    """What a search expects of the colors."""

    texture: float
    """Weight of the brightness of the surface beside color in the coarse search."""
    surroundings: int
    """Coarse nodes across: what is brighter than they are on average is texture."""
    knee: float
    """DN added to the brightness before its logarithm: noise of dark places is no texture."""
    smoothness: float
    """Factor of the penalties for steps."""
    blur: int
    """Radius over which colors are averaged, nodes."""
    least_gap: float
    """
    Large steps, at smoothness 1, by which a repetition of the pattern must cost more than a match
    to be out of the question; 0: the same colors do not come again within the search.
    """

    @property
    def repeats(self):
        """Return whether the same colors may come again within the search."""
        return self.least_gap > 0

    @classmethod
    def of(cls, settings, width):
        """
        Return the prior for a pattern that lights an image.

        Parameters
        ----------
        settings : Settings
            Of which `matching.texture` and `matching.smoothness` are factors.
        width : int
            Of the image, px.

        Returns
        -------
        prior : Prior

        """
        pattern, matching = settings.pattern, settings.matching
        kind = _kind(pattern, width)
        return replace(kind, texture=kind.texture * matching.texture,
                       smoothness=kind.smoothness * matching.smoothness)


def _kind(pattern, width):
    """Return the prior before the settings change it."""
    if pattern.type in APERIODIC:
        return Prior(texture=0.35, surroundings=9, knee=12.0, smoothness=1.0, blur=0,
                     least_gap=0.0)
    cycles = pattern.cycles if pattern.type in SLOW else math.inf  # unknown
    # A color that changes slowly shows its slope only over many pixels.
    blur = min(4, round(width / cycles / 160))
    # Neighbors and the brightness of the surface tell repetitions apart: shading, too, and not
    # print only, where it is known that whole periods may be confused.
    shaded = 1 < cycles < math.inf
    smoothness = 1.0 if blur else 2.0
    return Prior(texture=4.0 if shaded else 2.0, surroundings=41 if shaded else 9, knee=48.0,
                 smoothness=smoothness, blur=blur, least_gap=smoothness if cycles > 1 else 0.0)


@dataclass(frozen=True)
class Expectation:
    """What is known of a pattern."""

    aperiodic: bool
    """The same colors do not come again, and every part holds all of them alike."""
    cycles: float
    """How often the colors come again over the width of the pattern; inf: not known."""

    @property
    def repeats(self):
        """Return whether the same colors may come again within the search."""
        return not self.aperiodic and self.cycles > 1

    @property
    def counted(self):
        """Return whether the pattern has several cycles of a known number."""
        return self.repeats and math.isfinite(self.cycles)

    @classmethod
    def of(cls, pattern):
        """
        Return what is known of a pattern.

        Parameters
        ----------
        pattern : PatternSettings

        Returns
        -------
        expectation : Expectation

        """
        if pattern.type in APERIODIC:
            return cls(aperiodic=True, cycles=1)
        return cls(aperiodic=False, cycles=pattern.cycles if pattern.type in CYCLIC else math.inf)
