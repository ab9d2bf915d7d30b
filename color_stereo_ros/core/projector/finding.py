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
"""The search for the projector, from nothing: one pair is enough."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from .adjustment import (
    adjust, carried_prior, FREEDOMS, loosened, predicted, to_unknowns, usual_prior)
from .colors import color_map
from .features import left_right_pairs, PatternFeatures
from .model import ProjectorModel
from .patches import chromatic, placed, predictions, sites, warm
from .starting import starts
from .tuning import TUNING


class Reason(Enum):
    """Why there is a geometry, or none; the value is a sentence for people."""

    FOUND = 'projector found'
    STILL = 'projector not found: the left image shows too little: dark, covered or out of focus'
    SMOOTH = ('projector not found: the pattern of the settings has too few structures to be '
              'recognized in two dimensions')
    ABSENT = ('projector not found: the left image does not show the pattern of the settings; '
              'does the projector show it, and are pattern.type, size, feature_size and seed '
              'its own?')
    MIRRORED = ('projector not found: the pattern is mirrored; switch off rear projection in the '
                'menu of the projector')
    PLAIN = ('projector not found: the images do not show the colors of the pattern; their '
             'brightness is matched instead')
    BLIND = 'projector not found: too few ranges where the pattern was recognized'
    APART = ('projector not found: no single projector explains the matches; are there two, or '
             'is a picture of the pattern in the scene?')
    TWICE = ('projector not found: the pattern appears twice; is there a second projector, or a '
             'picture of the pattern?')
    PICTURE = ('projector not found: the pattern is seen on one plane only, and other light '
               'around it; is it a picture of the pattern?')
    FLAT = ('projector not found: the scene is too flat to tell where the projector stands; show '
            'it surfaces at different distances once')


@dataclass(frozen=True, eq=False)
class Finding:
    """What a search has found."""

    model: ProjectorModel | None
    """None unless reason is FOUND."""
    reason: Reason
    matches: int = 0
    """SIFT matches of the left image with the pattern."""
    with_depth: int = 0
    """Those of them whose surface point is known."""
    smoothing: float = float('nan')
    """
    Blur of the pattern by which it looks like the image, standard deviation, px of the pattern.

    NaN where no patches were placed.
    """

    def sentence(self):
        """Return what was found as one sentence."""
        return self.reason.value if self.model is None else self.model.sentence()


class ProjectorFinder:
    """
    Finds the projector that shows a known pattern.

    Parameters
    ----------
    pattern : numpy.ndarray, uint8, shape (H', W', 3)
        RGB, as `make_pattern` gives it; its colors never come again.
    size : (int, int)
        Width and height of the rectified images, px.

    """

    def __init__(self, pattern, size):
        """Compute the features of the pattern and warm the kernel."""
        warm()
        self.pattern = pattern
        self.size = pattern.shape[1], pattern.shape[0]
        self.features = PatternFeatures(pattern, size)

    def find(self, measured, inside=None, earlier=None):
        """
        Search one pair.

        Parameters
        ----------
        measured : Measured
            What the two views measured.
        inside : numpy.ndarray, bool, shape (H, W), optional
            Pixels of the left image to look at.
        earlier : ProjectorModel, optional
            The geometry of an earlier pair. Its lens is expected; the projector may have moved.

        Returns
        -------
        finding : Finding

        """
        if self.features.count < TUNING.find.least_features:
            return Finding(None, Reason.SMOOTH)
        matches = self.features.matched(measured.image, inside)
        if len(matches) < TUNING.find.least_matches:
            return Finding(None, self._why(matches, measured.image, inside), len(matches))
        evidence = self._evidence(matches, measured)
        counts = len(matches), len(evidence)
        if len(evidence) < TUNING.find.least_matches:
            return Finding(None, Reason.BLIND, *counts)
        depth = float(np.median(evidence.points[:, 2]))
        rough, prior = self._roughly(evidence, depth, earlier)
        reason = self._doubt(rough, evidence, matches, depth)
        if reason is not None:
            return Finding(None, reason, *counts)
        where = sites(measured, TUNING.find.spacing)
        where = where.every(len(where) // TUNING.find.most_sites + 1)
        found, evidence, smoothing = self._precisely(rough, evidence, measured, where, prior)
        found = self._freer(found, evidence, prior)
        found = replace(found, model=found.model.but(
            covariance=TUNING.find.unmodeled ** 2 * found.model.covariance))
        reason = self._late_doubt(found, evidence, measured, where, earlier)
        if reason is not None:
            return Finding(None, reason, *counts, smoothing)
        matrix, quality = color_map(found.model, measured, self.pattern,
                                    evidence.only(found.agree))
        model = found.model.but(residual=self._residual(found, evidence), color_map=matrix,
                                color_quality=quality)
        return Finding(model, Reason.FOUND, *counts, smoothing)

    def left_right_pairs(self, left, right, insides=(None, None)):
        """Return points that both views show, by way of the pattern; see `features`."""
        return left_right_pairs(left, right, self.features, insides)

    def _why(self, matches, image, inside):
        """Return why an image has too few matches."""
        dark = np.quantile(image, TUNING.find.brightest) < TUNING.find.dark
        if dark or matches.features < TUNING.find.least_features:
            return Reason.STILL
        flipped = np.ascontiguousarray(image[:, ::-1])
        mask = None if inside is None else np.ascontiguousarray(inside[:, ::-1])
        if len(self.features.matched(flipped, mask)) >= TUNING.find.least_matches:
            return Reason.MIRRORED
        return Reason.ABSENT

    def _doubt(self, rough, evidence, matches, depth):
        """Return why the fit of matches is not to be believed, None if it is."""
        if rough is None:
            return Reason.ABSENT
        tuning = TUNING.find
        agree = np.count_nonzero(rough.agree)
        if (agree < max(tuning.least_matches, tuning.least_share * len(evidence))
                or self._residual(rough, evidence) > tuning.largest_residual):
            by_chance = agree < tuning.least_matches + tuning.chance * matches.features
            return Reason.ABSENT if by_chance else Reason.APART
        if from_behind(rough.model, evidence.points[rough.agree]):
            return Reason.MIRRORED
        return Reason.TWICE if self._second(rough, evidence, depth) else None

    def _late_doubt(self, found, evidence, measured, where, earlier):
        """Return why the fit of patches is not to be believed, None if it is."""
        tuning = TUNING.find
        if np.mean(found.agree) < tuning.least_share:
            return Reason.APART
        if not known_elsewhere(found.model, evidence.points):
            return Reason.FLAT
        if (earlier is None and planar(evidence.points, measured.geometry)
                and lit_beyond(found.model, measured, where) > tuning.beyond_share):
            return Reason.PICTURE
        return None

    def _evidence(self, matches, measured):
        """Return the matches whose surface point is known."""
        points, spread = measured.points_at(matches.pixels)
        good = np.isfinite(points).all(axis=1) & np.isfinite(spread)
        sigma = np.full(np.count_nonzero(good), TUNING.find.match_std / self.features.scale)
        return measured.evidence(points[good], matches.places[good], sigma, spread[good])

    def _roughly(self, evidence, depth, earlier):
        """Return the best fit of matches, None if they fit nothing, and the prior it needs."""
        tuning = TUNING.find
        chosen = evidence
        if len(evidence) > TUNING.start.most:
            chosen = evidence.only(np.random.default_rng(TUNING.start.seed).choice(
                len(evidence), TUNING.start.most, replace=False))
        usual = usual_prior(self.size, depth)
        prior = usual if earlier is None else carried_prior(earlier, depth)
        models = list(starts(chosen, self.size, earlier))
        if not models:
            return None, prior
        tried = [adjust(start, chosen, prior, tuning.trial_rounds) for start in models]
        best = min(tried, key=fitness)
        if earlier is None:
            for kind in ('stretched', 'keystoned'):
                loose = loosened(prior, kind)
                freer = min((adjust(start, chosen, loose, tuning.trial_rounds)
                             for start in (best.model, models[-1])), key=fitness)
                if fitness(best) - fitness(freer) > self._least_gain(chosen):
                    best, prior = freer, loose
        found = adjust(best.model, evidence, prior)
        if earlier is not None:
            other = adjust(found.model, evidence, usual, scale=found.scale)
            if found.cost - other.cost > self._least_gain(evidence):
                return other, usual  # another lens
        return found, prior

    def _precisely(self, rough, evidence, measured, where, prior):
        """Return the fit of patches, its evidence and smoothing; those of matches if it fails."""
        tuning = TUNING.find
        if len(where) < tuning.least_patches:
            return rough, evidence, float('nan')
        found, near = rough, 0
        for _ in range(tuning.repeats):
            smoothing, colors, near = self.blurred(found.model, measured, where, near)
            fresh = placed(found.model, measured, colors, where)[0]
            if len(fresh) < tuning.least_patches:
                return rough, evidence, float('nan')
            found = adjust(found.model, fresh, prior)
        return found, fresh, smoothing

    def blurred(self, model, measured, where, near=0):
        """
        Return the smoothing by which the pattern looks like the image, and its colors then.

        Parameters
        ----------
        model : ProjectorModel
            Geometry of the projector.
        measured : Measured
            What two views have measured.
        where : Sites
            The places that are compared.
        near : int
            Number of the blur that was best for a geometry nearby; 0: unknown.

        Returns
        -------
        smoothing : float
            Standard deviation, px of the pattern.
        colors : numpy.ndarray, float32, shape (H', W', 2)
        best : int
            Number of the best of the blurs that were tried.

        """
        some = where.every(len(where) // TUNING.find.blur_sites + 1)
        areas = np.abs(np.linalg.det(predictions(model, some)[1]))
        per_pixel = float(np.sqrt(np.median(areas[np.isfinite(areas)])))
        blurs = np.array(TUNING.find.blurs)

        def share(at):
            return placed(model, measured, chromatic(self.pattern, blurs[at] * per_pixel), some)[2]

        first = max(near - 1, 0)
        shares = until_it_falls(share, range(first, len(blurs)))
        if first and not np.argmax(shares):  # the best may lie before
            first, shares = 0, until_it_falls(share, range(len(blurs)))
        best = int(np.argmax(shares))
        blur = blurs[first + best]
        if 0 < best < len(shares) - 1:
            around = np.log(blurs[first + best - 1:first + best + 2])
            blur = np.exp(vertex(around, shares[best - 1:best + 2]))
        return (float(blur * per_pixel), chromatic(self.pattern, blur * per_pixel), first + best)

    def _freer(self, found, evidence, prior):
        """Return a fit whose lens distorts or whose pixels are not square if evidence asks."""
        tuning = TUNING.find
        for kind in FREEDOMS:
            freer = loosened(prior, kind)
            other = adjust(found.model, evidence, freer, scale=found.scale)
            least = tuning.column_gain if kind == 'cropped' else self._least_gain(evidence)
            if found.cost - other.cost > least:
                found, prior = adjust(other.model, evidence, freer), freer
        return found

    def _second(self, found, evidence, depth):
        """Return whether matches that do not agree form a second image of the pattern."""
        rest = evidence.only(~found.agree)
        if len(rest) < max(TUNING.find.least_matches,
                           TUNING.find.second_share * len(evidence)):
            return False
        prior = usual_prior(self.size, depth)
        for start in starts(rest, self.size):
            other = adjust(start, rest, prior, TUNING.find.trial_rounds, scale=found.scale)
            if np.mean(other.agree) > TUNING.find.second_agree:
                return True
        return False

    @staticmethod
    def _least_gain(evidence):
        return max(TUNING.find.least_gain, TUNING.find.gain * len(evidence))

    @staticmethod
    def _residual(found, evidence):
        """Return the median distance of the matches that agree, px of the pattern; inf: none."""
        if not found.agree.any():
            return float('inf')
        error = np.column_stack(found.model.project(evidence.points)) - evidence.places
        return float(np.median(np.hypot(*error[found.agree].T)))


def until_it_falls(function, arguments):
    """Return the values of a function, up to the first that is below one before it."""
    values = []
    for each in arguments:
        values.append(function(each))
        if values[-1] < max(values):
            break
    return values


def vertex(x, y):
    """Return the vertex of the parabola through three points."""
    steps, slopes = np.diff(x), np.diff(y) / np.diff(x)
    bend = (slopes[1] - slopes[0]) / (x[2] - x[0])
    return (x[0] + x[1]) / 2 - slopes[0] / (2 * bend) if steps.all() and bend else x[1]


def fitness(adjusted):
    """Return the cost of a fit so that fits of different scales can be compared."""
    return adjusted.cost + len(adjusted.agree) * np.log(adjusted.scale ** 2)


def from_behind(model, points):
    """Return whether a model lights points from behind, as a mirrored pattern seems to do."""
    from_projector = points - model.center
    return bool(np.median(np.einsum('ni,ni->n', points, from_projector)) < 0)


def planar(points, geometry):
    """Return whether points (N, 3), m, lie on one plane as well as disparities can tell."""
    rays = points / points[:, 2:3]
    disparity = geometry.focal_baseline / points[:, 2]
    plane = np.linalg.lstsq(rays, disparity, rcond=None)[0]
    apart = np.abs(disparity - rays @ plane)
    return bool(np.quantile(apart, TUNING.find.most) < TUNING.find.plane)


def lit_beyond(model, measured, where):
    """Return the share of the sites that are lit though the pattern does not reach them."""
    if not len(where):
        return 0.0
    light = measured.image[where.pixels[:, 1], where.pixels[:, 0]].sum(axis=1)
    u, v = model.project(where.points)
    inside = (u > -0.5) & (v > -0.5) & (u < model.size[0] - 0.5) & (v < model.size[1] - 0.5)
    if not inside.any():
        return 1.0
    bright = light > TUNING.find.bright * np.median(light[inside])
    return float(np.mean(bright & ~inside))


def known_elsewhere(model, points):
    """
    Return whether predictions are known at other depths than those of the evidence.

    A geometry that a flat scene has shown may predict that scene well and no other.

    Parameters
    ----------
    model : ProjectorModel
        Geometry of the projector.
    points : numpy.ndarray, float64, shape (N, 3)
        m, the evidence.

    Returns
    -------
    known : bool

    """
    return prediction_std(model, points) < TUNING.find.known


def prediction_std(model, points):
    """Return the standard deviation of places at depths beyond those of points, px."""
    near, far = np.quantile(points[:, 2], (0.25, 0.75))
    beyond = TUNING.find.beyond
    some = points[::len(points) // 50 + 1]
    covariance = to_unknowns(model)
    spread = 0.0
    for depth in ((1 - beyond) * near, (1 + beyond) * far):
        there = some / some[:, 2:3] * depth
        jacobian = predicted(model, there)[1]
        variance = np.einsum('nij,jk,nik->n', jacobian, covariance, jacobian)
        spread = max(spread, float(np.sqrt(np.median(variance))))
    return spread
