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
"""Makes the two views of a pair alike: the sharper one is blurred, colors are changed."""

import math

import cv2
import numpy as np

from .grid_kernels import F4, PAD, SILENT_VARIANCE
from .unlike import GAUGES, LINEAR, polynomial, QUADRATIC, Regression, sampled, Unlikeness

COLORS = 'gain', 'gamma', 'matrix'
ROOT3 = F4(np.sqrt(3.0))


class Evening:
    """
    Measures by how much the views of a pair differ, and evens that out in the views.

    Nothing is carried from pair to pair.

    Parameters
    ----------
    matching : MatchingSettings
        Of which `blur_matching` and `color_matching` say what is evened out.
    tuning : Tuning

    """

    def __init__(self, matching, tuning):
        """Decide what is asked."""
        self.tuning = tuning.unlike
        self.softening = F4(tuning.views.softening)
        self.blur = matching.blur_matching and tuning.unlike.blur
        self.color = matching.color_matching and tuning.unlike.color
        self.on = (self.blur or self.color) and matching.refinements > 0

    def improve(self, views, planes, fit=None):
        """
        Even out what the matches show, in the views, until nothing more shows.

        Parameters
        ----------
        views : Views
            Changed in place where the views differ.
        planes : PlaneField
            After a fit.
        fit : Regression, optional
            Of a first `look` at these views and planes, if there was one.

        Returns
        -------
        changed : bool
            The views have changed.
        size : float
            How far they were from alike; from 1 on, the search may have suffered.

        """
        changed, size = False, 0.0
        steps, share = self.tuning.first_steps, 1.0
        for _ in range(self.tuning.repeats):
            found = self.measure(fit or self.look(views, planes, steps), views, planes,
                                 steps == self.tuning.first_steps, share)
            if found is None:
                break
            apply(found, views, self.softening, self.tuning)
            changed, size, fit = True, max(size, found.size), None
            steps, share = self.tuning.next_steps, self.tuning.again_share
        return changed, size

    def matters(self, views):
        """
        Return whether the colors change so slowly that small differences move the matches.

        A gain g moves a match by g / slope. Under the steep colors of hue_field that is lost in
        the noise.

        """
        return 0 < median_slope(views, self.tuning.slope_step) < self.tuning.steep_slope

    def look(self, views, planes, steps=None):
        """
        Return the Regression of the matches, None where they are too few or explain too little.

        steps: rows and columns between the nodes; default: those of the first look.

        """
        tuning = self.tuning
        steps = steps or tuning.first_steps
        samples = sampled(views, planes, *steps)
        if samples.count < tuning.least_samples:
            return None
        turns = tuning.first_turns if steps == tuning.first_steps else tuning.turns
        fit = Regression(samples, views, tuning, self.blur, self.color, turns)
        return fit if fit.explained >= tuning.least_explained else None

    def even_spread(self, views):
        """
        Give both views the same spread of colors where they differ widely, without any match.

        Crosstalk in one camera takes most of the contrast of its colors; no search finds matches
        then. Mean and covariance of the paler view become those of the other one.

        Returns
        -------
        changed : bool

        """
        if not self.color:
            return False
        tuning = self.tuning
        seen = [moments(view, tuning, slice(*columns)) for view, columns in (
            (views.left, (PAD, PAD + views.grid.nodes[1])), (views.right, (0, views.grid.width)))]
        if None in seen:
            return False
        (left_mean, left), (right_mean, right) = seen
        matrix = transport(right, left)
        sizes = np.linalg.eigvalsh(matrix)
        if max(sizes.max(), 1 / sizes.min()) < tuning.least_spread:
            return False
        if np.prod(sizes) > 1:
            respread(views.right, matrix, right_mean, left_mean)
        else:
            respread(views.left, np.linalg.inv(matrix), left_mean, right_mean)
        return True

    def measure(self, fit, views, planes, first, share):
        """
        Return the Unlikeness of the views, None where none shows or the matches are too bad.

        fit: what `look` has returned; first: it was the first look; share: of the least
        differences that count.

        """
        if fit is None:
            return None
        tuning, samples = self.tuning, fit.samples
        blur = blur_of(fit, LINEAR)
        oblique = float(fit.value('blur', 2, 1)[0])
        if abs(oblique) < tuning.least_oblique * np.abs(blur[:, 0]).max():
            oblique = 0.0
        gain = np.stack([fit.value('gain', gauge, QUADRATIC) for gauge in range(2)])
        matrix = np.stack([fit.value('matrix', row, 2) for row in range(2)])
        gamma = float(fit.value('gamma', 0, 1)[0])
        blurs, gains = over(fit, blur), over(fit, gain)
        amount = max(np.abs(blurs).mean(axis=1).max(), abs(oblique))
        blurred = amount > share * tuning.least_blur and fit.certain('blur') > tuning.certain
        strength = np.abs(gains).mean(axis=1).max(), abs(gamma), np.abs(matrix).max()
        slow = self.matters(views)
        least_gain = tuning.gentle_gain if slow else tuning.least_gain
        least = least_gain, tuning.least_gamma, tuning.least_matrix
        recolored = any(each > share * limit and fit.certain(name) > tuning.certain
                        for each, limit, name in zip(strength, least, COLORS))
        banded = False
        if self.color:
            spread, ratio = fit.row_spread()
            banded = spread > tuning.least_band and ratio > tuning.certain_band
        if not (blurred or recolored or banded):
            return None
        if first:  # something differs: look closely
            return self.measure(self.look(views, planes, tuning.next_steps), views, planes, False,
                                share)
        if blurred:
            if not oblique:
                blur, blurs = self.curved(fit, blur, blurs)
            # a loss of contrast looks like blur, and the other way round
            gamma, matrix, strength = 0.0, np.zeros_like(matrix), (strength[0], 0.0, 0.0)
        bands = self.bands(views, planes) if banded else ()
        # slow colors hardly tell blur, and nothing where they were not matched
        worst = amount if slow else largest(blur)
        size = max(worst / tuning.large_blur if blurred else 0,
                   max(strength[0] / tuning.large_gain, max(strength[1:]) / tuning.large_mix)
                   if recolored else 0,
                   1.0 if bands else 0)
        shift = float(np.median(2 * (samples.columns - PAD) - samples.place))
        blur, blurs = F4(tuning.blur_step) * blur, F4(tuning.blur_step) * blurs
        return Unlikeness(blur if blurred else np.zeros_like(blur), tuning.blur_step * oblique,
                          gain, gamma, matrix, limits(blurs), limits(gains), bands, shift,
                          blurred, recolored or banded, size)

    def curved(self, fit, blur, blurs):
        """
        Return coefficients and values of the blur, quadratic if that makes it another one.

        The field of a lens is curved: its corners are out of focus. Rough matches feign that, too,
        but less. fit: the Regression that has found this linear blur.

        """
        tuning, fit = self.tuning, fit.again(QUADRATIC)
        found = blur_of(fit, QUADRATIC)
        flat = found.copy()
        flat[:, :LINEAR] = 0
        bent = np.abs(over(fit, flat)).mean(axis=1).max()
        if (bent < tuning.curved_share * np.abs(blurs).mean(axis=1).max()
                or fit.certain('blur', LINEAR) < tuning.certain_curve):
            return blur, blurs
        return found, over(fit, found)

    def bands(self, views, planes):
        """Return the gains of rows, from more samples, see `Unlikeness.bands`."""
        tuning = self.tuning
        samples = sampled(views, planes, *tuning.band_steps)
        fit = Regression(samples, views, tuning, self.blur, self.color, tuning.turns)
        raw = (views.left.raw_rows[samples.rows, samples.columns],
               views.right.raw_rows[samples.rows, np.rint(samples.place).astype(np.int32)])
        bins = [view.box.shape[0] // tuning.band_rows + 1 for view in (views.left, views.right)]
        return fit.bands(raw, tuning.band_rows, bins)


def median_slope(views, step, distance=1):
    """
    Return how much the colors of the left view change along the rows, per node; 0: no light.

    step: distance of the rows that tell it, nodes. distance: of the nodes that are compared; noise
    counts less over a longer one.

    """
    rows = slice(PAD, PAD + views.grid.nodes[0], step)
    left, columns = views.left, views.grid.nodes[1]
    u, v, variance = (plane[rows, PAD:PAD + columns] for plane in (
        left.u, left.v, left.variance))
    lit = np.maximum(variance[:, distance:], variance[:, :-distance]) < SILENT_VARIANCE
    change = np.hypot(*(each[:, distance:] - each[:, :-distance] for each in (u, v)))
    return float(np.median(change[lit])) / distance if lit.any() else 0.0


def moments(view, tuning, columns):
    """
    Return mean (2,) and covariance (2, 2) of the colors of cells, or None.

    A cell averages nodes of the half grid, `spread_cell` in a row: blur hardly changes its color.

    """
    size = tuning.spread_cell
    rows = slice(PAD, view.u.shape[0] - PAD)
    shape = ((columns.stop - columns.start) // (size * view.columns_per_node),
             (rows.stop - rows.start) // size)
    if min(shape) < 1:
        return None
    informed, u, v = (cv2.resize(plane[rows, columns], shape, interpolation=cv2.INTER_AREA)
                      for plane in ((view.variance < SILENT_VARIANCE).astype(F4), view.u, view.v))
    full = informed > tuning.full_cell
    colors = np.stack([u[full], v[full]])
    if colors.shape[1] < tuning.least_cells:
        return None
    mean = colors.mean(axis=1)
    rest = colors - mean[:, None]
    covariance = np.einsum('ik,jk->ij', rest, rest).astype(np.float64) / colors.shape[1]
    return mean, covariance + tuning.least_covariance * np.eye(2)


def transport(source, target):
    """Return the symmetric matrix that gives colors of one covariance another one, (2, 2)."""
    root = symmetric_root(source)
    inverse = np.linalg.inv(root)
    return inverse @ symmetric_root(root @ target @ root) @ inverse


def symmetric_root(matrix):
    """Return the root of a symmetric positive matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T


def respread(view, matrix, old_mean, new_mean):
    """Change mean and spread of the chromaticities of a view in place; their noise grows, too."""
    matrix = matrix.astype(F4)
    u, v = view.u - F4(old_mean[0]), view.v - F4(old_mean[1])
    lit = view.s > 0
    view.u[lit] = (matrix[0, 0] * u + matrix[0, 1] * v + F4(new_mean[0]))[lit]
    view.v[lit] = (matrix[1, 0] * u + matrix[1, 1] * v + F4(new_mean[1]))[lit]
    informed = view.variance < SILENT_VARIANCE
    grown = view.variance[informed] * F4(np.linalg.det(matrix))
    view.variance[informed] = np.minimum(grown, np.nextafter(SILENT_VARIANCE, F4(0)))


def blur_of(fit, terms):
    """Return the coefficients of the blur along rows and columns, (2, terms), px^2."""
    return np.stack([fit.value('blur', axis, terms) for axis in range(2)])


def over(fit, coefficients):
    """Return polynomials of coefficients, (K, terms), at the samples of a fit, (K, N)."""
    terms = polynomial(fit.x, fit.y, coefficients.shape[1])
    return np.einsum('kt,tn->kn', coefficients, np.stack(terms))


def largest(blur):
    """
    Return the largest blur at corners, borders and middle of the image, px^2.

    It may lie where nothing has been matched yet, because of the blur. blur: coefficients of
    polynomials over the image, (K, terms).

    """
    y, x = (each.ravel() for each in np.mgrid[-1:2, -1:2].astype(F4))
    return float(np.abs(blur @ np.stack(polynomial(x, y, blur.shape[1]))).max())


def limits(values):
    """Return the smallest and the largest of values, (K, N), (2, K)."""
    return np.stack([values.min(axis=1), values.max(axis=1)])


def apply(unlikeness, views, softening, tuning):
    """Make the views alike, in place."""
    if unlikeness.blurred and unlikeness.oblique:
        even_oblique(unlikeness, views, softening, tuning)
    elif unlikeness.blurred:
        views.evened += float(np.abs(unlikeness.blur[:, 0]).mean())
        for view, sign in ((views.left, -1), (views.right, 1)):
            variance = sign * polynomials(unlikeness.blur, unlikeness.blur_limits, view,
                                          views.grid, unlikeness.shift)
            if variance.max() > tuning.least_variance:
                soften(view, np.maximum(variance, 0), softening, tuning)
    if not unlikeness.recolored:
        return
    gauged = polynomials(unlikeness.gain, unlikeness.gain_limits, views.right, views.grid, 0.0)
    log_gain = np.einsum('kc,kyx->cyx', GAUGES, gauged)
    if unlikeness.bands:
        of_left, of_right = unlikeness.bands
        log_gain += between(of_right, views.right.raw_rows, tuning.band_rows)
        recolor(views.left, 0.0, -between(of_left, views.left.raw_rows, tuning.band_rows),
                np.zeros((2, 2)), tuning)
    recolor(views.right, unlikeness.gamma, log_gain, unlikeness.matrix, tuning)


def even_oblique(unlikeness, views, softening, tuning):
    """Blur both views in place by what each one lacks: motion of a camera, the same everywhere."""
    (along, *_), (across, *_) = unlikeness.blur
    values, axes = np.linalg.eigh([[along, unlikeness.oblique], [unlikeness.oblique, across]])
    views.evened += float(np.abs(values).mean())
    for view, sign in ((views.left, -1), (views.right, 1)):
        covariance = (axes * np.maximum(sign * values, 0)) @ axes.T
        if covariance.trace() > tuning.least_variance:
            kernel = oblique_kernel(covariance, 2 / view.columns_per_node, tuning)
            blur_light(view, softening, tuning, lambda light: cv2.filter2D(
                light, -1, kernel, borderType=cv2.BORDER_REPLICATE))


def oblique_kernel(covariance, step_x, tuning):
    """
    Return the weights of nodes of a blur that has this covariance exactly.

    A bell that is narrower than a node cannot be sampled. Three by three weights of a small
    covariance can be found; applied repeatedly they become a bell.

    Parameters
    ----------
    covariance : numpy.ndarray, shape (2, 2)
        Along rows and columns, px^2.
    step_x : float
        Columns per node.
    tuning : UnlikeTuning
        Constants of this stage.

    Returns
    -------
    kernel : numpy.ndarray, float32, shape (n, n)

    """
    along, across, mixed = (covariance[0, 0] / step_x ** 2, covariance[1, 1] / 4,
                            covariance[0, 1] / (2 * step_x))
    turns = max(1, math.ceil((along + across) / tuning.small_bell))
    along, across, mixed = along / turns, across / turns, mixed / turns
    corner = abs(mixed) / 2
    falling, rising = (corner, 0.0) if mixed > 0 else (0.0, corner)
    beside, above = (along - abs(mixed)) / 2, (across - abs(mixed)) / 2
    small = np.array([[falling, above, rising], [beside, 1 - along - across + abs(mixed), beside],
                      [rising, above, falling]], F4)
    kernel = np.zeros((2 * turns + 1, 2 * turns + 1), F4)
    kernel[turns, turns] = 1
    for _ in range(turns):
        kernel = cv2.filter2D(kernel, -1, small, borderType=cv2.BORDER_CONSTANT)
    return kernel


def between(gains, raw_rows, size):
    """Return the gains of rows, (3, h, w), interpolated between the bins (bins, 3)."""
    place = np.clip((raw_rows + F4(0.5)) / F4(size) - F4(0.5), 0, len(gains) - 1)
    low = np.minimum(place.astype(np.int32), len(gains) - 2)
    share = (place - low)[..., None].astype(F4)
    return np.moveaxis((1 - share) * gains[low] + share * gains[low + 1], -1, 0)


def polynomials(coefficients, bounds, view, grid, shift):
    """
    Return polynomials over the right view at the nodes of a view, float32 (K, h, w).

    They stay within bounds, (2, K): where no sample was, a polynomial knows nothing.

    """
    rows, columns = grid.nodes
    step = 2 // view.columns_per_node
    first = PAD if step == 2 else 0
    height, width = view.u.shape
    y = ((np.arange(height, dtype=F4) - PAD) * F4(2 / rows) - 1)[:, None]
    x = (((np.arange(width, dtype=F4) - first) * step - F4(shift)) * F4(1 / columns) - 1)[None]
    x, y = np.broadcast_arrays(x, y)
    fields = np.zeros((len(coefficients), height, width), F4)
    for k, term in enumerate(polynomial(x, y, coefficients.shape[1])):
        for field, coefficient in zip(fields, coefficients[:, k].astype(F4)):
            field += coefficient * term
    low, high = bounds.astype(F4)[:, :, None, None]
    return np.clip(fields, low, high, out=fields)


def recolor(view, gamma, log_gain, matrix, tuning):
    """
    Change the chromaticities of a view in place.

    Parameters
    ----------
    view : View
        One of the two views.
    gamma : float
        Added to the exponent of the channels.
    log_gain : numpy.ndarray, float32, shape (3, h, w)
        Logarithm of the gain of each channel.
    matrix : numpy.ndarray, shape (2, 2)
        Added to the unit matrix; applied last.
    tuning : UnlikeTuning
        Constants of this stage.

    """
    least = F4(tuning.least_share)
    red = np.maximum((view.u + 1) / 3, least)
    half, tilt = (1 - red) / 2, view.v / (2 * ROOT3)
    channels = [red, np.maximum(half + tilt, least), np.maximum(half - tilt, least)]
    if gamma:
        channels = [cv2.pow(each, 1 + gamma) for each in channels]
    channels = [each * cv2.exp(np.ascontiguousarray(gain))
                for each, gain in zip(channels, log_gain)]
    total = channels[0] + channels[1] + channels[2]
    u = 3 * channels[0] / total - 1
    v = ROOT3 * (channels[1] - channels[2]) / total
    lit = view.s > 0
    map_u, map_v = (np.eye(2) + matrix).astype(F4)
    np.copyto(view.u, map_u[0] * u + map_u[1] * v, where=lit)
    np.copyto(view.v, map_v[0] * u + map_v[1] * v, where=lit)


def soften(view, variance, softening, tuning):
    """
    Blur a view in place, as a lens would blur its light.

    Parameters
    ----------
    view : View
        One of the two views.
    variance : numpy.ndarray, float32, shape (2, h, w)
        By how much along rows and along columns, px^2, 0 or more.
    softening : numpy.float32
        See `view_kernels.sample_colors`.
    tuning : UnlikeTuning
        Constants of this stage.

    """
    step = 2 // view.columns_per_node
    blur_light(view, softening, tuning, lambda light: blurred(
        blurred(light, variance[0] / F4(step ** 2), 0, tuning),
        variance[1] / F4(2 ** 2), 1, tuning))


def blur_light(view, softening, tuning, blur):
    """
    Change the light of a view in place, and its colors with it.

    blur: a function of (h, w, 4): u and v times light, light, and 1 where the raw image is; for
    the other arguments see `soften`.

    """
    weight = view.s + softening
    inside = view.inside.astype(F4)
    u, v, light, share = cv2.split(blur(cv2.merge([
        view.u * weight * inside, view.v * weight * inside, view.s * inside, inside])))
    np.maximum(share, F4(tuning.least_inside), out=share)
    total = light + softening * share
    lit = view.inside & (view.s > 0)
    for plane, value in ((view.u, u / total), (view.v, v / total), (view.s, light / share)):
        np.copyto(plane, value, where=lit)


def blurred(light, variance, axis, tuning):
    """Blur along an axis, 0: rows, by variances (h, w), nodes^2; between few levels of blur."""
    least, most = float(variance.min()), float(variance.max())
    levels = tuning.blur_levels
    if most - least <= tuning.even_blur * most:
        return gaussian(light, (most + least) / 2, axis, tuning)
    out = np.zeros_like(light)
    stepped = (variance - F4(least)) * F4(levels / (most - least))
    for k, value in enumerate(np.linspace(least, most, levels + 1)):
        share = np.maximum(0, 1 - np.abs(stepped - F4(k)))
        share = cv2.merge([share] * light.shape[2])  # numpy is slow to repeat it along channels
        out += np.multiply(share, gaussian(light, value, axis, tuning), out=share)
    return out


def gaussian(light, variance, axis, tuning):
    """Blur along an axis, 0: rows, by a variance, nodes^2."""
    if variance <= 0:
        return light
    reach = max(1, math.ceil(tuning.bell_reach * math.sqrt(variance)))
    at = np.arange(-reach, reach + 1)
    if variance > tuning.least_bell:
        kernel = np.exp(-at ** 2 / (2 * variance))
    else:  # three taps: a sampled bell would be too narrow
        kernel = np.where(at == 0, 1 - variance, np.where(np.abs(at) == 1, variance / 2, 0))
    kernel, one = (kernel / kernel.sum()).astype(F4), np.ones(1, F4)
    return cv2.sepFilter2D(light, -1, *((kernel, one) if axis == 0 else (one, kernel)),
                           borderType=cv2.BORDER_REPLICATE)
