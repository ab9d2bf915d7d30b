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
"""Whether the projector is where it was, pair by pair; where it is not, it is searched."""

from dataclasses import replace
import math

import numpy as np

from .sweep import prepared_for
from .tuning import TUNING
from ...projector.patches import Measured, warm
from ...projector.tracking import aged, missed, Track
from ...status import Status
from ...status_codes import VALID


class Follower:
    """
    Carries the projector from pair to pair.

    It holds no state of the pairs: a Track is given and returned.

    Parameters
    ----------
    geometry : RectifiedGeometry
    limits : numpy.ndarray, shape (2,)
        Smallest and largest disparity, px.

    """

    def __init__(self, geometry, limits):
        """Warm the kernel."""
        self.geometry, self.limits = geometry, limits
        warm()

    def passed(self, given, reason=None):
        """Return the Track after a pair that cannot show the projector; reason: if it is known."""
        track = given.track or Track()
        return track if track.held else missed(track).but(reason=reason or track.reason)

    def followed(self, given, two):
        """
        Return the Track after a pair.

        Parameters
        ----------
        given : Given
            What is known of the projector before the pair.
        two : callable
            Returns the Measurement of the two cameras, at some rows of pixels or at all.

        Returns
        -------
        track : Track
            `usable` if the pair shows the projector, and the third view may use it.

        """
        track = given.track or Track()
        if not track.held:
            if track.model is None and not (track.due and given.search):
                return missed(track)
            tracker = given.tracker()
            if track.model is not None:
                few = two(tracker.lines(self.geometry.height))
                image = given.image() if given.cut is None else None
                track = tracker.follow(track, self.measured(few, image, given.cut))
            if track.due and given.search:
                track = tracker.search(track, self.measured(two(), given.image()))
        return self.prepared(track)

    def prepared(self, track):
        """Return the track with the model for which the pattern is straightened and blurred."""
        if not track.usable or (track.age and track.prepared is not None):  # age: the same model
            return track
        return track.but(prepared=prepared_for(track.model, track.prepared, self.geometry,
                                               self.limits))

    def measured(self, measurement, image, cut=None):
        """Return what is known of the pixels as the search takes it."""
        return Measured(image, measurement.depth, measurement.disparity_std,
                        measurement.confidence, self.geometry, cut)

    def alone(self, given, track, measurement):
        """
        Return what left camera and projector measured, with what a moved projector does to it.

        Patches of the image lie beside their epipolar lines where the projector has moved. What
        it does along the lines cannot be seen; it is about as much. With the distance e across
        the lines, px of the pattern, and the disparity per px of the pattern k:

            sigma_d' = sqrt(sigma_d^2 + (factor k e)^2)
            confidence' = confidence erf(1 px / (factor k e sqrt(2)))

        Parameters
        ----------
        given : Given
            What is known of the projector before the pair.
        track : Track
            With a model and a smoothing.
        measurement : Measurement
            Of left camera and projector.

        Returns
        -------
        measurement : Measurement
            With `projector`; without any range where the projector is not there.

        """
        tuning = TUNING.alone
        measured = self.measured(measurement, given.image())
        apart, share, gain = given.tracker().across(track, measured)
        usual = track.usual if np.isfinite(track.usual) else 1.0
        agrees = share > tuning.least_share * usual and apart < tuning.farthest
        track = track.but(agreeing=bool(agrees), share=share, shift=apart)
        if not agrees:
            return replace(nothing_of(measurement), projector=track)
        if not track.held:
            track = aged(track, float(np.nanmedian(measurement.depth)))
        extra = np.float32((tuning.factor * gain * apart) ** 2)
        return replace(measurement, projector=track,
                       disparity_std=np.sqrt(measurement.disparity_std ** 2 + extra),
                       confidence=measurement.confidence * np.float32(within(extra)))


def within(variance):
    """Return the probability of an error below 1 px under a normal distribution, px^2."""
    return math.erf(1 / math.sqrt(2 * variance)) if variance > 0 else 1.0


def nothing_of(measurement):
    """Return a Measurement of one that cannot be believed: no pixel has a range."""
    unknown = np.full_like(measurement.depth, np.nan)
    nothing = np.zeros_like(measurement.confidence)
    status = np.where(measurement.status == VALID, np.uint8(Status.IMPLAUSIBLE),
                      measurement.status)
    return replace(measurement, disparity=unknown, depth=unknown, disparity_std=unknown,
                   confidence=nothing, status=status, views=np.zeros_like(status))
