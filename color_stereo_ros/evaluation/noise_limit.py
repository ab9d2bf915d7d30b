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
The smallest standard deviation of the disparity that the noise of a pair of images allows.

Both cameras see the chromaticity p = C / S of a surface point, C the color above the dark level
and S = C_R + C_G + C_B; the factor between the two colors is unknown (paper, sec. 2.2:
C_left = s C_right), so only the chromaticity tells where a point is. With J = (I - p 1') / S

    cov(p) = J diag(v) J',          v_c = variance of a raw sample / share_c     per camera
    w      = g' (cov_left + cov_right)^-1 g,                  g = dp / dx in the right image
    F      = sum over the window of  w h h',       h = (1, dx, dy) plane, h = (1) constant
    limit  = sqrt((F^-1)_00)

is the Cramer-Rao bound of the disparity at the center of the window for any unbiased estimator
that takes the surface for a plane (or a constant) over the window. `share` is the share of the
pixels that carry a channel: 1/4, 1/2, 1/4 behind a Bayer mosaic, whose demosaiced pixels are
not independent. g' .. g is formed from one gradient of each camera, whose noises are independent,
so noise does not pass for signal.

"""

from dataclasses import dataclass

import cv2
import numpy as np

from .metrics import depth_edges, robust_std
from ..core import SettingsError
from ..core.constants import ROBUST_STD
from ..core.triangulation import disparity_from_depth

BAYER_SHARES = (0.25, 0.5, 0.25)
DEFAULT_WINDOW = 9
SATURATED = 254  # DN
MIN_SIGNAL = 3.0  # DN, sum of the channels above the dark level
BLOCK = 5  # px, side of the blocks whose means show the noise of an unknown pair


@dataclass(frozen=True)
class CameraNoise:
    """
    Known noise of one camera.

    Variance of a raw sample = floor + slope * signal + (relative * signal)^2, DN^2.

    """

    floor: tuple
    """Variance without light of R, G, B, DN^2: read noise and rounding."""
    slope: tuple
    """Shot noise of R, G, B: DN per electron, DN."""
    relative: float = 0.0
    """Standard deviation of an error proportional to the signal: speckle, fixed pattern."""
    dark: tuple = (0.0, 0.0, 0.0)
    """Signal without light of R, G, B, DN."""
    shares: tuple = BAYER_SHARES
    """Share of the pixels that carry R, G, B."""

    def covariance(self, colors):
        """Return the covariance of the chromaticity of colors (H, W, 3), see the module."""
        floor, slope, shares = (np.asarray(value, np.float64)
                                for value in (self.floor, self.slope, self.shares))
        signal = np.maximum(colors, 0).astype(np.float64)
        variance = (floor + slope * signal + (self.relative * signal) ** 2) / shares
        total = np.maximum(colors.sum(axis=2), 1.0).astype(np.float64)
        jacobian = np.empty((*total.shape, 2, 3))
        for row in range(2):
            jacobian[..., row, :] = -(colors[..., row] / total)[..., None]
            jacobian[..., row, row] += 1.0
        jacobian /= total[..., None, None]
        first, second = jacobian[..., 0, :], jacobian[..., 1, :]
        return np.stack([(first * first * variance).sum(-1),
                         (second * second * variance).sum(-1),
                         (first * second * variance).sum(-1)])


@dataclass(frozen=True)
class MeasuredNoise:
    """
    Noise of one camera as it shows in a pair with truth; see `measured_noise`.

    Variance of the two chromaticities = (floor + slope * S) / S^2, S the sum of the channels.

    """

    floor: tuple
    slope: tuple
    correlation: float
    """Of the two chromaticities."""
    dark: tuple
    """Signal without light of R, G, B, DN."""

    def covariance(self, colors):
        """Return the covariance of the chromaticity of colors (H, W, 3)."""
        total = np.maximum(colors.sum(axis=2), 1.0).astype(np.float64)
        first, second = ((floor + slope * total) / total ** 2
                         for floor, slope in zip(self.floor, self.slope))
        return np.stack([first, second, self.correlation * np.sqrt(first * second)])


@dataclass(frozen=True)
class Window:
    """The pixels that decide one disparity, and the surface that they are taken for."""

    width: int = DEFAULT_WINDOW
    height: int = DEFAULT_WINDOW
    surface: str = 'plane'
    """plane or constant."""

    def __post_init__(self):
        """Check the arguments."""
        for name in ('width', 'height'):
            size = getattr(self, name)
            if size < 1 or size % 2 == 0:
                raise SettingsError(f'window {name} = {size} px is no odd number >= 1 px')
        if self.surface not in ('plane', 'constant'):
            raise SettingsError(f'window surface = {self.surface!r} is not one of plane, constant')


def noise_limit(pair, truth, noise_left, noise_right, window=Window()):
    """
    Return the Cramer-Rao bound of the disparity on smooth, visible surfaces.

    Parameters
    ----------
    pair : color_stereo_ros.core.RectifiedPair
        The rectified images.
    truth : color_stereo_ros.evaluation.metrics.Truth
        The true disparities and who sees them.
    noise_left, noise_right : CameraNoise or MeasuredNoise
        Of both cameras.
    window : Window
        That is compared.

    Returns
    -------
    limit : numpy.ndarray, float64, shape (H, W)
        Standard deviation, px; NaN where the window is not wholly on a smooth visible surface.

    """
    view = _View(pair, truth, noise_left.dark, noise_right.dark)
    covariance = noise_left.covariance(view.left) + noise_right.covariance(view.right)
    information = _bilinear_form(view.left_gradient, covariance, view.right_gradient)
    information = np.where(view.usable, information, 0.0)
    return np.where(_full_windows(view.usable, window), _bound(information, window), np.nan)


class _View:
    """Both images as colors above the dark level in the pixels of the left one."""

    def __init__(self, pair, truth, dark_left, dark_right):
        disparity = disparity_from_depth(truth.depth.astype(np.float64), pair.geometry)
        self.disparity = np.where(np.isfinite(disparity), disparity, -1e4)
        height, width = disparity.shape
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        self._maps = ((columns - self.disparity).astype(np.float32), rows.astype(np.float32))
        right = pair.right.astype(np.float32) - np.float32(dark_right)
        self.left = pair.left.astype(np.float32) - np.float32(dark_left)
        self.right = self._warped(right)
        # x_right = x - d(x): a pixel of the left image is 1 - d_x pixels of the right one.
        stretch = 1.0 - np.gradient(self.disparity, axis=1)
        self.left_gradient = _gradient(self.left) / np.maximum(stretch, 0.1)[..., None]
        self.right_gradient = self._warped(_gradient(right).astype(np.float32))
        saturated = (pair.left.max(axis=2) >= SATURATED) | (
            self._warped(pair.right.astype(np.float32)).max(axis=2) >= SATURATED)
        lit = (self.left.sum(axis=2) > MIN_SIGNAL) & (self.right.sum(axis=2) > MIN_SIGNAL)
        self.usable = (truth.visible & lit & ~saturated & pair.left_inside
                       & ~depth_edges(truth, pair.geometry, reach=1))

    def _warped(self, image):
        return cv2.remap(image, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)


def chromaticity(colors):
    """Return the first two chromaticities (H, W, 2) of colors (H, W, 3) above the dark level."""
    total = np.maximum(colors.sum(axis=2, keepdims=True), 1.0)
    return colors[..., :2] / total


def _gradient(colors):
    """Return dp/dx per pixel, (H, W, 2)."""
    values = chromaticity(colors).astype(np.float64)
    return cv2.Scharr(values, cv2.CV_64F, 1, 0, scale=1 / 32, borderType=cv2.BORDER_REPLICATE)


def _bilinear_form(left, covariance, right):
    """Return left' covariance^-1 right."""
    var_0, var_1, mixed = covariance
    determinant = np.maximum(var_0 * var_1 - mixed * mixed, 1e-30)
    return (left[..., 0] * (var_1 * right[..., 0] - mixed * right[..., 1])
            + left[..., 1] * (var_0 * right[..., 1] - mixed * right[..., 0])) / determinant


def _full_windows(usable, window):
    """Return where every pixel of the window is usable."""
    kernel = np.ones((window.height, window.width), np.uint8)
    return cv2.erode(usable.astype(np.uint8), kernel, borderType=cv2.BORDER_CONSTANT,
                     borderValue=0) > 0


def _bound(information, window):
    """Return sqrt((F^-1)_00) of the window around each pixel."""
    if window.surface == 'constant':
        inverse = 1.0 / np.maximum(_moment(information, window, 0, 0), 1e-30)
        return np.sqrt(inverse)
    m00, m10, m01, m20, m02, m11 = (
        _moment(information, window, i, j)
        for i, j in ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)))
    minor = m20 * m02 - m11 * m11
    determinant = (m00 * minor - m10 * (m10 * m02 - m11 * m01) + m01 * (m10 * m11 - m20 * m01))
    with np.errstate(invalid='ignore', divide='ignore'):
        inverse = minor / determinant
        return np.where((determinant > 0) & (inverse > 0), np.sqrt(inverse), np.nan)


