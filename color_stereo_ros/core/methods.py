# SPDX-License-Identifier: Apache-2.0
"""The choice of the matching method."""

from .paper.method import PaperMatcher
from .results import Measurement
from .surface.method import SurfaceMethod
from .triangulation import depth_from_disparity


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
        self._matcher = PaperMatcher(settings, calibration.geometry, limits)

    def measure(self, left, right, clock):
        """Measure one pair; see `make_method`."""
        pair = self._rectifier.rectify(left, right)
        clock.lap('rectify')
        match = self._matcher.match(pair)
        clock.lap('match')
        depth = depth_from_disparity(match.disparity, pair.geometry)
        clock.lap('triangulate')
        return Measurement(**vars(match), depth=depth)
