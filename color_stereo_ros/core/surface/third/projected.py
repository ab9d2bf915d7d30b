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
"""What a ProjectorModel says about one rig, and the pattern as the left camera blurs it."""

from copy import copy
from dataclasses import dataclass

import cv2
import numpy as np

from .sweep import (
    geometry_variance, lens_change, magnification, packed, places_per_disparity, straightened,
    sweep_matrix)
from .tuning import TUNING
from ..grid_kernels import F4
from ...projector.blurring import bands


@dataclass(frozen=True, eq=False)
class BlurredPattern:
    """The light of the pattern under one blur, uint32 (H W,), see `sweep.packed`."""

    image: np.ndarray
    """As nodes see it."""
    coarse_image: np.ndarray
    """As coarse nodes see it; uint32 (H', W'), every pixel stands for thin x thin of them."""
    thin: int


class Projected:
    """
    A projector and its pattern, seen from the left camera.

    Parameters
    ----------
    model : ProjectorModel
    pattern : numpy.ndarray, uint8, shape (H, W, 3)
        Linear light.
    geometry : RectifiedGeometry
    middle : float
        A disparity that occurs, px.
    variance : float
        Of the point spread of a node, px^2 of the left image.
    step : int
        Pixels of the left image per coarse node.

    Attributes
    ----------
    sweep : numpy.ndarray, float32, shape (3, 4)
        See `sweep.sweep_matrix`; to places of the images, see `sweep.lens_change`.
    size : numpy.ndarray, int64, shape (2,)
        Height and width of the pattern, px.
    scale : float
        Pixels of the pattern that light one pixel of the left image.
    per_disparity : float
        How many pixels of the left image a disparity of 1 px moves the place.

    """

    def __init__(self, model, pattern, geometry, middle, variance, step):
        """Compute what does not depend on a pair."""
        self.model = model
        sweep = sweep_matrix(model, geometry)
        self.sweep = sweep.astype(F4)
        self.scale = magnification(sweep, geometry, middle)
        self.per_disparity = places_per_disparity(sweep, geometry, middle) / self.scale
        self.pattern, self.lens = pattern, model
        self.size = np.array(pattern.shape[:2])
        self.variance, self.step = variance + TUNING.use.lens_variance, step
        self.made, self.spreads = {}, {}

    def moved(self, model, geometry):
        """Return the same for a model that differs by little: with the same images."""
        if model is self.model:
            return self
        other = copy(self)
        other.spreads = {}
        change, _ = lens_change(model, self.lens)
        other.model, other.sweep = model, (change @ sweep_matrix(model, geometry)).astype(F4)
        return other

    def spread(self, geometry, d, nodes):
        """
        Return what the uncertainty of the projector does to disparities, float32 (rows, columns).

        px^2, for nodes of that many rows and columns, at about a disparity d, px; kept, since it
        is the same from pair to pair.

        """
        least, ratio = TUNING.sweep.least_shift, np.log(TUNING.sweep.spread_step)
        level = round(np.log(max(d - geometry.principal_offset, least)) / ratio)
        if level not in self.spreads:
            about = np.exp(level * ratio) + geometry.principal_offset
            self.spreads[level] = cv2.resize(
                geometry_variance(self.model, geometry, about).astype(F4), nodes[::-1],
                interpolation=cv2.INTER_LINEAR)
        return self.spreads[level]

    @property
    def blur(self):
        """Return the standard deviation of the least blur, px of the pattern."""
        return self.scale * float(np.sqrt(self.variance + TUNING.color.blurs[0] ** 2))

    def blurred(self, level):
        """Return the BlurredPattern of an entry of `color.blurs`; made when first asked for."""
        if level not in self.made:
            variance = self.variance + TUNING.color.blurs[level] ** 2
            wide = variance + (self.step / 4 * TUNING.search.blur) ** 2
            thin = max(1, int(self.scale * np.sqrt(wide) / TUNING.search.detail))
            fine, coarse = [], []
            for band in bands(self.size[0], self.scale * float(np.sqrt(wide)), thin):
                light = straightened(self.pattern, self.lens, band.wide)
                fine.append(packed(self.smooth(light, variance)[band.inner]))
                part = thinned(self.smooth(light, wide)[band.inner], thin)
                coarse.append(packed(part).reshape(part.shape[:2]))
            self.made[level] = BlurredPattern(*map(np.concatenate, (fine, coarse)), thin)
        return self.made[level]

    def smooth(self, light, variance):
        """Return light of the pattern blurred by a variance, px^2 of the left image."""
        return cv2.GaussianBlur(light, (0, 0), self.scale * float(np.sqrt(variance)))

    def inside(self, u, v):
        """Return which places lie inside the pattern and not at its border, bool."""
        height, width = self.size
        margin = TUNING.color.margin
        return ((u >= margin) & (v >= margin) & (u < width - 1 - margin)
                & (v < height - 1 - margin))

    def light_at(self, pattern, u, v):
        """Return the light of a BlurredPattern at places, float32 (3, ...), NaN outside."""
        image = pattern.image.view(np.uint8).reshape(*self.size, 4)
        seen = cv2.remap(image, np.atleast_2d(u), np.atleast_2d(v), cv2.INTER_LINEAR)[..., :3]
        light = np.ascontiguousarray(np.moveaxis(seen, -1, 0), F4).reshape(3, *u.shape)
        light *= F4(TUNING.sweep.unit)
        return np.where(self.inside(u, v), light, F4(np.nan))


def thinned(image, thin):
    """Return the means of thin x thin pixels; the last row and column are repeated as needed."""
    if thin == 1:
        return image
    below, right = (-count % thin for count in image.shape[:2])
    whole = cv2.copyMakeBorder(image, 0, below, 0, right, cv2.BORDER_REPLICATE)
    return cv2.resize(whole, (whole.shape[1] // thin, whole.shape[0] // thin),
                      interpolation=cv2.INTER_AREA)