def _moment(values, window, power_x, power_y):
    """Return the sums of values * dx^i * dy^j over the window around each pixel."""
    x = (np.arange(window.width) - window.width // 2.0) ** power_x
    y = (np.arange(window.height) - window.height // 2.0) ** power_y
    return cv2.sepFilter2D(values, cv2.CV_64F, x, y, borderType=cv2.BORDER_CONSTANT)


def compare(result, truth, limit):
    """
    Compare the errors of a result with the noise limit.

    Parameters
    ----------
    result : color_stereo_ros.core.RangeResult
        What was measured.
    truth : color_stereo_ros.evaluation.metrics.Truth
        The true disparities and who sees them.
    limit : numpy.ndarray, shape (H, W)
        Of `noise_limit`.

    Returns
    -------
    figures : dict or None
        `limit_px` (median), `error_over_limit` (robust standard deviation about 0 of error
        divided by limit; 1 = all information is used) and `pixels`; None without a pixel.

    """
    true = disparity_from_depth(truth.depth.astype(np.float64), result.geometry)
    ratio = (result.disparity - true) / limit
    known = np.isfinite(ratio)
    if not known.any():
        return None
    return {'limit_px': float(np.median(limit[known])),
            'error_over_limit': float(ROBUST_STD * np.median(np.abs(ratio[known]))),
            'pixels': int(np.count_nonzero(known))}


def measured_noise(pair, truth):
    """
    Measure the noise of a pair whose cameras are unknown, alike for both.

    The right image is warped onto the left one with the true disparities. Where the
    chromaticities then differ there is noise, plus colored shading that varies slowly. Second
    differences of the means of blocks remove the shading. The means contain the noise as a
    matching window does, with its correlations by demosaicing and rectification. Different blur
    of the two cameras counts as noise, so the limit is too large rather than too small.

    Parameters
    ----------
    pair : color_stereo_ros.core.RectifiedPair
        The rectified images.
    truth : color_stereo_ros.evaluation.metrics.Truth
        The true disparities and who sees them.

    Returns
    -------
    noise : MeasuredNoise

    """
    dark = [np.percentile(image[inside], 1.0, axis=0).astype(np.float32)
            for image, inside in ((pair.left, pair.left_inside), (pair.right, pair.right_inside))]
    view = _View(pair, truth, *dark)
    total = view.left.sum(axis=2)
    difference = (chromaticity(view.left) - chromaticity(view.right)) * total[..., None]
    means = cv2.blur(difference, (BLOCK, BLOCK))
    bend = means - 0.5 * (np.roll(means, BLOCK, 0) + np.roll(means, -BLOCK, 0))
    usable = _full_windows(view.usable, Window(BLOCK, 3 * BLOCK))
    # Blocks of n pixels: var(bend) = (1 + 1/4 + 1/4) var / n, from two cameras.
    values = bend[usable] * np.sqrt(BLOCK * BLOCK / 1.5 / 2)
    levels = cv2.blur(total, (BLOCK, BLOCK))[usable]
    floors, slopes = zip(*(_fitted_variance(values[:, i], levels) for i in range(2)))
    return MeasuredNoise(floors, slopes, _robust_correlation(values),
                         tuple(np.mean(dark, axis=0).tolist()))


def _robust_correlation(values):
    """Return the correlation of two columns from robust variances, -0.9 .. 0.9."""
    if len(values) < 100:
        return 0.0
    first, second, both = (robust_std(column) ** 2 for column in (
        values[:, 0], values[:, 1], values.sum(axis=1)))
    scale = max(2 * np.sqrt(first * second), 1e-12)
    return float(np.clip((both - first - second) / scale, -0.9, 0.9))


def _fitted_variance(values, levels):
    """Return floor >= 0.02 DN^2 and slope >= 0 of the variance of values over their level."""
    edges = np.percentile(levels, np.linspace(0, 100, 9)) if levels.size else np.zeros(2)
    bins = [(levels >= low) & (levels <= high) for low, high in zip(edges[:-1], edges[1:])]
    bins = [inside for inside in bins if np.count_nonzero(inside) >= 50]
    if not bins:
        return 1.0, 0.0
    middle = [np.median(levels[inside]) for inside in bins]
    variance = [robust_std(values[inside]) ** 2 for inside in bins]
    slope, floor = np.polyfit(middle, variance, 1) if np.ptp(middle) > 1 else (0.0, variance[0])
    if slope < 0 or floor < 0:
        slope = max(np.mean(variance) / np.mean(middle), 0.0) if floor < 0 else 0.0
        floor = 0.0 if floor < 0 else np.mean(variance)
    return float(max(floor, 0.02)), float(slope)
