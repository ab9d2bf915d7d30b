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
Matches of images with the pattern, from nothing.

SIFT (Lowe 2004) finds the same colors in an image and in the pattern, in two chromaticities.

"""

from itertools import product

import cv2
import numpy as np

from .tuning import TUNING


class PatternFeatures:
    """
    The features of a pattern, computed once.

    Parameters
    ----------
    pattern : numpy.ndarray, uint8, shape (H', W', 3)
        RGB, as `make_pattern` gives it.
    size : (int, int)
        Width and height of the images that will be matched, px.

    """

    def __init__(self, pattern, size):
        height, width = pattern.shape[:2]
        self.pattern = pattern
        self.scale = min(1.0, np.sqrt(size[0] * size[1] / (width * height)))
        small = _reduced(pattern, self.scale)
        self._found = [_described(image, None, self.scale) for image in chromaticities(small)]

    @property
    def count(self):
        """Return the number of features of the pattern."""
        return sum(len(places) for places, _ in self._found)

    def matched(self, image, inside=None):
        """
        Return which features of the pattern an image shows, and where.

        Parameters
        ----------
        image : numpy.ndarray, uint8, shape (H, W, 3)
            RGB.
        inside : numpy.ndarray, bool, shape (H, W), optional
            Where to look.

        Returns
        -------
        matches : Matches

        """
        mask = None if inside is None else np.uint8(255) * inside.astype(np.uint8)
        scale = min(1.0, TUNING.matching.largest_width / image.shape[1])
        small = _reduced(image, scale)
        mask = None if mask is None else _reduced(mask, scale)
        pixels, places, names, first, features = [], [], [], 0, 0
        for gray, (known, descriptors) in zip(chromaticities(small), self._found):
            seen, described = _described(gray, mask, scale, TUNING.matching.features)
            one, other = nearest(described, descriptors)
            pixels.append(seen[one])
            places.append(known[other])
            names.append(first + other)
            first += len(known)
            features += len(seen)
        return Matches(np.concatenate(pixels), np.concatenate(places), np.concatenate(names),
                       features)


class Matches:
    """
    Places in an image and in the pattern that show the same.

    Parameters
    ----------
    pixels : numpy.ndarray, float64, shape (N, 2)
        Column and row in the image, px.
    places : numpy.ndarray, float64, shape (N, 2)
        Column and row in the pattern, px.
    names : numpy.ndarray, int, shape (N,)
        Number of the pattern's feature.
    features : int
        Features of the image, matched or not.

    """

    def __init__(self, pixels, places, names, features):
        self.pixels, self.places, self.names = pixels, places, names
        self.features = features

    def __len__(self):
        """Return the number of matches."""
        return len(self.pixels)


def left_right_pairs(left, right, features, insides=(None, None)):
    """
    Return points that both views show, found by way of the pattern.

    Needs neither rows that agree nor a disparity: the surest start where stereo has died.

    Parameters
    ----------
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        RGB, rectified.
    features : PatternFeatures
        Of the pattern as it is projected.
    insides : pair of numpy.ndarray, bool, shape (H, W), or None
        Where to look in each view.

    Returns
    -------
    left, right : numpy.ndarray, float64, shape (N, 2)
        Column and row, px. Some are wrong.

    """
    one, other = (features.matched(image, inside)
                  for image, inside in zip((left, right), insides))
    _, first, second = np.intersect1d(one.names, other.names, return_indices=True)
    return one.pixels[first], other.pixels[second]


def chromaticities(image):
    """
    Return r - g and b - (r + g) / 2 over the brightness, stretched to a usual contrast.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    Returns
    -------
    grays : list of two numpy.ndarray, uint8, shape (H, W)

    """
    tuning = TUNING.matching
    r, g, b = (each.astype(np.float32) for each in cv2.split(image))
    light = r + g + b
    share = 1 / (light + np.float32(tuning.dark))
    lit = light > tuning.lit * light.mean()
    grays = []
    for color in ((r - g) * share, (b - np.float32(0.5) * (r + g)) * share):
        some = color[lit][::tuning.every]
        spread = max(float(some.std()), tuning.colorless) if some.size else 1.0
        middle = float(some.mean()) if some.size else 0.0
        gain = tuning.spread / spread
        grays.append(cv2.convertScaleAbs(
            np.maximum(gain * (color - np.float32(middle)) + np.float32(tuning.middle), 0)))
    return grays


def nearest(one, other):
    """
    Return which descriptors pass the ratio test (Lowe 2004).

    Parameters
    ----------
    one, other : numpy.ndarray, float32, shape (N, 128) and (M, 128)
        Descriptors of two images.

    Returns
    -------
    first, second : numpy.ndarray, int, shape (K,)
        Of `one`, and the nearest to it of `other`.

    """
    if len(one) < 1 or len(other) < 2:
        return np.zeros((2, 0), int)
    squares = np.einsum('ij,ij->i', other, other)
    found = [_nearest(part, other, squares) for part in np.array_split(
        one, -(-len(one) // TUNING.matching.compared))]
    good, best = map(np.concatenate, zip(*found))
    return np.flatnonzero(good), best[good]


def _nearest(one, other, squares):
    """Return which of `one` pass the ratio test, bool, and the nearest of `other`."""
    # |a - b|^2 = a.a + b.b - 2 a.b: a product of matrices is faster than the loops of a matcher
    apart = one @ other.T
    apart *= -2
    apart += squares
    rows = np.arange(len(one))
    best = np.argmin(apart, axis=1)
    own = np.einsum('ij,ij->i', one, one)
    least = apart[rows, best] + own
    apart[rows, best] = np.inf
    return least < TUNING.matching.ratio ** 2 * (apart.min(axis=1) + own), best


def _described(image, mask, scale, most=0):
    """
    Return the places of features, px of the image before it was reduced; and descriptors.

    most: how many, those of the largest contrast; 0: all. SIFT takes 230 bytes for a pixel, and
    so sees one tile of the image after the other. A tile reaches into its neighbors, for the blur
    of the largest features, but a feature belongs to the tile that it lies in.

    """
    tuning = TUNING.matching
    sift = cv2.SIFT_create(nfeatures=most, contrastThreshold=tuning.contrast)
    found = [(np.zeros((0, 2)), np.zeros((0, 128), np.float32), np.zeros(0))]
    for y, x in product(*(_spans(length) for length in image.shape)):
        inner = np.array([(x.start, y.start), (x.stop, y.stop)]) - 0.5
        wide = tuple(slice(max(each.start - tuning.seam, 0), each.stop + tuning.seam)
                     for each in (y, x))
        points, descriptors = sift.detectAndCompute(image[wide],
                                                    None if mask is None else mask[wide])
        if descriptors is None:
            continue
        places = np.array([point.pt for point in points]) + (wide[1].start, wide[0].start)
        own = ((places >= inner[0]) & (places < inner[1])).all(axis=1)
        found.append((places[own], descriptors[own],
                      np.array([point.response for point in points])[own]))
    places, descriptors, contrast = map(np.concatenate, zip(*found))
    if most and len(places) > most:
        best = np.sort(np.argpartition(-contrast, most)[:most])
        places, descriptors = places[best], descriptors[best]
    return (places + 0.5) / scale - 0.5, descriptors


def _spans(length):
    """Return the slices of about equal length, about `tile` at most, that make up a length."""
    count, unit = -(-length // TUNING.matching.tile), TUNING.matching.unit
    # SIFT halves images by leaving out pixels: the same ones in each tile
    ends = [round(length * k / count / unit) * unit for k in range(count)] + [length]
    return [slice(*span) for span in zip(ends, ends[1:])]


def _reduced(image, scale):
    if scale == 1:
        return image
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
