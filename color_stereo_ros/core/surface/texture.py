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
"""Search over all disparities in pixels, for what color alone does not tell."""

import math

import cv2
import numpy as np

from .coarse import Seeds
from .grid import whole
from .grid_kernels import F4, PAD, SILENT_VARIANCE
from .texture_kernels import local_colors


class TextureSearch:
    """
    OpenCV's semi-global matcher on rows of the half grid, on colors with evened-out brightness.

    The coarse search knows colors of 4 x 4 pixels and more: fine texture is lost in them. The
    columns are those of the right view, pixels: disparities of whole nodes are wrong beside depth
    edges more often. The left view has means between its nodes.

    Parameters
    ----------
    grid : HalfGrid
    limits : (float, float)
        Smallest and largest disparity, px.
    tuning : Tuning

    """

    def __init__(self, grid, limits, tuning):
        """Prepare the matchers of gray and of color images."""
        self.grid, self.tuning = grid, tuning.brightness
        self.least_share = tuning.views.least_inside_share
        self.columns = 2 * grid.columns
        self.first = math.floor(max(limits[0], 1 - self.columns))
        last = math.ceil(min(limits[1], self.columns - 1))
        self.count = self.taken(last - self.first + 1)
        self.compared = None

    def taken(self, count):
        """Return the number of disparities that OpenCV's matchers take in place of a count."""
        return whole(max(count, 1), self.tuning.disparity_step)

    def matcher(self, channels, count):
        """Return OpenCV's matcher for images of 1 or 3 channels and so many disparities."""
        tuning = self.tuning
        small, large = (penalty * channels * tuning.block ** 2 for penalty in tuning.penalties)
        return cv2.StereoSGBM_create(
            minDisparity=0, numDisparities=count, blockSize=tuning.block, P1=small,
            P2=large, disp12MaxDiff=tuning.agreement, preFilterCap=tuning.gradient_cap,
            uniquenessRatio=0, speckleWindowSize=0, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY)

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
        plain, evened = (self.images(views, gray, even) for even in (False, True))
        first, count = self.first, self.count
        if count > self.tuning.many_disparities:
            first, count = self.narrowed(evened)
        matcher = self.matcher(channels, count)
        found, alike = more_alike(plain, *(matched(matcher, images, first, count)[:, ::2]
                                           for images in (plain, evened)), self.tuning)
        share = float(np.mean(alike > F4(self.tuning.alike)))
        self.compared = self.at_nodes(plain)
        return Seeds(found * F4(0.5), 1, None, 0.0, alike_share=share, likeness=alike)

    def finds_more(self, found, planes):
        """
        Return whether a search finds clearly more of what is alike in a pair than planes do.

        Parameters
        ----------
        found : Seeds
            Of the last search.
        planes : PlaneField
            The disparities of their nodes are compared.

        """
        left, right = self.compared
        others = likeness((left, right), planes.d[self.grid.inner], self.tuning.compared_window,
                          2, thinned=True)
        gain = np.mean(np.nan_to_num(found.likeness)) - np.mean(np.nan_to_num(others))
        return bool(gain > self.tuning.least_better)

    def narrowed(self, images):
        """
        Return the first disparity and the number of those at which a small pair shows surfaces.

        Tiny surfaces do not count, nor places that match by chance, as dark and hidden ones do.

        """
        tuning, shrinking = self.tuning, self.tuning.shrinking
        rows, columns = images[0].shape[:2]
        size = max(1, columns // shrinking), max(1, rows * 2 // shrinking)
        small = [cv2.resize(each, size, interpolation=cv2.INTER_AREA).reshape(
            *size[::-1], each.shape[2]) for each in images]
        first, count = self.first // shrinking, self.taken(self.count // shrinking + 1)
        found = matched(self.matcher(small[0].shape[2], count), small, first, count)
        found[~(likeness(small, found, tuning.alike_window) > tuning.least_alike)] = np.nan
        drop_small_surfaces(found, tuning.least_surface)
        kept = shrinking * np.sort(found[np.isfinite(found)])
        if not kept.size:
            return self.first, self.count
        beyond, margin = int(tuning.beyond_share * kept.size), tuning.disparity_margin
        low = max(self.first, math.floor(kept[beyond]) - margin)
        high = min(self.first + self.count - 1, math.ceil(kept[-1 - beyond]) + margin)
        return low, self.taken(high - low + 1)

    def plain(self, views):
        """Return the colors of a pair as they are, see `Contest.hold`."""
        left, right = (self.colors(view, 3, False) for view in (views.left, views.right))
        return left, self.as_wide_as_the_view(right)

    def at_nodes(self, images):
        """Return both images: the left one of nodes, the right one as wide as its view."""
        left, right = images
        return np.ascontiguousarray(left[:, ::2]), self.as_wide_as_the_view(right)

    def as_wide_as_the_view(self, right):
        """Return the right image without what lies beyond its view."""
        return np.ascontiguousarray(right[:, :self.grid.width - 1])

    def images(self, views, gray, even):
        """Return the images of both views, see `image`; gray: of one channel."""
        return [self.image(view, 1 if gray else 3, even) for view in (views.left, views.right)]

    def image(self, view, channels, even):
        """
        Return the colors of a view, one row per node, uint8 (rows, 2 columns, channels).

        See `colors`; where they are those of nodes, means lie between them.

        """
        out = self.colors(view, channels, even)
        return out if view.columns_per_node > 1 else between_nodes(out)

    def colors(self, view, channels, even):
        """
        Return the colors of a view at its columns, one row per node, uint8 (rows, n, channels).

        even: their brightness is that against the surroundings.

        """
        tuning, step = self.tuning, view.columns_per_node
        if even:
            across = 1 + 2 * (tuning.surroundings * step // 2), tuning.surroundings
            mean = cv2.blur(view.s, across) / np.maximum(
                cv2.blur(view.inside.astype(F4), across), F4(self.least_share))
            mean, level = mean + F4(tuning.offset), tuning.level
        else:
            mean, level = np.full(view.s.shape, F4(3)), 1.0
        nodes, columns = self.grid.nodes
        out = np.empty((nodes, columns * step, channels), np.uint8)
        local_colors(view.u, view.v, view.s, mean, PAD, PAD if step == 1 else 0, F4(level), out)
        return out


def matched(matcher, images, first, count):
    """
    Return the disparities of a pair, float32 (h, w), NaN = unknown.

    Borders are repeated, so that no place lacks disparities.

    Parameters
    ----------
    matcher : cv2.StereoMatcher
        Of count disparities from 0 on.
    images : (numpy.ndarray, numpy.ndarray), uint8, shape (h, w, C)
        Left and right, reduced.
    first, count : int
        Smallest disparity and number of them, columns.

    """
    columns = images[0].shape[1]
    left_at = max(count, -first)
    right_at = left_at + first
    width = max(left_at, right_at) + columns
    raw = matcher.compute(*(
        cv2.copyMakeBorder(image, 0, 0, at, width - at - columns, cv2.BORDER_REPLICATE)
        for image, at in zip(images, (left_at, right_at))))[:, left_at:left_at + columns]
    found = raw.astype(F4) * F4(1 / 16) + F4(first)
    found[raw < 0] = np.nan
    return found


def more_alike(images, plain, evened, tuning):
    """
    Return the disparities of two searches of a pair as one, and how alike their windows are.

    Where one search finds clearly more of what is alike in the whole pair, its matches count, but
    at nodes where the windows of the other one are clearly more alike. Otherwise those of the
    evened search count: pieces of a search that is no better win by chance. What the plain one
    has alone must then be alike.

    Parameters
    ----------
    images : (numpy.ndarray, numpy.ndarray), uint8, shape (h, w, C)
        Plain ones.
    plain, evened : numpy.ndarray, float32, shape (h, w / 2)
        At every second column of the left image; see `likeness`.
    tuning : BrightnessTuning
        Window of the comparison, and how clear a difference must be.

    Returns
    -------
    found, likeness : numpy.ndarray, float32, shape (h, w / 2)

    """
    first, second = (likeness(images, each, tuning.compared_window, 2) for each in (plain, evened))
    better = np.mean(np.nan_to_num(first)) - np.mean(np.nan_to_num(second))
    lone = np.isnan(second)
    if abs(better) > tuning.least_better:
        chosen = lone | (first > second + F4(math.copysign(tuning.clearly_alike, -better)))
    else:
        chosen = lone & (first > F4(tuning.least_alike_alone))
    return np.where(chosen, plain, evened), np.where(chosen, first, second)


def likeness(images, disparity, window, step=1, thinned=False):
    """
    Return how alike two images are around the matches, float32 (h, w / step), -1 .. 1.

    The normalized cross-correlation of the colors in windows; NaN where there is no match.
    Places without contrast are not alike.

    Parameters
    ----------
    images : (numpy.ndarray, numpy.ndarray), uint8, shape (h, w, C)
        Left and right, reduced.
    disparity : numpy.ndarray, float32, shape (h, w / step)
        Columns of the right image, NaN = unknown.
    window : int
        Width and height of the windows, places.
    step : int
        Columns of the right image per place, and of the left one.
    thinned : bool
        The left image has a column per place.

    """
    known = np.isfinite(disparity)
    place = step * np.arange(disparity.shape[1]) - np.where(known, np.rint(disparity), 0).astype(
        np.int32)
    np.clip(place, 0, images[1].shape[1] - 1, out=place)
    left, right = images
    left = (left if thinned else left[:, ::step]).astype(F4)
    right = np.take_along_axis(right, place[..., None], axis=1).astype(F4)

    def covariance(one, other, *means):
        mean = cv2.blur(one * other, (window, window)).reshape(one.shape)
        return (mean - means[0] * means[1]).sum(axis=2)

    left_mean, right_mean = (cv2.blur(each, (window, window)).reshape(each.shape)
                             for each in (left, right))
    quantization = F4(left.shape[2])  # DN^2: rounding alone has no contrast
    spreads = [np.maximum(covariance(each, each, mean, mean), quantization)
               for each, mean in ((left, left_mean), (right, right_mean))]
    alike = covariance(left, right, left_mean, right_mean) / np.sqrt(spreads[0] * spreads[1])
    return np.where(known, alike, F4(np.nan))


def drop_small_surfaces(disparity, size):
    """Write NaN into a disparity, float32 (h, w), where a surface has at most `size` px."""
    unknown = np.iinfo(np.int16).min
    steps = 16  # of a px: cv2.filterSpeckles takes int16
    fixed = np.where(np.isfinite(disparity), np.rint(disparity * F4(steps)), F4(unknown))
    fixed = fixed.astype(np.int16)
    cv2.filterSpeckles(fixed, unknown, size, steps)
    disparity[fixed == unknown] = np.nan


def between_nodes(image):
    """Return an image with a mean column between two columns, uint8 (rows, 2 columns, C)."""
    rows, columns, channels = image.shape
    out = np.repeat(image, 2, axis=1)
    out[:, 1:-1:2] = cv2.addWeighted(image[:, :-1], 0.5, image[:, 1:], 0.5, 0).reshape(
        rows, columns - 1, channels)
    return out


def detail(carriers, tuning):
    """
    Return how much more than noise some carriers change around each node.

    Parameters
    ----------
    carriers : list of (numpy.ndarray, numpy.ndarray)
        Values and variances at the nodes, float32 (rows, columns).
    tuning : BrightnessTuning
        Constants of this stage.

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


def details_show(brightness, colors, tuning, quiet=True):
    """
    Return whether most nodes have detail.

    Photographs may be far less noisy than the camera model. So brightness has detail, too, if it
    stands out at nearly all nodes of the quietest ones, which show the noise of the pair.

    Parameters
    ----------
    brightness, colors : numpy.ndarray, float32, shape (N,)
        Detail of lit nodes, see `detail`; without colors 0.
    tuning : BrightnessTuning
        Constants of this stage.
    quiet : bool
        The pair may be quieter than the camera model.

    """
    if not brightness.size:
        return False
    found = np.maximum(brightness, colors)
    if np.mean(found >= F4(tuning.least_detail)) > tuning.detailed_share:
        return True
    return quiet and clear_share(brightness, tuning) > tuning.clear_share


def clear_share(brightness, tuning):
    """Return the share of lit nodes whose detail, float32 (N,), is clearly above the quietest."""
    if not brightness.size:
        return 0.0
    quietest = max(np.quantile(brightness, tuning.quietest), tuning.least_noise)
    return float(np.mean(brightness > F4(tuning.clear_detail * quietest)))


def colors_of(views):
    """Return the chromaticities of the left view at the nodes as carriers, see `detail`."""
    inner, left = views.grid.inner, views.left
    return [(each[inner], left.variance[inner]) for each in (left.u, left.v)]


def color_detail(views, tuning):
    """Return the median detail of the colors of the lit nodes of the left view, see `detail`."""
    lit = views.left.variance[views.grid.inner] < SILENT_VARIANCE
    found = detail(colors_of(views), tuning.brightness)[lit]
    return float(np.median(found)) if found.size else 0.0
