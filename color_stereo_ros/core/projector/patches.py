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

import cv2
import numpy as np

from .adjustment import Evidence
from .patch_kernels import HALF, place_patches, SIDE
from .blurring import bands
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
        """Return every so manyth site."""
        return Sites(*(each[::step] for each in vars(self).values()))


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


def lines_around(height, step):
    """Return the rows of pixels whose measurement `sites` reads, int64 (N,), ascending."""
    rows = site_rows(height, step)[:, None] + np.array([-REACH, 0, REACH])
    return np.unique(rows)


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
    y, x = (each.ravel() for each in np.meshgrid(rows, columns, indexing='ij'))
    reach = REACH
    inverse = [1.0 / measured.depth[y + dy, x + dx].astype(np.float64)
               for dy, dx in ((0, 0), (0, -reach), (0, reach), (-reach, 0), (reach, 0))]
    here, before, after, above, below = inverse
    scale = measured.geometry.focal_baseline
    with np.errstate(invalid='ignore'):
        smooth = [np.abs(one + other - 2 * here) * scale < TUNING.patches.bend
                  for one, other in ((before, after), (above, below))]
        tilt = [np.abs(other - one) * scale < 2 * reach * TUNING.patches.tilt
                for one, other in ((before, after), (above, below))]
        trusted = measured.confidence[y, x] > TUNING.patches.confidence
    good = smooth[0] & smooth[1] & tilt[0] & tilt[1] & trusted
    x, y, here = x[good], y[good], here[good]
    pixels = np.column_stack([x, y]).astype(np.int32)
    # the plane in inverse depth: dZ/dx = -Z^2 dw/dx
    depth = 1 / here
    rays = measured.rays(pixels)
    slopes = np.empty((len(x), 2, 3))
    for axis, (one, other, focal) in enumerate(
            ((before, after, measured.geometry.focal_x), (above, below,
                                                          measured.geometry.focal_y))):
        fall = -depth ** 2 * ((other - one)[good] / (2 * reach))
        slopes[:, axis] = rays * fall[:, None]
        slopes[:, axis, axis] += depth / focal
    return Sites(pixels, rays * depth[:, None], slopes,
                 measured.disparity_std[y, x].astype(np.float64))


def warm():
    """Compile the kernel, so that no pair waits for it."""
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


def affines(model, places):
    """Return how the pattern moves with the pixel at some sites, float64 (N, 2, 2)."""
    points, slopes = places.points[:, None], places.slopes
    ends = np.stack(model.project(np.concatenate([points + slopes, points - slopes], axis=1)), -2)
    return (ends[..., :2] - ends[..., 2:]) / 2


def placed(model, measured, colors, places, rounds=None):
    """
    Measure where in the pattern the patches of some sites lie.

    Parameters
    ----------
    model : ProjectorModel
        Predicts where to look.
    measured : Measured
        What two views have measured.
    colors : numpy.ndarray, float32, shape (H', W', 2)
        See `chromatic`.
    places : Sites
        The predicted places.
    rounds : int, optional
        Of least squares; default: as in the constants.

    Returns
    -------
    evidence : color_stereo_ros.core.projector.adjustment.Evidence
        Of the patches that were found.
    share : float
        Of the sites whose patch should lie inside the pattern, that were found; 0 if there are
        none.
    explained : float
        Share of the variance of their colors that the pattern explains, mean; where a patch was
        not found it explains nothing.

    """
    tuning = TUNING.patches
    result = np.full((len(places), 4), np.nan)
    start = np.column_stack(model.project(places.points))
    shape = affines(model, places)
    margin = HALF * np.abs(shape).sum(axis=2)
    last = np.array(model.size) - 1
    expected = ((start > margin) & (start < last - margin)).all(axis=1)
    image, pixels = measured.patches(places.pixels)
    place_patches(_read_only(image), _read_only(colors), pixels,
                  np.ascontiguousarray(start), np.ascontiguousarray(shape),
                  rounds or tuning.rounds, tuning.farthest, result)
    explained = np.nan_to_num(result[:, 3])
    found = explained > tuning.explained
    sigma = np.hypot(tuning.correlated * result[found, 2], tuning.floor)
    evidence = measured.evidence(places.points[found], result[found, :2], sigma,
                                 places.disparity_std[found])
    count = max(np.count_nonzero(expected), 1)
    share = np.count_nonzero(found & expected) / count
    return evidence, share, float(explained[found & expected].sum()) / count
