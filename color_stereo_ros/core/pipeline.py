# SPDX-License-Identifier: Apache-2.0
"""The sensor as one object: a calibrated color pair in, a range result out."""

from functools import partial
from threading import Lock
from time import perf_counter

import numpy as np

from ..errors import CalibrationError, SettingsError
from .cameras.rectification import Rectifier
from .compiled import refuse_after_fork
from .methods import make_method
from .results import RangeResult
from .settings import Settings
from .triangulation import disparity_limits

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
    ForkError
        If this process was forked from one that had used a ColorStereo; methods raise it, too.

    """

    def __init__(self, calibration, settings=Settings(), *, rectified_input=False):
        """Build the maps and warm the kernels."""
        refuse_after_fork()
        if not hasattr(calibration, 'geometry'):
            raise CalibrationError(f'calibration = {calibration!r} is no StereoCalibration')
        if not isinstance(settings, Settings):
            raise SettingsError(f'settings = {settings!r} is no Settings')
        self.calibration = calibration
        self.settings = settings
        self._limits = disparity_limits(calibration.geometry, settings.range)
        self._rectifier = Rectifier(calibration, rectified_input)
        self._method = make_method(settings, calibration, self._limits, self._rectifier)
        black = np.zeros((calibration.geometry.height, calibration.geometry.width, 3), np.uint8)
        self.process(black, black)

    def rectify(self, left, right):
        """
        Rectify one pair of images.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images; or gray ones, uint8 or uint16 (H, W).

        Returns
        -------
        pair : RectifiedPair

        Raises
        ------
        ImageError
            If an image is no array, or its type or size is wrong.

        """
        refuse_after_fork()
        return self._rectifier.rectify(left, right)

    def process(self, left, right):
        """
        Measure one pair of images.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images, taken at the same moment; or gray ones, uint8 or uint16 (H, W). May be
            called from several threads.

        Returns
        -------
        result : RangeResult
            Independent of the images: they may be overwritten.

        Raises
        ------
        ImageError
            If an image is no array, or its type or size is wrong.

        """
        refuse_after_fork()
        left, right = self._rectifier.checked(left, right)
        clock = Stopwatch()
        kept = left.copy()  # the image is made when asked, and the caller may reuse its arrays
        with KERNELS:
            found = self._method.measure(_read_only(kept), _read_only(right), clock)
        return RangeResult(
            **vars(found), image_source=partial(self._rectifier.rectify_left, kept),
            geometry=self.calibration.geometry, disparity_limits=self._limits,
            seconds=clock.seconds)


def _read_only(image):
    """Return a view that kernels cannot write: they are compiled for one kind of array."""
    view = image.view()
    view.flags.writeable = False
    return view


class Stopwatch:
    """Durations of consecutive stages."""

    def __init__(self):
        """Start."""
        self.seconds = {}
        self._last = perf_counter()

    def lap(self, stage, written=None):
        """
        Record the time since the last lap, s.

        written, what the stage has written, is not read here. Recorders that take the place of a
        stopwatch keep it, for example that of `evaluation.method_pictures`.

        """
        now = perf_counter()
        self.seconds[stage] = now - self._last
        self._last = now
