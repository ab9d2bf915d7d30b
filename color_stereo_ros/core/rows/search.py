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
"""
The search from nothing: by how much the rows disagree where no disparity lives yet.

SIFT (Lowe 2004) finds the same points in both views, in two chromaticities: those are free of the
brightness, which differs where the surface shines. Where they give too few matches, as in gray
images, the brightness is asked, too.

"""

import cv2
import numpy as np

from .alignment import Alignment, COUNT, RowEvidence, terms
from .tuning import TUNING

ASTRAY = ('left and right image show no common points: two different scenes, two different '
          'moments, or a view that is covered or out of focus')
UPSIDE_DOWN = 'the right image is upside down as seen from the left one: turn one camera around'


def search(pair, limits, by_pattern=None):
    """
    Search a pair for the row error.

    If the points that both views show do not tell it, those tell that each view has in common
    with the pattern: the noise of the two views does not add up.

    Parameters
    ----------
    pair : RectifiedPair
        The rectified images.
    limits : (float, float)
        Smallest and largest disparity, px.
    by_pattern : callable, optional
        Returns points of a RectifiedPair in both views, see `projector.left_right_pairs`.

    Returns
    -------
    alignment : Alignment or None
        `applied` is 0. None where the images do not tell.
    sentence : str
        What was found that cannot be corrected; '' if nothing.

    """
    size = pair.geometry.width, pair.geometry.height
    found, sentence = told_by(*matches(pair), size, limits)
    if found is None and by_pattern is not None:
        left, right = by_pattern(pair)
        found = told_by(left, right, 0, size, limits)[0]
    return found, sentence if found is None else ''


def told_by(left, right, features, size, limits):
    """Return what matches tell of the rows; see `search` and `matches`."""
    tuning = TUNING.search
    if len(left) < tuning.least_matches:
        return None, ASTRAY if features >= tuning.least_features else ''
    disparity = left[:, 0] - right[:, 0]
    inside = ((disparity > limits[0] - tuning.margin) & (disparity < limits[1] + tuning.margin))
    found, agree = fit(left[inside], right[inside], size)
    count = np.count_nonzero(agree)
    if count < max(tuning.least_matches, tuning.least_share * np.count_nonzero(inside)):
        return None, about_others(left, right)
    error = terms(right[inside][agree, 0], left[inside][agree, 1], size) @ found.coefficients
    typical = float(np.median(error))
    if abs(typical) > tuning.largest_offset:
        return None, too_far(abs(typical))
    return found, ''


def fit(left, right, size):
    """
    Fit the row error to matches, some of which are wrong.

    Parameters
    ----------
    left, right : numpy.ndarray, float64, shape (N, 2)
        Column and row of the same points, px.
    size : (int, int)
        Width and height, px.

    Returns
    -------
    alignment : Alignment
    agree : numpy.ndarray, bool, shape (N,)
        Matches that agree with it.

    """
    tuning = TUNING.search
    unknown = Alignment.unknown(size)
    agree = np.zeros(len(left), bool)
    if len(left) < tuning.least_matches:
        return unknown, agree
    dy = right[:, 1] - left[:, 1]
    there = terms(right[:, 0], left[:, 1], size)
    start = np.linalg.inv(unknown.covariance)
    center = np.zeros(COUNT)
    center[0] = densest(dy, 2 * tuning.gates[0])
    for turn, gate in enumerate(tuning.gates):
        agree = np.abs(dy - there @ center) < gate
        used = 3 if turn < tuning.linear_rounds else COUNT
        rows = there[agree, :used] / tuning.match_std
        normal = rows.T @ rows + start[:used, :used]
        center = np.zeros(COUNT)
        center[:used] = np.linalg.solve(normal, rows.T @ (dy[agree] / tuning.match_std))
    agree = np.abs(dy - there @ center) < tuning.gates[-1]
    evidence = RowEvidence(right[agree, 0], left[agree, 1], dy[agree],
                           np.full(np.count_nonzero(agree), tuning.match_std),
                           left[agree, 0] - right[agree, 0])
    return unknown.but(coefficients=center, covariance=np.linalg.inv(normal), observable=True,
                       agreeing=True, evidence=evidence), agree


