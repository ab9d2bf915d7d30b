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
"""The projector from pair to pair: carried, followed, found again."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from .adjustment import (
    adjust, carried_prior, free_prior, moved, predicted, robust_scale, State, to_parameters,
    to_unknowns)
from .finding import Reason
from .model import COUNT, ProjectorModel
from .patches import chromatic, lines_around, looked_for, placed, sites
from .tuning import TUNING

UNEXPLAINED = ', but the colors of the pattern do not explain the image: two views measure'


@dataclass(frozen=True, eq=False)
class Track:
    """What is known of the projector before the next pair; immutable."""

    model: ProjectorModel | None = None
    """None: no pair has shown it yet. Else that of the last pair that agreed."""
    smoothing: float = float('nan')
    """See `Finding.smoothing`."""
    agreeing: bool = False
    """Whether the last pair shows the projector where the model says."""
    share: float = float('nan')
    """Share of the patches of the last pair that were found near their predicted places."""
    usual: float = float('nan')
    """What this share is in pairs that agree: shadows and a cropped pattern lower it."""
    age: int = 0
    """Pairs since the model was brought up to date."""
    shift: float = float('nan')
    """Median distance of these patches from their predicted places, px of the pattern."""
    reason: Reason | None = None
    """What the last search has found; None: there was none."""
    wait: int = 0
    """Pairs that do not agree before the next search."""
    tries: int = 0
    """Searches without success since the projector was seen."""
    held: bool = False
    """The caller knows the projector, or that there is none: nothing is searched or followed."""
    explains: bool = True
    """Whether the colors of the pattern explain the last pair; if not, two views measure it."""
    prepared: ProjectorModel | None = None
    """The model for which the third view has blurred the pattern; a new one if that is far off."""

    @classmethod
    def known(cls, model: ProjectorModel | None) -> Self:
        """Return a track that holds a model as it is; None: two views only."""
        return cls(model, agreeing=model is not None, held=True)

    @property
    def due(self) -> bool:
        """Return whether a search may help: the projector is not where the model says."""
        return not self.held and not self.agreeing and self.wait == 0

    @property
    def usable(self) -> bool:
        """Return whether the projector takes part in the pair."""
        return self.agreeing and self.model is not None

    def sentence(self) -> str:
        """Return what people should know of the projector, as one sentence."""
        if self.agreeing:
            return self.model.sentence() + ('' if self.explains else UNEXPLAINED)
        if self.held:
            return 'two views measure: the projector is switched off as a third view'
        if self.reason not in (None, Reason.FOUND):
            return self.reason.value
        return 'projector not found yet' if self.model is None else (
            'projector lost: it was moved, is dark, or shows something else')

    def but(self, **changes: Any) -> 'Track':
        """Return this track with some fields replaced."""
        return replace(self, **changes)


@dataclass(frozen=True, eq=False)
class Given:
    """What a caller brings for the projector of one pair."""

    track: Track | None
    """What is known before the pair; None: nothing."""
    image: object
    """Called without arguments, returns the rectified left image, uint8 (H, W, 3)."""
    tracker: object
    """Called without arguments, returns the ProjectorTracker; the first call takes a moment."""
    search: bool = False
    """Search within the pair; False: the caller searches beside the pairs."""
    cut: object = None
    """Cuts patches of the rectified left image, see `Measured.cut`; None: the image is made."""

    def pattern(self):
        """Return what the projector shows, uint8 (H', W', 3)."""
        return self.tracker().finder.pattern


class ProjectorTracker:
    """
    Carries the geometry of the projector from pair to pair.

    It holds no state of the pairs: a Track is given and returned.

    Parameters
    ----------
    finder : ProjectorFinder

    """

    def __init__(self, finder):
        """Keep the finder."""
        self.finder = finder
        self._smooth = None, None

    def follow(self, track, measured):
        """
        Compare a pair with the geometry; takes about two milliseconds.

        The model is brought up to date at some pairs only: at those whose patches have moved, and
        at regular intervals.

        Parameters
        ----------
        track : Track
            What is known of the projector before the pair.
        measured : Measured
            What two views have measured.

        Returns
        -------
        track : Track
            Not `agreeing` where the pair does not show the projector at its place, or shows too
            little. Its model is then that of the last pair that agreed.

        """
        if track.model is None or not np.isfinite(track.smoothing):
            return missed(track)
        tuning = TUNING.track
        where = sites(measured, tuning.spacing)
        where = where.every(len(where) // tuning.most_sites + 1)
        if len(where) < tuning.least_patches:
            return missed(track)
        colors, age = self._colors(track.smoothing), track.age + 1
        if age < tuning.refresh:
            few = looked_for(track.model, measured, colors, where.some(tuning.watched),
                             tuning.rounds)
            share = few.share
            usual = track.usual if np.isfinite(track.usual) else share
            if few.count >= tuning.least_patches and share >= tuning.least_share * usual:
                shift = few.shift
                if shift < tuning.restless * track.model.residual:
                    return self._agreeing(track, track.model, share, shift, age)
        evidence, share, _ = placed(track.model, measured, colors, where, tuning.rounds)
        usual = track.usual if np.isfinite(track.usual) else share
        if len(evidence) < tuning.least_patches or share < tuning.least_share * usual:
            return missed(track.but(share=share))
        shift = apart_from(track.model, evidence)
        if shift > max(tuning.bump, 2 * track.model.residual):
            model = again(track.model, evidence)
        else:
            model = updated(track.model, evidence, age)
        return self._agreeing(track, model, share, shift, 0)

    @staticmethod
    def _agreeing(track, model, share, shift, age):
        """Return the track after a pair that agrees."""
        usual = track.usual if np.isfinite(track.usual) else share
        usual += TUNING.track.learning * (share - usual)
        return track.but(model=model, age=age, agreeing=True, share=share, usual=usual,
                         shift=shift, wait=0, tries=0)

    @staticmethod
    def lines(height):
        """Return the rows of pixels whose measurement `follow` reads, int64 (N,), ascending."""
        return lines_around(height, TUNING.track.spacing)

    def search(self, track, measured, inside=None):
        """
        Search a pair from nothing; takes up to a second, of use where `track.due`.

        Parameters
        ----------
        track : Track
            What is known of the projector before the pair.
        measured : Measured
            What two views have measured.
        inside : numpy.ndarray, bool, shape (H, W), optional
            Pixels of the left image to look at.

        Returns
        -------
        track : Track

        """
        found = self.finder.find(measured, inside, track.model)
        if found.model is None or not np.isfinite(found.smoothing):
            # without patches there is nothing that later pairs could be compared with
            reason = Reason.BLIND if found.reason is Reason.FOUND else found.reason
            tries = track.tries + 1
            return track.but(reason=reason, agreeing=False, tries=tries,
                             wait=min(2 ** tries, TUNING.track.largest_wait))
        return Track(found.model, found.smoothing, True, reason=found.reason)

    def across(self, track, measured):
        """
        Return how far patches lie off their epipolar lines, where the projector gave the depth.

        A depth from left camera and projector always explains the way along the line. A smooth
        field is fitted to the ways across: those of single patches are noise.

        Parameters
        ----------
        track : Track
            With a model.
        measured : Measured
            What two views have measured.

        Returns
        -------
        apart : float
            Root mean square of the field, px of the pattern; inf where there are too few patches.
        share : float
            Of the patches that were found near their predicted places.
        gain : float
            Disparity per px of the pattern along the lines, median.

        """
        tuning = TUNING.track
        where = sites(measured, tuning.spacing)
        where = where.every(len(where) // tuning.most_sites + 1)
        if len(where) < tuning.least_patches or not np.isfinite(track.smoothing):
            return float('inf'), 0.0, 0.0
        evidence, share, _ = placed(track.model, measured, self._colors(track.smoothing), where,
                                    tuning.rounds)
        if len(evidence) < tuning.least_patches:
            return float('inf'), share, 0.0
        places, _, along, _ = predicted(track.model, evidence.points)
        length = np.hypot(*along.T)
        error = evidence.places - places
        across = (error[:, 0] * along[:, 1] - error[:, 1] * along[:, 0]) / length
        depth = evidence.points[:, 2]
        # dZ/dd = Z^2 / (f B)
        gain = measured.geometry.focal_baseline / (length * depth ** 2)
        rays = evidence.points / depth[:, None]
        inner = np.abs(across) < 3 * np.median(np.abs(across))
        field = rays @ np.linalg.lstsq(rays[inner], across[inner], rcond=None)[0]
        return float(np.sqrt(np.mean(field ** 2))), share, float(np.median(gain))

    def _colors(self, smoothing):
        if self._smooth[0] != smoothing:
            self._smooth = smoothing, chromatic(self.finder.pattern, smoothing)
        return self._smooth[1]


def missed(track):
    """Return a track after a pair that does not show the projector at its place."""
    return track.but(agreeing=False, wait=max(track.wait - 1, 0))


def apart_from(model, evidence):
    """Return the median distance of evidence from its predicted places, px of the pattern."""
    error = np.column_stack(model.project(evidence.points)) - evidence.places
    return float(np.median(np.hypot(*error.T)))


def again(model, evidence):
    """Return the geometry of a projector that has moved a little: its lens is the same."""
    depth = float(np.median(evidence.points[:, 2]))
    fresh = adjust(model, evidence, carried_prior(model, depth)).model
    return fresh.but(covariance=TUNING.find.unmodeled ** 2 * fresh.covariance,
                     residual=apart_from(fresh, evidence), color_map=model.color_map,
                     color_quality=model.color_quality)


def updated(model, evidence, pairs=1):
    """
    Return a model after the evidence of one more pair; pairs: since the last evidence.

    Covariance intersection: with weight w of what was known, 1 - w of the evidence,

        information = w I_known + (1 - w) I_pair

    This is honest however much the errors of the pairs are alike, as those of a scene at rest.

    """
    state = State.of(evidence, model)
    width = robust_scale(state.residual)
    normal, moment = state.equations(width, free_prior())
    # the modes of the depth are eliminated: Schur complement
    mixed, inner = normal[:COUNT, COUNT:], normal[COUNT:, COUNT:]
    gain = np.linalg.solve(inner, np.column_stack([mixed.T, moment[COUNT:]]))
    pair = normal[:COUNT, :COUNT] - mixed @ gain[:, :COUNT]
    right = moment[:COUNT] - mixed @ gain[:, COUNT]
    depth = float(np.median(evidence.points[:, 2]))
    known = np.linalg.inv(drifted(to_unknowns(model), depth, pairs))
    choices = [weight * known + (1 - weight) * pair for weight in TUNING.track.weights]
    best = int(np.argmax([np.linalg.slogdet(each)[1] for each in choices]))
    covariance = np.linalg.inv(choices[best])
    fresh = moved(model, covariance @ ((1 - TUNING.track.weights[best]) * right))
    convert = to_parameters(fresh)
    return fresh.but(covariance=convert @ covariance @ convert.T, matches=len(evidence),
                     residual=apart_from(fresh, evidence), color_map=model.color_map,
                     color_quality=model.color_quality)


def aged(track, depth):
    """Return a track whose model has not been seen for one more pair; depth: of the scene, m."""
    convert = to_parameters(track.model)
    spread = drifted(to_unknowns(track.model), depth)
    return track.but(model=track.model.but(covariance=convert @ spread @ convert.T))


def drifted(covariance, depth, pairs=1):
    """Return the covariance of unknowns after some more pairs."""
    drift = TUNING.track.drift
    return covariance + pairs ** 2 * np.diag(np.square([drift] * 9 + [drift * depth] * 3))
