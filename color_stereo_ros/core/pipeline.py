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
"""The sensor as one object: a calibrated color pair in, a range result out."""

from dataclasses import replace
from functools import cache, partial
from threading import Lock
from time import perf_counter

import numpy as np

from .arrays import Image
from .cameras.calibration import StereoCalibration
from .cameras.covariance import StereoCovariance
from .cameras.geometry import RectifiedPair
from .cameras.rectification import Rectifier
from .color_calibration import check_color, ColorCorrection, PEDESTAL, SATURATION_LEVEL
from .compiled import forget_bitcode, refuse_after_fork
from .curves import CostCurve
from .health.drift import corrected
from .health.health import Health
from .health.prior import drift_covariance
from .health.tracking import HealthTracker
from .methods import make_method
from .projector.model import ProjectorModel
from .projector.patches import Measured
from .projector.tracking import Given, Track
from .results import RangeResult
from .rows.alignment import Alignment
from .rows.estimate import resumed
from .rows.search import search
from .settings import Settings
from .status_codes import VALID
from .trackers import is_makable, tracker_of
from .triangulation import disparity_limits
from ..errors import CalibrationError, SettingsError

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
    search_at_once : bool
        Where the views of a pair do not agree anywhere, search for the rows within `process`,
        which takes up to half a second; where the projector is not known, search for it, which
        takes up to a second. False: the caller does it by `search_rows` and `adopt`, and by
        `search_projector` and `adopt_projector`.
    covariance : StereoCovariance, optional
        How exact the calibration is. Without it that of a good calibration is assumed.

    Raises
    ------
    CalibrationError, SettingsError
        If an argument has the wrong class, or depth limits, covariance or the file of
        color.calibration do not fit the calibration.
    ForkError
        If this process was forked from one that had used a ColorStereo; methods raise it, too.

    """

    def __init__(self, calibration: StereoCalibration, settings: Settings = Settings(), *,
                 rectified_input: bool = False, search_at_once: bool = True,
                 covariance: StereoCovariance | None = None) -> None:
        """Build the maps and warm the kernels."""
        refuse_after_fork()
        if not hasattr(calibration, 'geometry'):
            raise CalibrationError(f'calibration = {calibration!r} is no StereoCalibration')
        if not isinstance(settings, Settings):
            raise SettingsError(f'settings = {settings!r} is no Settings')
        self.calibration = calibration
        self.settings = settings
        self._limits = disparity_limits(calibration.geometry, settings.range)
        self._rectified_input, self._search_at_once = rectified_input, search_at_once
        colors = check_color(settings, calibration)
        self._correction = colors and ColorCorrection(colors, settings.color.saturation_level)
        prior = None if covariance is None else drift_covariance(calibration, covariance)
        self._follower = HealthTracker(calibration, rectified_input, prior)
        self._measure_as(self._follower.unknown().applied)
        self._alignment = self._projector = self._health = None
        black = np.zeros((calibration.geometry.height, calibration.geometry.width, 3), np.uint8)
        self.process(black, black)
        self._alignment = self._projector = self._health = None
        forget_bitcode()

    def _measure_as(self, applied):
        """Make maps and method for cameras that have moved by a drift, float64 (6,)."""
        calibration = self.calibration
        if applied.any():
            calibration = corrected(calibration, applied, baseline=False)
        self._rectifier = Rectifier(calibration, self._rectified_input)
        self._method = self._make_method(calibration)
        self._applied = applied

    def _make_method(self, calibration):
        settings = self.settings if self._correction is None else colors_corrected(self.settings)
        return make_method(settings, calibration, self._limits, self._rectifier)

    def rectify(self, left: Image, right: Image) -> RectifiedPair:
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

    def process(self, left: Image, right: Image, alignment: Alignment | None = None,
                projector: Track | None = None, health: Health | None = None) -> RangeResult:
        """
        Measure one pair of images.

        By default the object carries from pair to pair what it knows of the rows of the two
        views (`RangeResult.alignment`), of the projector (`RangeResult.projector`) and of the
        calibration (`RangeResult.health`).

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images, taken at the same moment; or gray ones, uint8 or uint16 (H, W). May be
            called from several threads.
        alignment : Alignment, optional
            What is known of the rows before this pair. The object then does not carry on what
            the pair shows of them.
        projector : Track, optional
            The same for the projector.
        health : Health, optional
            The same for the calibration. With all three, the result depends on the pair and these
            values only.

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
        image = cache(partial(self._rectifier.rectify_left, kept))
        with KERNELS:
            found, health = self._measure(*self._corrected(kept, right, clock), alignment,
                                          projector, health, image, clock)
        return self._result(found, image, clock, health)

    def _corrected(self, left, right, clock):
        """Return what the method measures, read only: both images, corrected by their colors."""
        if self._correction is not None:
            left, right = self._correction.apply(left, right)
            clock.lap('correct')
        return _read_only(left), _read_only(right)

    def _image_of(self, left, image):
        """Return a function that makes the rectified left image as the method sees its colors."""
        if self._correction is None:
            return image
        return cache(partial(self._rectifier.rectify_left, left))

    def process_left(self, left: Image, projector: Track | None = None) -> RangeResult:
        """
        Measure one image with left camera and projector, without the right camera.

        What is known of the colors comes from the last pair. Disparities are those that the right
        camera would see. Standard deviations grow by what the image shows of a projector that has
        moved; where it does not fit at all, no pixel has a range.

        Parameters
        ----------
        left : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB image.
        projector : Track, optional
            As in `process`; its model counts, also if the last pair did not agree with it.

        Returns
        -------
        result : RangeResult

        Raises
        ------
        ImageError
            If the image is no array, or its type or size is wrong.
        SettingsError
            If no projector is in use, see `use_projector`.

        """
        refuse_after_fork()
        track = self._projector if projector is None else projector
        if not self.may_use_projector or track is None or track.model is None:
            raise SettingsError('the projector is not known: one camera alone measures nothing')
        kept = self._rectifier.checked(left, left)[0].copy()
        image = cache(partial(self._rectifier.rectify_left, kept))
        clock = Stopwatch()
        with KERNELS:
            seen, _ = self._corrected(kept, kept, clock)
            found = self._method.measure_left(
                seen, clock, Given(track, self._image_of(seen, image), self._tracker))
            if projector is None:
                self._projector = found.projector
        return self._result(found, image, clock)

    def _result(self, found, image, clock, health=None):
        if found.views is None:
            found = replace(found, views=(found.status == VALID).view(np.uint8))
        return RangeResult(
            **vars(found), image_source=image,
            geometry=self.calibration.geometry, disparity_limits=self._limits,
            seconds=clock.seconds, health=health, planar=getattr(self._method, 'planar', False))

    def _measure(self, left, right, alignment, projector, health, image, clock):
        if not getattr(self._method, 'aligns_rows', False):
            return self._method.measure(left, right, clock), None
        before = self.health if health is None else health
        known = self._alignment if alignment is None else alignment
        if self._corrected_anew(before):
            # rows lie elsewhere now
            known = known and self._unknown().but(turn=known.turn)
        searched = partial(self._searched, left, right) if self._search_at_once else None
        given = None if not self.may_use_projector else Given(
            self._projector if projector is None else projector, self._image_of(left, image),
            self._tracker,
            self._search_at_once, partial(self._rectifier.left_patches, left))
        found = self._method.measure(left, right, clock, known, searched, given)
        after = self._follower.follow(before.but(applied=self._applied), found.alignment)
        if alignment is None:
            self._alignment = found.alignment
        if projector is None:
            self._projector = found.projector
        if health is None:
            self._health = after
        return found, None if found.alignment is None else after

    def _corrected_anew(self, health):
        """Correct the maps for what is known of the drift; return whether its rows moved."""
        applied = health.drift * 0
        if self.settings.health.correct == 'apply':
            applied = self._follower.to_apply(health)
        if not np.array_equal(applied, self._applied):
            self._measure_as(applied)
        return not np.array_equal(applied, health.applied)

    def _searched(self, left, right):
        return search(self._rectifier.rectify(left, right), self._limits,
                      self._pairs_by_pattern if self.may_use_projector else None)

    def _pairs_by_pattern(self, pair):
        return self._tracker().finder.left_right_pairs(
            pair.left, pair.right, (pair.left_inside, pair.right_inside))

    def cost_curve(self, left: Image, right: Image, pixel: tuple[int, int],
                   alignment: Alignment | None = None) -> CostCurve | None:
        """
        Search a pair once more, and return what the search knows of one pixel.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        pixel : (int, int)
            Column and row in the rectified left image.
        alignment : Alignment, optional
            `RangeResult.alignment` of the pair.

        Returns
        -------
        curve : CostCurve or None
            None: the method has no coarse search, or it has compared brightness instead.

        Raises
        ------
        ImageError
            If an image is no array, or its type or size is wrong.

        """
        refuse_after_fork()
        left, right = self._rectifier.checked(left, right)
        if not hasattr(self._method, 'curve'):
            return None
        with KERNELS:
            return self._method.curve(*self._corrected(left, right, Stopwatch()), alignment,
                                      pixel)

    def search_rows(self, left: Image, right: Image) -> Alignment:
        """
        Search a pair for the row error of the views, from nothing.

        Takes up to half a second at 640 x 480; may run beside `process` in another thread. Of
        use where `alignment.due`.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.

        Returns
        -------
        alignment : Alignment
            For `adopt`.

        Raises
        ------
        ImageError
            If an image is no array, or its type or size is wrong.

        """
        left, right = self._rectifier.checked(left, right)
        if self._correction is not None:
            with KERNELS:
                left, right = self._correction.apply(left, right)
        return resumed(self.alignment, *self._searched(left, right))

    @property
    def alignment(self) -> Alignment:
        """Return what is known of the rows before the next pair, an Alignment."""
        return self._unknown() if self._alignment is None else self._alignment

    def adopt(self, alignment: Alignment | None) -> None:
        """Carry this alignment to the next pair, instead of what the last one showed."""
        with KERNELS:
            self._alignment = alignment

    @property
    def health(self) -> Health:
        """Return what is known of the calibration before the next pair, a Health."""
        return self._follower.unknown() if self._health is None else self._health

    def adopt_health(self, health: Health | None) -> None:
        """Carry this Health to the next pair, instead of what the last one showed."""
        with KERNELS:
            self._health = health

    def reset(self) -> None:
        """Forget what is known of rows, projector and drift of the cameras."""
        with KERNELS:
            self._alignment = self._projector = self._health = None

    @property
    def may_use_projector(self) -> bool:
        """Return whether settings, pattern and method allow the projector as a third view."""
        return (getattr(self._method, 'may_use_projector', False)
                and is_makable(self.settings.pattern))

    def _tracker(self):
        return tracker_of(self.settings.pattern, self.calibration.geometry)

    @property
    def projector(self) -> Track | None:
        """Return what is known of the projector before the next pair, a Track; None: no use."""
        if not self.may_use_projector:
            return None
        return Track() if self._projector is None else self._projector

    def search_projector(self, result: RangeResult) -> Track:
        """
        Search a pair for the projector, from nothing.

        Takes up to a second at 640 x 480; may run beside `process` in another thread. Of use
        where `result.projector.due`.

        Parameters
        ----------
        result : RangeResult
            Of two views.

        Returns
        -------
        track : Track
            For `adopt_projector`.

        """
        return self._tracker().search(result.projector, Measured.of(result))

    def adopt_projector(self, track: Track | None) -> None:
        """Carry this Track to the next pair, instead of what the last one showed."""
        with KERNELS:
            self._projector = track

    def use_projector(self, model: ProjectorModel | None) -> None:
        """
        Take a projector of known geometry as a third view until `reset`; nothing is searched.

        Without effect where `may_use_projector` is False.

        Parameters
        ----------
        model : ProjectorModel or None
            None: two views measure.

        """
        self.adopt_projector(Track.known(model))

    def _unknown(self):
        geometry = self.calibration.geometry
        return Alignment.unknown((geometry.width, geometry.height))


def colors_corrected(settings):
    """Return the settings by which a method measures images of corrected colors."""
    return settings.updated({'color.dark_level': PEDESTAL,
                             'color.saturation_level': SATURATION_LEVEL})


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
        Add the time since the last lap to that of a stage, s.

        written, what the stage has written, is not read here. Recorders that take the place of a
        stopwatch keep it, for example that of `evaluation.method_pictures`.

        """
        now = perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
