# SPDX-License-Identifier: Apache-2.0
"""The sensor as one object: a calibrated color pair in, a range result out."""

from threading import Lock
from time import perf_counter

import numpy as np

from .matching import make_matcher
from .rectification import Rectifier
from .settings import Settings
from .triangulation import depth_from_disparity, disparity_limits
from .types import CalibrationError, Match, RangeResult, SettingsError, Status

# The kernels own their buffers and numba's threading layers do not all allow parallel calls.
KERNELS = Lock()


class ColorStereo:
    """
    Range images from pairs of color images.

    Maps are built and kernels are warm when the constructor returns.

    Parameters
    ----------
    calibration : StereoCalibration
    settings : Settings
    rectified_input : bool
        The images arrive rectified already: only P of the calibration is used.

    Raises
    ------
    CalibrationError, SettingsError
        If an argument has the wrong class, or the depth limits do not fit the calibration.

    """

    def __init__(self, calibration, settings=Settings(), *, rectified_input=False):
        """Build the maps and warm the kernels."""
        if not hasattr(calibration, 'geometry'):
            raise CalibrationError(f'calibration = {calibration!r} is no StereoCalibration')
        if not isinstance(settings, Settings):
            raise SettingsError(f'settings = {settings!r} is no Settings')
        self.calibration = calibration
        self.settings = settings
        self._limits = disparity_limits(calibration.geometry, settings.range)
        self._rectifier = Rectifier(calibration, rectified_input)
        self._matcher = make_matcher(settings, calibration.geometry, self._limits)
        black = np.zeros((calibration.geometry.height, calibration.geometry.width, 3), np.uint8)
        self.process(black, black)

    def rectify(self, left, right):
        """
        Rectify one pair of images.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.

        Returns
        -------
        pair : RectifiedPair

        Raises
        ------
        ImageError
            If an image is no array, or its type or size is wrong.

        """
        return self._rectifier.rectify(left, right)

    def process(self, left, right):
        """
        Measure one pair of images.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images, taken at the same moment. May be called from several threads.

        Returns
        -------
        result : RangeResult

        Raises
        ------
        ImageError
            If an image is no array, or its type or size is wrong.

        """
        clock = Stopwatch()
        pair = self.rectify(left, right)
        clock.lap('rectify')
        with KERNELS:
            match = self._matcher.match(pair)
        clock.lap('match')
        match = within_limits(match, self._limits)
        depth = depth_from_disparity(match.disparity, pair.geometry)
        clock.lap('triangulate')
        return RangeResult(
            disparity=match.disparity, depth=depth, confidence=match.confidence,
            status=match.status, disparity_std=match.disparity_std, image=pair.left,
            geometry=pair.geometry, disparity_limits=self._limits, seconds=clock.seconds)


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


class Stopwatch:
    """Durations of consecutive stages."""

    def __init__(self):
        """Start."""
        self.seconds = {}
        self._last = perf_counter()

    def lap(self, stage):
        """Record the time since the last lap, s."""
        now = perf_counter()
        self.seconds[stage] = now - self._last
        self._last = now
