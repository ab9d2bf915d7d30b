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
The colors of one camera on its half grid.

Where the nodes of a half grid (see `grid_kernels`) lie in the raw image of a camera, which point
spread they have, and their colors.

"""

from functools import cached_property
import math
from types import SimpleNamespace

import cv2
import numpy as np

from .gains import channel_gains
from .grid import framed_area
from .grid_kernels import F4, PAD, SILENT_VARIANCE
from .moving import MovedRows
from .raw_faults import Looker, LUMA, quantization, without_hot_pixels
from .view_kernels import average_alike, box_sums, channel_levels, sample_colors
from ..cameras.rectification import inside_image, raw_coordinates
from ..compiled import BANDS

ROOT12 = F4(2 * math.sqrt(3.0))


class Views:
    """
    The colors of both cameras on their half grids.

    Parameters
    ----------
    calibration : StereoCalibration
    grid : HalfGrid
    settings : Settings
    tuning : Tuning
    rectified_input : bool
        The images arrive rectified already.
    arena : Arena

    Attributes
    ----------
    left, right : View
        The right one has one column per pixel, so that a disparity is sampled finely.
    psf : numpy.float32
        Variance of the point spread that all nodes share, px^2; 0 switches foreshortening off.
    noise_weight : numpy.float32
        Of the pair in force, see `raw_faults.noise_weight`.
    compressed : bool
        The chroma of a view of the pair in force is subsampled.
    evened : float
        Blur that was evened out in the pair in force, px^2, see `even.apply`.
    common_blur : float
        Blur of both views of the pair in force, px^2; 0 where one of them is sharp.
    raised : bool
        The colors of both views of the pair in force were faint, see `raise_faint_colors`.
    contrasts : (float, float)
        Lower and higher contrast of the colors of both views of the pair in force as loaded; 0
        where it is not known. Only measured under aperiodic patterns.
    quantization : float
        Of the last such pair, DN, see `raw_faults.quantization`.

    """

    def __init__(self, calibration, grid, settings, tuning, rectified_input, arena):
        """Build the maps of both cameras and make their point spreads alike."""
        self.looker = Looker(calibration.left.height, calibration.left.width, tuning)
        margin, raw, unlike, tuning = tuning.rows.margin, tuning.raw, tuning.unlike, tuning.views
        self.grid, self.settings, self.tuning, self.raw = grid, settings, tuning, raw
        self.unlike = unlike
        rows, columns = grid.nodes
        self.left = View(calibration.left, rows, columns, 2, grid.shape, rectified_input,
                         tuning, arena)
        self.right = View(calibration.right, rows, grid.width - 1, 1,
                          (grid.shape[0], grid.width), rectified_input, tuning, arena)
        self.moved = MovedRows(self.right, calibration.right, rows, grid.width - 1, 1,
                               rectified_input, margin, first_column(1)) if (
            settings.matching.row_alignment == 'correct') else None
        both = self.left, self.right
        known = np.concatenate([view.psf_variance[np.isfinite(view.psf_variance)]
                                for view in both])
        variance = np.median(known) if known.size else 0.0
        for view in both:
            view.even_out(variance, arena)
        foreshortened = settings.matching.foreshortening
        self.psf = F4(variance if foreshortened else 0.0)
        self.noise_weight = F4(1)
        self.compressed = False
        self.saturation = settings.color.saturation_level - 1
        self.quantization = 1.0
        self.evened = self.common_blur = 0.0
        self.raised, self.contrasts = False, (0.0, 0.0)

    def load(self, left, right, applied, looks=None):
        """
        Take the raw images of a pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            RGB.
        applied : numpy.ndarray, shape (7,)
            By which the rows of the right view are corrected, px, see `rows.alignment`.
        looks : sequence of two Look, optional
            What `looker` tells of these images; default: it is asked.

        Returns
        -------
        views : Views
            These; their arrays hold the pair until the next one is loaded.

        """
        if self.moved is not None:
            self.moved.move(applied)
        self.evened, self.raised = 0.0, False
        color = self.settings.color
        looks = looks or self.looker.look(left, right)
        if any(look.hot for look in looks):
            left, right = (without_hot_pixels(image, self.raw) if look.hot else image
                           for image, look in zip((left, right), looks))
            looks = self.looker.look(left, right)
        self.common_blur = self.blur_of_both(looks)
        # where one view is compressed, the other one gets the same treatment: they stay alike
        self.compressed = any(look.subsampled for look in looks)
        cell = self.raw.dark_cell if self.compressed else 1
        levels = [self.left.load(left, color, cell), self.right.load(right, color, cell)]
        self.share_dark_levels(levels)
        gains = channel_gains(levels, color, self.tuning, (left, right))
        smoothing = self.smoothing(left, right) if self.compressed else None
        for view, (dark, _), gain in zip((self.left, self.right), levels, gains):
            view.fill(dark, gain, color, smoothing)
        self.raise_weak_contrast()
        self.noise_weight = F4(looks[0].noise_weight)
        return self

    def raise_weak_contrast(self):
        """
        Raise the contrast of the colors of one view that is far below that of the other one.

        Crosstalk takes saturation from all hues alike. Every part of an aperiodic pattern holds
        all hues, so that both views should have one contrast.

        """
        tuning = self.tuning
        if not math.isfinite(tuning.unlike_contrast):
            return
        left, right = (view.contrast(self.raw.least_light) for view in (self.left, self.right))
        self.contrasts = least, most = min(left, right), max(left, right)
        if least > 0 and most > tuning.unlike_contrast * least:
            weak = self.left if left < right else self.right
            weak.raise_contrast(F4(most / least / tuning.left_contrast))

    def raise_faint_colors(self):
        """
        Raise the contrast of the colors of both views where it is far below that of a pattern.

        Equal crosstalk of all channels keeps their sum and shrinks the chromaticities. A factor
        undoes it. Their noise grows by the same factor.

        Returns
        -------
        kept : tuple or None
            See `copied`; None where nothing has changed.

        """
        (least, most), tuning = self.contrasts, self.tuning
        # half of a compressed color is luma
        if self.compressed or least == 0 or most >= tuning.faint_contrast:
            return None
        kept = self.copied()
        for view in (self.left, self.right):
            view.raise_contrast(F4(tuning.usual_contrast / most))
        self.raised = True
        return kept

    def lower_colors(self, kept):
        """Undo `raise_faint_colors`, which has returned this."""
        self.restore(kept)
        self.raised = False

    def copied(self):
        """Return what `restore` takes: the colors of both views as they are, and what is known."""
        return (self.noise_weight, self.evened), [each.copy() for each in self.colors()]

    def restore(self, kept):
        """Take back what has changed in the colors since `copied` returned this."""
        (self.noise_weight, self.evened), colors = kept
        for each, old in zip(self.colors(), colors):
            each[:] = old

    def colors(self):
        """Return the arrays of colors that are changed where views are made alike."""
        return [plane for view in (self.left, self.right)
                for plane in (view.u, view.v, view.s, view.variance)]

    def average(self, radius, slope):
        """
        Average slow colors; where nothing finer is to be seen.

        radius: nodes. slope: change of the colors per node, which tells steps from slopes.

        """
        tolerance = F4(self.tuning.alike_slope * radius * slope)
        counts = [view.average(radius, tolerance) for view in (self.left, self.right)]
        lit = self.left.variance < SILENT_VARIANCE
        if lit.any():
            self.noise_weight = F4(self.noise_weight / counts[0][lit].mean())

    def blur_of_both(self, looks):
        """Return common_blur of raw images, of which a Look each is known."""
        tuning = self.unlike
        if not (tuning.common and tuning.blur and self.settings.matching.blur_matching):
            return 0.0
        sharpest = max(look.sharpness for look in looks)
        if sharpest >= tuning.sharpnesses[-1]:
            return 0.0
        return float(np.interp(sharpest, tuning.sharpnesses, tuning.common_blurs))

    @property
    def blur(self):
        """Return the blur that both views share by now, evened out or seen, px^2."""
        return self.evened + self.common_blur

    def smoothing(self, left, right):
        """Write quantization; return how much to smooth, see `View.sharpen_by_luma`."""
        raw = self.raw
        # clipped blocks hide it
        self.quantization = max(quantization(left, raw), quantization(right, raw))
        return tuple(float(np.interp(self.quantization, raw.quantizations, each))
                     for each in (raw.luma_surroundings, raw.chroma_smoothing))

    def share_dark_levels(self, levels):
        """
        Lower the dark levels of a view to those of the other view where its own are no evidence.

        levels: as `channel_gains` takes them; changed in place. Levels that differ little differ
        by chance, and slow colors would move by that. Blur takes the darkest places from a view:
        then light would be taken for the dark level. Compression makes the dark levels of channels
        differ by 1 DN, which would color dark places: all get the lowest one.

        """
        if self.compressed and self.settings.color.dark_level < 0:
            least = min(dark.min() for dark, _ in levels)
            for dark, mean in levels:
                brighten(dark, mean, np.full(3, least, F4))
        least = np.minimum(*(dark for dark, _ in levels))
        for view, (dark, mean) in zip((self.left, self.right), levels):
            chance = (dark - least).max() <= self.tuning.dark_difference
            if chance or not view.sees_black:
                brighten(dark, mean, least)


def brighten(dark, mean, level):
    """Lower dark levels to a level; the means above them rise. No sample lies in between."""
    mean += dark - level
    dark[:] = level


class View:
    """
    The colors of one camera on its half grid, and the buffers for them.

    See `half_grid_index` for the other parameters.

    Parameters
    ----------
    rectified : bool
        The images arrive rectified already.
    tuning : ViewTuning
    arena : Arena

    """

    def __init__(self, camera, rows, columns, step_x, shape, rectified, tuning, arena):
        """Build the map."""
        self.tuning = tuning
        self.noise = tuple(F4(each) for each in tuning.noise)
        places = None if rectified else raw_coordinates(
            half_grid_camera(camera, rows, columns, step_x))
        self.index = [arena.copy(each) for each in half_grid_index(
            camera, rows, columns, step_x, shape, places)]
        self.inside = self.index[0] >= 0  # the raw image
        self.pixels = arena.empty((camera.height, camera.width, 4), np.uint8)
        self.box = arena.empty((camera.height, camera.width), np.uint32)
        self.columns_per_node = 2 // step_x
        self.psf_variance = psf_variance(camera, rows, columns, step_x, places, tuning)
        self.widening = np.empty((2, 0, 0), F4)
        self.ring = arena.empty((BANDS, 3, 3, shape[1]), F4)
        self.u, self.v, self.s, self.peak, self.variance = (
            arena.zeros(shape, F4) for _ in range(5))

    def even_out(self, variance, arena):
        """Prepare to give all nodes a point spread of the same variance, px^2."""
        step_x = 2 // self.columns_per_node
        squares = np.array([[[step_x ** 2]], [[2 ** 2]]])
        gain = np.nan_to_num(0.5 * (variance - self.psf_variance) / squares)
        largest = self.tuning.largest_gain
        gain = np.clip(gain, -largest, largest)
        if np.abs(gain).max() < self.tuning.least_gain:
            return
        self.widening = arena.zeros((2, *self.u.shape), F4)
        inner = framed_area(*gain.shape[1:], first_column(step_x))
        for plane, found in zip(self.widening, gain):
            plane[inner] = found
        # second differences need neighbors, and outside the raw image there is no color
        surrounded = cv2.erode(self.inside.view(np.uint8), np.ones((3, 3), np.uint8),
                               borderValue=0)
        self.widening[:, surrounded == 0] = 0

    def load(self, image, color, cell=1):
        """
        Take an image, uint8 (H, W, 3).

        cell: the dark level is that of the means of cells of so many pixels.

        Returns
        -------
        dark, mean : numpy.ndarray, float32, shape (3,)
            Dark level of each channel and mean above it, DN.

        """
        cv2.cvtColor(image, cv2.COLOR_RGB2RGBA, dst=self.pixels)  # four bytes are one number
        tuning, pixels = self.tuning, self.pixels
        height, width = (max(1, count // cell) for count in image.shape[:2])
        if cell > 1:
            pixels = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
        step = max(1, min(tuning.sample_step // cell, min(height, width) // tuning.sample_rows))
        dark, mean = np.empty((2, 3), F4)
        channel_levels(pixels, step, F4(color.dark_level), tuning.largest_dark_level, dark,
                       mean)
        self.sees_black = True
        if color.dark_level < 0:
            sampled = self.pixels[step // 2::step, step // 2::step]
            darkest = np.maximum(np.maximum(sampled[..., 0], sampled[..., 1]), sampled[..., 2])
            dark_ones = np.count_nonzero(darkest <= tuning.largest_dark_level)
            self.sees_black = dark_ones > darkest.size // tuning.dark_level_rank
            if tuning.dark_needs_black and not self.sees_black:
                brighten(dark, mean, min(dark.min(), F4(tuning.usual_dark_level)))
        return dark, mean

    def fill(self, dark, gain, color, smoothing=None):
        """
        Rectify the image into chromaticity, brightness and variance.

        Parameters
        ----------
        dark : numpy.ndarray, float32, shape (3,)
            As `load` returns it.
        gain : numpy.ndarray, float32, shape (3,)
            Of the channels.
        color : ColorSettings
            The group `color` of the settings.
        smoothing : (float, float), optional
            Of a compressed image, whose luma is sharper than its chroma: see `sharpen_by_luma`.

        """
        box_sums(self.pixels.view(np.uint32)[..., 0], self.box)
        sample_colors(self.box.reshape(-1), *self.index, np.uint32(self.box.shape[1]),
                      dark, gain, F4(self.tuning.softening), F4(color.saturation_level - 1),
                      self.noise, self.widening, self.ring, self.u, self.v, self.s, self.peak,
                      self.variance)
        if smoothing is not None:
            self.sharpen_by_luma(gain, *smoothing)

    def sharpen_by_luma(self, gain, surroundings, smoothing):
        """
        Take one direction of the chromaticity from luma, which compression keeps best.

        Luma over brightness is a linear function of chromaticity. The brightness of a compressed
        image holds the errors of its chroma; its mean over the surroundings does not. The
        chromaticity across this direction is averaged: compression has left no detail in it.

        Parameters
        ----------
        gain : numpy.ndarray, float32, shape (3,)
            Of the channels.
        surroundings : float
            Standard deviation of the mean of the brightness, px.
        smoothing : float
            The same of the other direction of the chromaticity.

        """
        weight = LUMA / gain
        along_u = (2 * weight[0] - weight[1] - weight[2]) / 6
        along_v = (weight[1] - weight[2]) / ROOT12
        length = np.hypot(along_u, along_v)
        along_u, along_v, offset = along_u / length, along_v / length, weight.sum() / 3 / length
        lit = self.s > 0
        luma = self.s * (offset + along_u * self.u + along_v * self.v)
        own = luma / self.mean_inside(self.s, surroundings) - offset
        across = self.s * (along_u * self.v - along_v * self.u)
        across = (self.mean_inside(across, smoothing, F4(0))
                  / self.mean_inside(self.s, smoothing))
        np.copyto(self.u, along_u * own - along_v * across, where=lit)
        np.copyto(self.v, along_v * own + along_u * across, where=lit)

    def mean_inside(self, plane, deviation, least=F4(1)):
        """
        Return a Gaussian mean of a plane over what lies inside the raw image.

        deviation: px; least: at least that, where it is above 0.

        """
        size = {'sigmaX': deviation / 2 * self.columns_per_node, 'sigmaY': deviation / 2}
        share = cv2.GaussianBlur(self.inside.astype(F4), (0, 0), **size)
        mean = cv2.GaussianBlur(plane, (0, 0), **size) / np.maximum(
            share, F4(self.tuning.least_inside_share))
        return np.maximum(mean, least) if least else mean

    def contrast(self, least_light):
        """
        Return the contrast of the colors of bright nodes; 0 where noise explains it.

        least_light: sum of the channels of a bright node, DN.

        """
        step = self.tuning.contrast_step
        u, v, variance, s = (plane[::step, ::step] for plane in (
            self.u, self.v, self.variance, self.s))
        bright = (variance < SILENT_VARIANCE) & (s > least_light)
        if np.count_nonzero(bright) < self.tuning.contrast_nodes:
            return 0.0
        square = u[bright].var() + v[bright].var()
        return math.sqrt(square) if square > 2 * np.median(variance[bright]) else 0.0

    def raise_contrast(self, factor):
        """Multiply the colors of informed nodes around their median, and their noise."""
        informed = self.variance < SILENT_VARIANCE
        for plane in (self.u, self.v):
            middle = np.median(plane[informed])
            plane[informed] = middle + factor * (plane[informed] - middle)
        self.variance[informed] = np.minimum(self.variance[informed] * factor ** 2,
                                             F4(0.5) * SILENT_VARIANCE)

    def average(self, radius, tolerance):
        """
        Average the chromaticities with those that are alike.

        Parameters
        ----------
        radius : int
            Nodes.
        tolerance : numpy.float32
            Change that slopes make within the radius.

        Returns
        -------
        counts : numpy.ndarray, float32
            Of how many nodes each average is.

        """
        u, v, counts = self.u.copy(), self.v.copy(), np.empty_like(self.u)
        average_alike(u, v, self.variance, radius, radius * self.columns_per_node, tolerance,
                      F4(self.tuning.alike_noise ** 2), self.u, self.v, counts)
        counts /= F4(self.columns_per_node)
        # the noise of neighbors is correlated: averaging helps less than counting says
        informed = self.variance < SILENT_VARIANCE
        self.variance[informed] *= np.minimum(
            F4(self.tuning.averaged_noise) / counts[informed], F4(1))
        return counts

    @cached_property
    def raw_rows(self):
        """Row of each node in the raw image, px, float32; outside: the first one."""
        stride = self.box.shape[1]
        return (np.maximum(self.index[0], 0) // stride).astype(F4) + self.index[2] + F4(0.5)


def half_grid_index(camera, rows, columns, step_x, shape, places):
    """
    Return where the nodes of a half grid lie in the raw image.

    Parameters
    ----------
    camera : CameraModel
        One camera of the pair.
    rows, columns : int
        Nodes; node (j, i) has its center at column step_x i + 0.5, row 2 j + 0.5.
    step_x : int
        Columns per node, 2 or 1.
    shape : (int, int)
        Of the framed arrays.
    places : (numpy.ndarray, numpy.ndarray) or None
        Columns and rows of the nodes in the raw image, px; None where it arrives rectified.

    Returns
    -------
    index : numpy.ndarray, int32, framed
        Upper left neighbor in the flat box sums; -1 = outside.
    frac_x, frac_y : numpy.ndarray, float32, framed
        Position between the neighbors, 0..1.

    """
    if places is None:
        x, y = np.meshgrid(np.arange(columns, dtype=F4) * step_x, np.arange(rows, dtype=F4) * 2)
        inside = np.ones(x.shape, bool)
    else:
        x, y = places
        inside = inside_image(x, y, camera.width, camera.height)
        # box sums have their centers half a pixel right of and below their index
        x, y = x - F4(0.5), y - F4(0.5)
    x, y = np.clip(x, 0, camera.width - 2), np.clip(y, 0, camera.height - 2)
    left, top = x.astype(np.int32), y.astype(np.int32)
    area = framed_area(rows, columns, first_column(step_x))
    index = np.full(shape, -1, np.int32)
    frac_x, frac_y = np.zeros((2, *shape), F4)
    index[area] = np.where(inside, top * camera.width + left, -1)
    frac_x[area], frac_y[area] = x - left, y - top
    return index, frac_x, frac_y


def psf_variance(camera, rows, columns, step_x, places, tuning):
    """
    Return the variance of the point spread through which each node sees the scene.

    Pixels, demosaicing, sums of 2 x 2 pixels and linear interpolation average over raw pixels.
    The size of a raw pixel in rectified ones changes over the image where cameras converge. Two
    nodes match only as well as their point spreads. See `half_grid_index` for the arguments;
    tuning: ViewTuning.

    Returns
    -------
    variance : numpy.ndarray, float64, shape (2, rows, columns)
        Along rows and along columns of the rectified image, px^2; NaN outside the raw image.

    """
    if places is None:
        return np.full((2, rows, columns), tuning.pixel_variance)
    x, y = (each.astype(np.float64) for each in places)
    inside = inside_image(x, y, camera.width, camera.height)
    raw_x, raw_y = (tuning.pixel_variance + (each - 0.5) % 1 * (1 - (each - 0.5) % 1)
                    for each in (x, y))
    (x_y, x_x), (y_y, y_x) = np.gradient(x, 2, step_x), np.gradient(y, 2, step_x)
    area = np.where(inside, x_x * y_y - x_y * y_x, np.nan)
    # where the polynomial of a lens turns back there is no lens any more
    area[~(area > tuning.folded_area * np.median(area[inside])
           if inside.any() else inside)] = np.nan
    return np.stack([(y_y / area) ** 2 * raw_x + (x_y / area) ** 2 * raw_y,
                     (y_x / area) ** 2 * raw_x + (x_x / area) ** 2 * raw_y])


def first_column(step_x):
    """Return the first column of the nodes: the right view, one column a node, has no frame."""
    return PAD if step_x == 2 else 0


def half_grid_camera(camera, rows, columns, step_x):
    """Return the camera whose pixels are the nodes of a half grid."""
    projection = camera.P[:, :3].copy()
    projection[:2, 2] -= 0.5
    return SimpleNamespace(
        K=camera.K, D=camera.D, R=camera.R, P=np.diag([1.0 / step_x, 0.5, 1.0]) @ projection,
        width=columns, height=rows, distortion_model=camera.distortion_model)
