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
"""Brightness against its surroundings: the third carrier, or the only one of gray images."""

import cv2
import numpy as np

from .grid_kernels import F4, SILENT_VARIANCE
from .pair_model import first_quartile, known_values
from .texture_kernels import add_seeds, linearize_brightness


class BrightnessCarrier:
    """
    The normalized brightness of both views of a pair, and how precise it is in that pair.

    Parameters
    ----------
    views : Views
    tuning : Tuning
    arena : Arena

    Attributes
    ----------
    active : bool
        Brightness counts in the pair in force, beside color.
    scale : numpy.float32
        Variance of the brightness, as a factor of that of the camera model.

    """

    def __init__(self, views, tuning, arena):
        """Allocate the brightness of both views."""
        self.tuning, self.robust_misfit = tuning.brightness, F4(tuning.planes.robust_misfit)
        self.steps, self.limits = tuning.pair.adapt_steps, tuning.pair.scale_limits
        self.least_samples = tuning.pair.least_samples
        self.least_share = F4(tuning.views.least_inside_share)
        self.planes = [tuple(arena.zeros(view.s.shape, F4) for _ in range(2))
                       for view in (views.left, views.right)]
        self.misfit = arena.full(views.left.s.shape, np.nan, F4)
        self.nothing = np.zeros((0, 0), F4)
        self.shares = [None, None]
        self.seed = arena.full(views.left.s.shape, np.nan, F4)
        self.usable = arena.full(views.left.s.shape, np.nan, F4)
        self.beaten = None
        self.window_nodes = (2 * tuning.planes.radius + 1) ** 2
        self.seed_weight = F4(0)
        self.seeded, self.active, self.scale = False, False, F4(1)

    def rest(self):
        """Let brightness count for nothing, as it does until a pair is loaded."""
        self.active = self.seeded = False

    def confirmed(self, planes):
        """
        Return what the seeds add to the log-odds of the nodes, float32; None without seeds.

        A seed that fits worse than the plane says nothing.

        """
        if not self.seeded:
            return None
        inner, odds = planes.grid.inner, F4(self.tuning.agreement_odds)
        agree = np.abs(self.seed[inner] - planes.d[inner]) < F4(1)
        return np.where(agree, odds, np.where(self.beaten, F4(0), -odds))

    def claims(self, grid):
        """
        Return the seeds that may take the place of planes, px, framed; NaN = none.

        Where the search has seen the repeated border of the right view, its seeds replace
        nothing. The array holds until the next call.

        """
        seed = self.seed[grid.inner]
        place = F4(2) * np.arange(grid.columns, dtype=F4) - seed
        border = F4(self.tuning.disputed_border)
        inside = (place >= border) & (place < F4(grid.width - 1) - border)
        self.usable[grid.inner] = np.where(inside, seed, F4(np.nan))
        return self.usable

    def settle(self, planes, seeds):
        """
        Take the planes as they are after the contest with `claims`.

        A plane has no variance where its window changes no more than its noise. Beside a seed it
        gets one, if the surroundings are alike in both views.

        Parameters
        ----------
        planes : PlaneField
            Their variance is written.
        seeds : Seeds
            Of the search.

        """
        inner, tuning = planes.grid.inner, self.tuning
        near = np.abs(self.seed[inner] - planes.d[inner]) < F4(1)
        self.beaten = ~np.isnan(self.usable[inner]) & ~near
        uninformed = (seeds.likeness > F4(tuning.informed_likeness)) & np.isinf(
            planes.variance[inner]) & near
        planes.variance[inner][uninformed] = F4(tuning.uninformed_std ** 2)

    def light(self, view):
        """
        Return the brightness that tells whether a node of a view is lit, DN.

        Where seeds hold planes that is the mean of the surroundings: between dots it is dark.

        """
        size = 2 * self.tuning.detail_radius + 1
        return cv2.blur(view.s, (size, size)) if self.seeded else view.s

    @property
    def arrays(self):
        """Return what `neighbor_kernels.propagate` takes; without entries if inactive."""
        if not self.active:
            return (self.nothing,) * 4 + (self.scale,)
        return (*self.planes[0], *self.planes[1], self.scale)

    def load(self, views):
        """Fill in the brightness of a pair, which counts from here on."""
        for number, (view, (level, variance)) in enumerate(zip((views.left, views.right),
                                                               self.planes)):
            if self.shares[number] is None:
                around = cv2.blur(view.inside.astype(F4), self.window(view))
                self.shares[number] = np.maximum(around, self.least_share)
            normalized_brightness(view, self.tuning.offset, views.saturation, self.window(view),
                                  self.shares[number], level, variance)
        self.active, self.scale = True, F4(1)

    def window(self, view):
        """Return columns and rows of the surroundings of a node of a view."""
        radius = self.tuning.radius
        return 1 + 2 * radius * view.columns_per_node, 1 + 2 * radius

    def replace_colors(self, views):
        """Let the brightness of a gray pair take the place of its chromaticities."""
        self.load(views)
        for view, (level, variance) in zip((views.left, views.right), self.planes):
            view.u[...], view.variance[...] = level, variance
            view.v.fill(0)
        self.active = False

    def add(self, linearized, views, planes, tiles, reference, fold):
        """
        Add the brightness and the seeds of some tiles to their linearized colors.

        Writes linearized and `misfit`; if fold, planes.misfit becomes that of all carriers.

        """
        if self.active:
            self.add_brightness(linearized, views, planes, tiles, reference, fold)
        if self.seeded:
            add_seeds(self.seed, planes.d, tiles, F4(self.tuning.seed_gate), self.seed_weight,
                      reference, linearized.weight, linearized.moment)

    def add_brightness(self, linearized, views, planes, tiles, reference, fold):
        """Add the brightness alone, see `add`."""
        (left, left_var), (right, right_var) = self.planes
        linearize_brightness(left, left_var, right, right_var, views.psf, planes.d, planes.a,
                             planes.b, tiles, self.robust_misfit, self.scale, reference,
                             fold, linearized.weight, linearized.moment,
                             planes.misfit, self.misfit)

    def rely_on(self, found, grid, std=None):
        """
        Let planes be held by the seeds of a search.

        std: standard deviation of what the seeds of a window of `planes.radius` say, px; default:
        `seed_std`.

        A search knows smoothness: it is right within a pixel where the colors around a node are
        too uniform for least squares.

        """
        self.seed[grid.inner] = F4(2) * found.disparity + F4(found.offset)
        self.beaten = np.zeros(found.likeness.shape, bool)
        self.seed_weight = F4(1 / ((std or self.tuning.seed_std) ** 2 * self.window_nodes))
        self.seeded = True

    def measure(self, views):
        """Measure `scale` from the misfit of the brightness of the matches so far."""
        if not self.active:
            return
        step_y, step_x = self.steps
        rows, columns = views.grid.inner
        found = self.misfit[rows, columns][::step_y, ::step_x]
        known = known_values(found)
        if known.size >= self.least_samples:
            self.scale = F4(np.clip(first_quartile(known) / self.tuning.quartile, *self.limits))


def normalized_brightness(view, offset, saturation, window, share, level, variance):
    """
    Write the logarithm of the brightness against its surroundings, and its variance.

    Parameters
    ----------
    view : View
        One of the two views.
    offset : float
        Added to the brightness, DN.
    saturation : float
        Brightest channel from which a node says nothing, DN.
    window : (int, int)
        Columns and rows of the surroundings.
    share : numpy.ndarray, float32
        Share of the surroundings inside the raw image, above 0.
    level, variance : numpy.ndarray, float32
        Arrays of the shape of the view that are written. What is dark between bright dots says
        something: only outside and saturated nodes have SILENT_VARIANCE.

    """
    raised = view.s + F4(offset)
    cv2.log(raised, dst=level)
    level[~view.inside] = 0
    np.subtract(level, cv2.blur(level, window) / share, out=level)
    level[~view.inside] = 0
    floor, shot, relative = view.noise
    np.divide(floor + view.s * (shot + relative * view.s), raised * raised, out=variance)
    variance[~view.inside | (view.peak >= F4(saturation))] = SILENT_VARIANCE


def without_color(image):
    """Return an image, uint8 (H, W, 3), with its luma in all channels."""
    return cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