def densest(values, width):
    """Return the middle of the interval of this width that holds most of the values."""
    ordered = np.sort(values)
    counts = np.searchsorted(ordered, ordered + width, side='right') - np.arange(len(ordered))
    first = int(np.argmax(counts))
    return float(np.median(ordered[first:first + counts[first]]))


def matches(pair):
    """
    Return points that both views show.

    Parameters
    ----------
    pair : RectifiedPair
        The rectified images.

    Returns
    -------
    left, right : numpy.ndarray, float64, shape (N, 2)
        Column and row, px.
    features : int
        Points that the richer view shows, whether the other one has them or not.

    """
    tuning = TUNING.search
    scale = min(1.0, tuning.largest_width / pair.geometry.width)
    sift = cv2.SIFT_create(nfeatures=tuning.features)
    inside = [np.uint8(255) * _reduced(each.view(np.uint8), scale)
              for each in (pair.left_inside, pair.right_inside)]
    images = [_reduced(image, scale) for image in (pair.left, pair.right)]
    found = [_matched(sift, *both, inside) for both in zip(*map(chromaticities, images))]
    if sum(len(each[0]) for each in found) < tuning.least_matches:
        found.append(_matched(sift, *map(normalized_brightness, images), inside))
    # pixel centers: (x + .5) / scale - .5
    left, right = ((np.concatenate([each[side] for each in found]) + 0.5) / scale - 0.5
                   for side in (0, 1))
    return left, right, sum(each[2] for each in found)


def chromaticities(image):
    """Return r - g and b - (r + g) / 2 over the brightness as two images, uint8 (H, W)."""
    r, g, b = (each.astype(np.float32) for each in cv2.split(image))
    per_unit = np.float32(TUNING.search.gray) / (r + g + b + np.float32(TUNING.search.dark))
    return [cv2.convertScaleAbs(color * per_unit + np.float32(TUNING.search.middle))
            for color in (r - g, b - np.float32(0.5) * (r + g))]


def normalized_brightness(image):
    """Return the logarithm of the brightness against its surroundings, uint8 (H, W)."""
    tuning = TUNING.search
    level = cv2.log(image.astype(np.float32).sum(axis=2) + np.float32(tuning.dark))
    level -= cv2.blur(level, 2 * (tuning.surroundings,))
    steps = level * np.float32(tuning.gray) + np.float32(tuning.middle)
    return np.clip(steps, 0, 255).astype(np.uint8)


def _reduced(image, scale):
    if scale == 1:
        return image
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def _matched(sift, left, right, inside):
    """Return what `matches` does, of one chromaticity."""
    points, features = zip(*(sift.detectAndCompute(image, mask)
                             for image, mask in zip((left, right), inside)))
    count = max(map(len, points))
    if any(each is None or len(each) < 2 for each in features):
        return *np.zeros((2, 0, 2)), count
    pairs = cv2.BFMatcher().knnMatch(*features, k=2)
    good = [first for first, second in pairs
            if first.distance < TUNING.search.ratio * second.distance]
    return (np.array([points[0][each.queryIdx].pt for each in good]).reshape(-1, 2),
            np.array([points[1][each.trainIdx].pt for each in good]).reshape(-1, 2),
            count)


def about_others(left, right):
    """Return what matches tell of which the rows do not agree, as a sentence."""
    tuning = TUNING.search
    model, agree = cv2.estimateAffinePartial2D(left, right, ransacReprojThreshold=tuning.turned)
    least = max(tuning.least_matches, tuning.least_share * len(left))
    if model is None or np.count_nonzero(agree) < least:
        return ASTRAY
    if model[0, 0] < 0:
        return UPSIDE_DOWN
    error = float(np.median(np.abs((right - left)[agree.ravel() > 0, 1])))
    return too_far(error) if error > tuning.largest_offset else ''


def too_far(error):
    """Return that rows disagree by more px than can be corrected."""
    return (f'rows differ by {error:.0f} px, more than the {TUNING.search.largest_offset:.0f} px '
            'that are corrected: is it the calibration of this rig, and are the images its own?')
