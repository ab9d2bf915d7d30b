# SPDX-License-Identifier: Apache-2.0
"""Search over all disparities in pixels, for what color alone does not tell."""

import math

import cv2
import numpy as np

from ..compiled import BANDS
from .coarse import Seeds
from .grid import whole
from .grid_kernels import F4, PAD, SILENT_VARIANCE
from .search_kernels import intervals, search_rows, WINDOW
from .texture_kernels import local_colors


class TextureSearch:
    """
    Semi-global matching of the half grid, on colors with evened-out brightness.

    The coarse search knows colors of 4 x 4 pixels and more: fine texture is lost in them. The
    columns of the right view are pixels: disparities of whole nodes are wrong beside depth edges
    more often. A color counts by itself and by its gradient along the row.

    Parameters
    ----------
    grid : HalfGrid
    limits : (float, float)
        Smallest and largest disparity, px.
    tuning : Tuning
    arena : Arena

    """

    def __init__(self, grid, limits, tuning, arena):
        """Allocate what the search writes."""
        self.grid, self.tuning = grid, tuning.brightness
        self.least_share = tuning.views.least_inside_share
        columns = 2 * grid.columns
        self.first = math.floor(max(limits[0], 1 - columns))
        last = math.ceil(min(limits[1], columns - 1))
        self.count = self.taken(last - self.first + 1)
        most = self.count
        rows = (BANDS, 5, grid.columns, most), (BANDS, grid.columns + 2, most)
        self.scratch = [arena.empty(shape, np.int16).reshape(-1) for shape in
                        (*rows, (BANDS, grid.columns + 2, most + 2))]
        self.numbers = arena.empty((BANDS, 2, grid.columns), np.int32)

    def taken(self, count):
        """Return the number of disparities that are searched in place of a count."""
        return whole(max(count, 1), self.tuning.disparity_step)

    def search(self, views, gray):
        """
        Search one pair.

        Parameters
        ----------
        views : Views
            Before `BrightnessCarrier.replace_colors`.
        gray : bool
            There are no colors to compare.

        Returns
        -------
        seeds : Seeds
            Of the half grid.

        """
        channels = 1 if gray else 3
        images = [self.image(view, channels) for view in (views.left, views.right)]
        first, count = self.first, self.count
        if count > self.tuning.many_disparities:
            first, count = self.narrowed(images)
        found = self.searched(images, first, count)
        place = F4(2) * np.arange(found.shape[1], dtype=F4) - found
        found[(place < 0) | (place > images[1].shape[1] - 1)] = np.nan  # the border, repeated
        return Seeds(found * F4(0.5), 1, None, 0.0)

    def searched(self, images, first, count):
        """
        Return the disparities of the nodes of a pair, float32 (rows, nodes), NaN = unknown.

        Parameters
        ----------
        images : (numpy.ndarray, numpy.ndarray), uint8, (rows, nodes, C), (rows, 2 nodes, C)
        first, count : int
            Smallest disparity and number of them, columns of the right image.

        """
        rows, nodes, channels = images[0].shape
        right = images[1]
        beside = max(0, first + count) + 1, max(0, -first) + 1  # left and right of the image
        mirrored = cv2.copyMakeBorder(cv2.flip(right, 1), 0, 0, beside[1], beside[0],
                                      cv2.BORDER_REPLICATE)
        cap = self.tuning.gradient_cap
        left = carriers_of(images[0], F4(0.5), cap)
        low = carriers_of(np.atleast_3d(mirrored), F4(-1), cap)
        high = np.empty_like(low)
        intervals(low.copy(), low, high)
        start = beside[1] + right.shape[1] - 1 + first
        penalties = (np.int16(each * channels * WINDOW) for each in self.tuning.penalties)
        shapes = (5, nodes, count), (nodes + 2, count), (nodes + 2, count + 2)
        scratch = [each[:BANDS * math.prod(shape)].reshape(BANDS, *shape)
                   for each, shape in zip(self.scratch, shapes)]
        found = np.empty((rows, nodes), F4)
        search_rows(left, low, high, start, first, right.shape[1] - 1, *penalties, found,
                    *scratch, self.numbers)
        return found

    def narrowed(self, images):
        """
        Return the first disparity and the number of those at which a small pair shows surfaces.

        Tiny surfaces do not count, nor places that match by chance, as dark ones do.

        """
        tuning, shrinking = self.tuning, self.tuning.shrinking
        small = [np.ascontiguousarray(np.atleast_3d(cv2.resize(
            each, tuple(max(2, size // shrinking) for size in each.shape[1::-1]),
            interpolation=cv2.INTER_AREA))) for each in images]
        small[1] = small[1][:, :2 * small[0].shape[1]]
        first, count = self.first // shrinking, self.taken(self.count // shrinking + 1)
        found = self.searched(small, first, count)
        found[~(likeness(small, found, tuning.alike_window) > tuning.least_alike)] = np.nan
        drop_small_surfaces(found, tuning.least_surface)
        kept = np.sort(found[np.isfinite(found)])
        if not kept.size:
            return self.first, self.count
        beyond = int(tuning.beyond_share * kept.size)
        margin = tuning.disparity_margin
        low = max(self.first, math.floor(shrinking * kept[beyond]) - margin)
        high = min(self.first + self.count - 1,
                   math.ceil(shrinking * kept[-1 - beyond]) + margin)
        return low, self.taken(high - low + 1)

    def image(self, view, channels):
        """Return the colors of a view, one row per node, uint8 (rows, columns, channels)."""
        tuning, step = self.tuning, view.columns_per_node
        across = 1 + 2 * (tuning.surroundings * step // 2), tuning.surroundings
        mean = cv2.blur(view.s, across) / np.maximum(
            cv2.blur(view.inside.astype(F4), across), F4(self.least_share))
        nodes, columns = self.grid.nodes
        out = np.empty((nodes, columns * step, channels), np.uint8)
        local_colors(view.u, view.v, view.s, mean, PAD, PAD if step == 1 else 0, F4(tuning.offset),
                     F4(tuning.level), out)
        return out


def carriers_of(image, scale, cap):
    """
    Return the gradients along the rows and a quarter of the colors, int16 (2 C, h, w).

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (h, w, C)
    scale : float
        Factor of the gradients (Sobel), which are cut off at cap.
    cap : int

    """
    h, w, channels = image.shape
    out = np.empty((2 * channels, h, w), np.int16)
    for channel, plane in enumerate(cv2.split(image)):
        gradient = cv2.Sobel(plane, cv2.CV_16S, 1, 0, scale=float(scale))
        np.clip(gradient, -cap, cap, out=out[2 * channel])
        np.right_shift(plane, 2, out=out[2 * channel + 1], casting='unsafe')
    return out


def likeness(images, disparity, window):
    """
    Return how alike two images are around the matches, float32 (h, w), -1 .. 1.

    The normalized cross-correlation of windows; NaN where there is no match. Places without
    contrast are not alike.

    Parameters
    ----------
    images : (numpy.ndarray, numpy.ndarray), uint8, shapes (h, w, C) and (h, 2 w, C)
    disparity : numpy.ndarray, float32, shape (h, w)
        Columns of the right image, NaN = unknown.
    window : int
        Width and height of the windows, px.

    """
    nodes, columns = disparity.shape[1], images[1].shape[1]
    known = np.isfinite(disparity)
    place = 2 * np.arange(nodes) - np.where(known, np.rint(disparity), 0).astype(np.int64)
    np.clip(place, 0, columns - 1, out=place)
    left = images[0].astype(F4)
    right = np.take_along_axis(images[1], place[..., None], axis=1).astype(F4)
    size = (window, window)
    means = [cv2.blur(each, size).reshape(each.shape) for each in (left, right)]

    def covariance(one, other):
        pairs = (left, right)
        product = np.einsum('yxc,yxc->yx', pairs[one], pairs[other])
        return cv2.blur(product, size) - np.einsum('yxc,yxc->yx', means[one], means[other])

    quantization = F4(1)  # DN^2: rounding alone has no contrast
    return np.where(known, covariance(0, 1) / np.sqrt(
        (covariance(0, 0) + quantization) * (covariance(1, 1) + quantization)), F4(np.nan))


def drop_small_surfaces(disparity, size):
    """Write NaN into a disparity, float32 (h, w), where a surface has at most `size` px."""
    unknown = np.iinfo(np.int16).min
    steps = 16  # of a px: cv2.filterSpeckles takes int16
    fixed = np.where(np.isfinite(disparity), np.rint(disparity * F4(steps)), unknown)
    fixed = fixed.astype(np.int16)
    cv2.filterSpeckles(fixed, unknown, size, steps)
    disparity[fixed == unknown] = np.nan


def detail(carriers, tuning):
    """
    Return how much more than noise some carriers change around each node.

    Parameters
    ----------
    carriers : list of (numpy.ndarray, numpy.ndarray)
        Values and variances at the nodes, float32 (rows, columns).
    tuning : BrightnessTuning

    Returns
    -------
    detail : numpy.ndarray, float32, shape (rows, columns)
        Mean over the surroundings of the squared change to the next node over its variance, of
        the carrier that changes most; 1 where the noise of the camera model is all there is.

    """
    size = 2 * tuning.detail_radius + 1
    most = np.zeros(carriers[0][0].shape, F4)
    for plane, spread in carriers:
        change = plane[:, 1:] - plane[:, :-1]
        found = np.zeros(most.shape, F4)
        np.divide(change * change, spread[:, 1:] + spread[:, :-1], out=found[:, 1:])
        np.maximum(most, cv2.blur(found, (size, size)), out=most)
    return most


def colors_of(views):
    """Return the chromaticities of the left view at the nodes as carriers, see `detail`."""
    inner, left = views.grid.inner, views.left
    return [(each[inner], left.variance[inner]) for each in (left.u, left.v)]


def colors_show(views, tuning):
    """Return whether the colors of most lit nodes of the left view change by more than noise."""
    lit = views.left.variance[views.grid.inner] < SILENT_VARIANCE
    found = detail(colors_of(views), tuning.brightness)[lit]
    return bool(found.size and np.median(found) > tuning.repetition.least_color_detail)
