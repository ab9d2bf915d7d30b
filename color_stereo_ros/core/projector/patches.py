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
"""Precise matches: patches of the image around predicted places are placed in the pattern."""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from .adjustment import Evidence
from .blurring import bands
from .patch_kernels import choose_sites, HALF, place_patches, predict_patches, SIDE
from .tuning import TUNING

REACH = HALF - 1  # of the neighbors that tell how smooth a surface is, px


@dataclass(frozen=True, eq=False)
class Sites:
    """Pixels whose surface is known well enough to predict their patch in the pattern."""

    pixels: np.ndarray
    """int32 (N, 2), column and row."""
    points: np.ndarray
    """float64 (N, 3), m, rectified left camera."""
    slopes: np.ndarray
    """float64 (N, 2, 3), m per px: how the point moves along the columns and the rows."""
    disparity_std: np.ndarray
    """float64 (N,), px."""

    def __len__(self):
        """Return the number of sites."""
        return len(self.pixels)

    def every(self, step):
        """Return one site of each `step`, the first one first."""
        return self.taken(np.s_[::step])

    def some(self, count):
        """Return so many sites, evenly chosen; all of them if there are no more."""
        if len(self) <= count:
            return self
        return self.taken(np.arange(count) * len(self) // count)

    def taken(self, which):
        """Return the sites that an index takes."""
        return Sites(*(np.ascontiguousarray(each[which]) for each in vars(self).values()))


@dataclass(frozen=True, eq=False)
class Measured:
    """What the two views measured of a pair, as a ColorStereo gives it."""

    image: np.ndarray
    """uint8 (H, W, 3), RGB, rectified left; None: patches are cut instead."""
    depth: np.ndarray
    """float32 (H, W), m, NaN = unknown."""
    disparity_std: np.ndarray
    """float32 (H, W), px, NaN = unknown."""
    confidence: np.ndarray
    """float32 (H, W), 0..1."""
    geometry: object
    """RectifiedGeometry."""
    cut: object = None
    """Called with pixels and half a width, returns patches as `Rectifier.left_patches` does."""

    def patches(self, pixels):
        """Return an image that shows patches around pixels, and where in it, int32 (N, 2)."""
        if self.cut is None or not len(pixels):
            return self.image, pixels
        centers = np.full_like(pixels, HALF)
        centers[:, 1] += SIDE * np.arange(len(pixels), dtype=pixels.dtype)
        return self.cut(pixels, HALF), centers

    @classmethod
    def of(cls, result):
        """Return that of a RangeResult."""
        return cls(result.image, result.depth, result.disparity_std, result.confidence,
                   result.geometry)

    def evidence(self, points, places, sigma, disparity_std):
        """
        Return Evidence of points with known places in the pattern.

        Parameters
        ----------
        points : numpy.ndarray, float64, shape (N, 3)
            m.
        places : numpy.ndarray, float64, shape (N, 2)
            px of the pattern.
        sigma : numpy.ndarray, float64, shape (N,)
            Standard deviation of the places, px.
        disparity_std : numpy.ndarray, float64, shape (N,)
            px, as the two views say it.

        Returns
        -------
        evidence : Evidence

        """
        tuning, g = TUNING.patches, self.geometry
        depth = points[:, 2]
        per_pixel = depth * depth / g.focal_baseline
        # pixel, from the center, in half widths
        x = 2 * points[:, 0] / depth * g.focal_x / g.width
        y = 2 * points[:, 1] / depth * g.focal_y / g.width
        modes = np.stack([x ** i * y ** j for i in range(tuning.degree + 1)
                          for j in range(tuning.degree + 1 - i)], axis=-1)
        typical = float(np.median(disparity_std)) if len(points) else 0.0
        slow = np.hypot(tuning.slow_floor, tuning.slow_share * typical)
        return Evidence(points, places, sigma, tuning.alike * per_pixel * disparity_std,
                        modes * (slow * per_pixel)[:, None])

    def points_at(self, pixels):
        """
        Return the surface points at some places between the pixels.

        Parameters
        ----------
        pixels : numpy.ndarray, float64, shape (N, 2)
            Column and row.

        Returns
        -------
        points : numpy.ndarray, float64, shape (N, 3)
            m; NaN where the depth around the place is not known or has an edge.
        disparity_std : numpy.ndarray, float64, shape (N,)
            px.

        """
        height, width = self.depth.shape
        x, y = (np.clip(np.floor(pixels[:, axis]).astype(int), 0, size - 2)
                for axis, size in ((0, width), (1, height)))
        fx, fy = pixels[:, 0] - x, pixels[:, 1] - y
        corners = [(y, x, (1 - fy) * (1 - fx)), (y, x + 1, (1 - fy) * fx),
                   (y + 1, x, fy * (1 - fx)), (y + 1, x + 1, fy * fx)]
        inverse = np.stack([1.0 / self.depth[row, column] for row, column, _ in corners])
        mean = sum(each * weight for each, (_, _, weight) in zip(inverse, corners))
        tuning = TUNING.find
        with np.errstate(invalid='ignore'):
            step = (inverse.max(axis=0) - inverse.min(axis=0)) * self.geometry.focal_baseline
            good = step < tuning.depth_step
        good &= np.all([self.confidence[row, column] > tuning.confidence
                        for row, column, _ in corners], axis=0)
        depth = np.where(good, 1.0 / mean, np.nan)
        spread = np.max([self.disparity_std[row, column] for row, column, _ in corners], axis=0)
        return self.rays(pixels) * depth[:, None], spread.astype(np.float64)

    def rays(self, pixels):
        """Return X/Z, Y/Z and 1 of pixels (N, 2), float64 (N, 3)."""
        g = self.geometry
        return np.column_stack([(pixels[:, 0] - g.center_x_left) / g.focal_x,
                                (pixels[:, 1] - g.center_y) / g.focal_y, np.ones(len(pixels))])


def site_rows(height, step):
    """Return the rows of pixels of an image of a height from which `sites` chooses, int64 (N,)."""
    return np.arange(HALF + step // 2, height - HALF, step)


@lru_cache(maxsize=8)
def lines_around(height, step):
    """Return the rows of pixels whose measurement `sites` reads, int64 (N,), read-only."""
    rows = np.unique(site_rows(height, step)[:, None] + np.array([-REACH, 0, REACH]))
    rows.flags.writeable = False  # all callers share it
    return rows


def sites(measured, step):
    """
    Choose pixels on surfaces that are smooth over a patch, spread over the image.

    Parameters
    ----------
    measured : Measured
        What two views have measured.
    step : int
        Their distance, px.

    Returns
    -------
    sites : Sites

    """
    height, width = measured.depth.shape
    rows = site_rows(height, step)
    columns = np.arange(HALF + step // 2, width - HALF, step)
    tuning, most = TUNING.patches, len(rows) * len(columns)
    scale = float(measured.geometry.focal_baseline)
    pixels, inverse = np.empty((most, 2), np.int32), np.empty((most, 5))
    count = choose_sites(_read_only(measured.depth), _read_only(measured.confidence), rows,
                         columns, REACH, scale, tuning.confidence, tuning.bend, tuning.tilt,
                         pixels, inverse)
    pixels, (here, before, after, above, below) = pixels[:count], inverse[:count].T
    # the plane in inverse depth: dZ/dx = -Z^2 dw/dx
    depth = 1 / here
    rays = measured.rays(pixels)
    slopes = np.empty((count, 2, 3))
    for axis, (one, other, focal) in enumerate(
            ((before, after, measured.geometry.focal_x), (above, below,
                                                          measured.geometry.focal_y))):
        fall = -depth ** 2 * ((other - one) / (2 * REACH))
        slopes[:, axis] = rays * fall[:, None]
        slopes[:, axis, axis] += depth / focal
    spread = measured.disparity_std[pixels[:, 1], pixels[:, 0]]
    return Sites(pixels, rays * depth[:, None], slopes, spread.astype(np.float64))


def warm():
    """Compile the kernels, so that no pair waits for them."""
    image, nothing = _read_only(np.zeros((1, 1), np.float32)), np.zeros(0, np.int64)
    choose_sites(image, image, nothing, nothing, REACH, 1.0, 0.0, 0.0, 0.0,
                 np.zeros((0, 2), np.int32), np.zeros((0, 5)))
    matrix = _read_only(np.eye(3))
    predict_patches(np.zeros((0, 3)), np.zeros((0, 2, 3)), matrix, matrix,
                    _read_only(np.zeros(3)), 0.0, np.zeros((0, 2)), np.zeros((0, 2, 2)))
    place_patches(_read_only(np.zeros((1, 1, 3), np.uint8)),
                  _read_only(np.zeros((1, 1, 2), np.float32)), np.zeros((0, 2), np.int32),
                  np.zeros((0, 2)), np.zeros((0, 2, 2)), TUNING.patches.rounds,
                  TUNING.patches.farthest, np.zeros((0, 4)))


def _read_only(image):
    """Return a contiguous view that cannot be written: the kernel is compiled for this kind."""
    view = np.ascontiguousarray(image).view()
    view.flags.writeable = False
    return view


def chromatic(pattern, blur):
    """
    Return the two chromaticities of a pattern as an image sees it.

    Parameters
    ----------
    pattern : numpy.ndarray, uint8 or float32, shape (H', W', 3)
        0..255.
    blur : float
        Standard deviation, px of the pattern.

    Returns
    -------
    colors : numpy.ndarray, float32, shape (H', W', 2)

    """
    blur = max(blur, TUNING.patches.least_blur)
    colors = np.empty((*pattern.shape[:2], 2), np.float32)
    for band in bands(len(pattern), blur):
        part = pattern[band.wide].astype(np.float32, copy=False)
        r, g, b = cv2.split(cv2.GaussianBlur(part, (0, 0), blur)[band.inner])
        share = 1 / (r + g + b + np.float32(TUNING.patches.dark))
        np.multiply(r - g, share, out=colors[band.rows, :, 0])
        np.multiply(b - np.float32(0.5) * (r + g), share, out=colors[band.rows, :, 1])
    return colors


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of the image that were looked for in the pattern."""

    places: Sites
    start: np.ndarray
    """float64 (N, 2), predicted column and row of the pattern, px."""
    result: np.ndarray
    """float64 (N, 4), see `patch_kernels.place_patches`."""
    found: np.ndarray
    """bool (N,)."""
    expected: np.ndarray
    """bool (N,), the patch should lie inside the pattern."""

    @property
    def count(self):
        """Return how many were found."""
        return int(np.count_nonzero(self.found))

    @property
    def share(self):
        """Return the share of the expected patches that were found; 0 if none is expected."""
        return np.count_nonzero(self.found & self.expected) / self.most

    @property
    def explained(self):
        """
        Return the share of the variance of their colors that the pattern explains, mean.

        Where a patch was not found it explains nothing.

        """
        return float(self.result[self.found & self.expected, 3].sum()) / self.most

    @property
    def most(self):
        """Return how many are expected, at least 1."""
        return max(np.count_nonzero(self.expected), 1)

    @property
    def shift(self):
        """Return the median distance of what was found from the predictions, px."""
        away = (self.result[:, :2] - self.start)[self.found]
        return float(np.median(np.hypot(*away.T)))

    def evidence(self, measured):
        """Return the Evidence of the patches that were found."""
        tuning, found, places = TUNING.patches, self.found, self.places
        sigma = np.hypot(tuning.correlated * self.result[found, 2], tuning.floor)
        return measured.evidence(places.points[found], self.result[found, :2], sigma,
                                 places.disparity_std[found])


def predictions(model, places):
    """
    Return where patches should lie, and how the pattern moves with the pixel there.

    Parameters
    ----------
    model : ProjectorModel
        Predicts the places.
    places : Sites
        The pixels.

    Returns
    -------
    start : numpy.ndarray, float64, shape (N, 2)
        Column and row of the pattern, px.
    shape : numpy.ndarray, float64, shape (N, 2, 2)
        Pattern px per px of the image.

    """
    start, shape = np.empty((len(places), 2)), np.empty((len(places), 2, 2))
    predict_patches(places.points, places.slopes, _read_only(model.camera_matrix),
                    _read_only(model.rotation), _read_only(model.translation),
                    float(model.distortion), start, shape)
    return start, shape


def looked_for(model, measured, colors, places, rounds=None):
    """
    Look for the patches of some sites in the pattern, near their predicted places.

    Parameters
    ----------
    model : ProjectorModel
        Predicts where to look.
    measured : Measured
        What two views have measured.
    colors : numpy.ndarray, float32, shape (H', W', 2)
        See `chromatic`.
    places : Sites
        The pixels.
    rounds : int, optional
        Of least squares; default: as in the constants.

    Returns
    -------
    patches : Patches

    """
    tuning = TUNING.patches
    result = np.full((len(places), 4), np.nan)
    start, shape = predictions(model, places)
    margin = HALF * np.abs(shape).sum(axis=2)
    last = np.array(model.size) - 1
    expected = ((start > margin) & (start < last - margin)).all(axis=1)
    image, pixels = measured.patches(places.pixels)
    place_patches(_read_only(image), _read_only(colors), pixels, start, shape,
                  rounds or tuning.rounds, tuning.farthest, result)
    found = result[:, 3] > tuning.explained  # NaN is not
    return Patches(places, start, result, found, expected)


def placed(model, measured, colors, places, rounds=None):
    """
    Measure where in the pattern the patches of some sites lie; parameters as for `looked_for`.

    Returns
    -------
    evidence : color_stereo_ros.core.projector.adjustment.Evidence
        Of the patches that were found.
    share : float
        See `Patches.share`.
    explained : float
        See `Patches.explained`.

    """
    patches = looked_for(model, measured, colors, places, rounds)
    return patches.evidence(measured), patches.share, patches.explained
