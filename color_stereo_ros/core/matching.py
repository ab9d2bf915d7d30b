# SPDX-License-Identifier: Apache-2.0
"""The choice of the matching method."""

import numpy as np

from .paper import PaperMatcher
from .surface import SurfaceMethod
from .triangulation import depth_from_disparity
from .types import Match, Measurement, Status


def make_method(settings, calibration, limits, rectifier):
    """
    Return the method that settings.matching.method names.

    Parameters
    ----------
    settings : Settings
    calibration : StereoCalibration
    limits : (float, float)
        Smallest and largest disparity, px.
    rectifier : Rectifier

    Returns
    -------
    method : object
        With `measure(left, right, clock)`: raw images (checked, uint8 (H, W, 3) RGB) and a
        Stopwatch in, Measurement out.

    """
    if settings.matching.method == 'paper':
        return PaperMethod(settings, calibration, limits, rectifier)
    return SurfaceMethod(settings, calibration, limits, rectifier.rectified_input)


class PaperMethod:
    """The paper's steps: rectify, correct and search, triangulate."""

    def __init__(self, settings, calibration, limits, rectifier):
        """Allocate the search."""
        self._rectifier = rectifier
        self._limits = limits
        self._matcher = PaperMatcher(settings, calibration.geometry, limits)

    def measure(self, left, right, clock):
        """Measure one pair; see `make_method`."""
        pair = self._rectifier.rectify(left, right)
        clock.lap('rectify')
        match = within_limits(self._matcher.match(pair), self._limits)
        clock.lap('match')
        depth = depth_from_disparity(match.disparity, pair.geometry)
        clock.lap('triangulate')
        return Measurement(**vars(match), depth=depth)


def within_limits(match, limits):
    """
    Take the range from matches outside the disparity limits (paper, sec. 2.2: global limits).

    Parameters
    ----------
    match : Match
    limits : (float, float)
        Smallest and largest disparity, px.

    Returns
    -------
    match : Match
        Status OUT_OF_RANGE and no disparity outside the limits.

    """
    smallest, largest = np.float32(limits[0]), np.float32(limits[1])
    outside = (match.disparity < smallest) | (match.disparity > largest)
    if not outside.any():
        return match
    nothing = np.float32(np.nan)
    return Match(disparity=np.where(outside, nothing, match.disparity),
                 disparity_std=np.where(outside, nothing, match.disparity_std),
                 confidence=np.where(outside, np.float32(0), match.confidence),
                 status=np.where(outside, np.uint8(Status.OUT_OF_RANGE), match.status))
