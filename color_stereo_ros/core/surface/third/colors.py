# SPDX-License-Identifier: Apache-2.0
"""What the left camera sees of the colors of the pattern, measured where two cameras know."""

from dataclasses import dataclass

import cv2
import numpy as np

from .tuning import TUNING

F4 = np.float32
ROOT3 = F4(np.sqrt(3.0))


@dataclass(frozen=True, eq=False)
class Light:
    """From the light of the pattern to the colors of the left view."""

    pattern: object
    """The BlurredPattern that is as blurred as the left view."""
    colors: np.ndarray
    """float32 (3, 4): light of the camera = A p + b of that of the pattern, [A | b]."""
    local: np.ndarray
    """
    float32 (3, framed): red and blue against green that the surface returns, and the share of
    the color that is not diluted.
    """
    unrest: np.ndarray
    """float32, framed: variance of the color beside what noise explains, as a factor, >= 1."""
    scale: np.float32
    """Variance of the colors as a factor of that of the camera model."""


def chromaticity(light):
    """Return u and v of light, shape (3, ...)."""
    r, g, b = light
    total = np.maximum(r + g + b, F4(TUNING.color.least_light))
    return (2 * r - g - b) / total, ROOT3 * (g - b) / total


def mixed(colors, light):
    """Return light of the pattern, (3, ...), as the left camera sees it on a white surface."""
    return np.tensordot(colors[:, :3], light, axes=1) + colors[:, 3].reshape(
        (3,) + (1,) * (light.ndim - 1))


def fitted_colors(u, v, light, weight):
    """
    Return the map from the light of the pattern to that of the camera, up to its brightness.

    With light A p + b, a chromaticity u = (2 r - g - b) / (r + g + b) asks for (u - 2) r + (u + 1)
    g + (u + 1) b = 0, and v likewise for v r + (v - 3^.5) g + (v + 3^.5) b = 0: linear in A and b.

    Parameters
    ----------
    u, v : numpy.ndarray, shape (N,)
    light : numpy.ndarray, shape (3, N)
    weight : numpy.ndarray, shape (N,)

    Returns
    -------
    colors : numpy.ndarray, float32, shape (3, 4)

    """
    tuning = TUNING.color
    p = np.vstack([light, np.ones(light.shape[1])]).astype(np.float64)
    prior = np.eye(3, 4)
    colors, trust = prior, weight
    for _ in range(tuning.turns):
        total = np.maximum(np.sum(mixed(colors, p[:3]), axis=0), tuning.least_total)
        size = np.sqrt(trust) / total
        rows_u = np.vstack([(u - 2) * p, (u + 1) * p, (u + 1) * p]) * size
        rows_v = np.vstack([v * p, (v - ROOT3) * p, (v + ROOT3) * p]) * size
        normal = rows_u @ rows_u.T + rows_v @ rows_v.T
        hold = tuning.color_prior * np.trace(normal) / 12
        solved = np.linalg.solve(normal + hold * np.eye(12), hold * prior.ravel())
        colors = solved.reshape(3, 4)
        colors = colors * (3 / max(np.trace(colors[:, :3]), tuning.least_total))
        seen_u, seen_v = chromaticity(mixed(colors, p[:3]))
        error = (u - seen_u) ** 2 + (v - seen_v) ** 2
        trust = weight / (1 + error / max(np.median(error) * tuning.robust, tuning.least_error))
    return colors.astype(F4)


def explained(u, v, light, colors):
    """Return the share of the spread of known colors that the pattern explains, by medians."""
    seen_u, seen_v = chromaticity(mixed(colors, light))
    error = np.median((u - seen_u) ** 2 + (v - seen_v) ** 2)
    return 1 - error / np.median((u - np.median(u)) ** 2 + (v - np.median(v)) ** 2)


def local_light(u, v, light, colors, variance, known):
    """
    Return what surfaces make of the colors, from coarse to fine, on a grid.

    Each node with a known place asks for three changes of its predicted color: more red, more
    blue, less color of all. Least squares over windows give them; where a window knows nothing,
    that of the larger window stays.

    Parameters
    ----------
    u, v, variance : numpy.ndarray, float32, shape (h, w)
        Of the left view.
    light : numpy.ndarray, float32, shape (3, h, w)
        Of the pattern; NaN = unknown.
    colors : numpy.ndarray, float32, shape (3, 4)
    known : numpy.ndarray, bool, shape (h, w)

    Returns
    -------
    local : numpy.ndarray, float32, shape (3, h, w)
        See `Light.local`.
    error : numpy.ndarray, float32, shape (h, w)
        Squared error of the color over its variance that is left; 0 where unknown.

    """
    tuning = TUNING.color
    seen = mixed(colors, np.where(known, light, 1).astype(F4))
    r, g, b = seen
    change = np.zeros((3, *u.shape), F4)
    for radius, hold in zip(tuning.radii, tuning.holds):
        red, blue = np.exp(change[0]) * r, np.exp(change[1]) * b
        total = red + g + blue
        own_u, own_v = (2 * red - g - blue) / total, ROOT3 * (g - blue) / total
        gray = np.exp(change[2])
        own_u, own_v = gray * own_u, gray * own_v
        error_u, error_v = u - own_u, v - own_v
        chi = (error_u ** 2 + error_v ** 2) / variance
        weight = np.where(known, 1 / (variance * (1 + chi / F4(tuning.robust_misfit))), 0)
        by_red = gray * red * (2 - own_u / gray) / total, -own_v * red / total
        by_blue = -gray * blue * (1 + own_u / gray) / total, -gray * blue * (
            ROOT3 + own_v / gray) / total
        change = change + solved_changes((by_red, by_blue, (own_u, own_v)), (error_u, error_v),
                                         weight.astype(F4), radius, F4(hold))
        change = np.clip(change, *(np.array(each, F4)[:, None, None] for each in zip(
            *tuning.change_limits)))
    local = np.exp(change)
    red, blue = local[0] * r, local[1] * b
    total = red + g + blue
    error_u = u - local[2] * (2 * red - g - blue) / total
    error_v = v - local[2] * ROOT3 * (g - blue) / total
    return local, np.where(known, (error_u ** 2 + error_v ** 2) / variance, 0).astype(F4)


def solved_changes(slopes, errors, weight, radius, hold):
    """Return the changes, float32 (3, h, w), that windows of a radius ask for."""
    size = (2 * radius + 1,) * 2

    def window(plane):
        return cv2.blur(plane, size, borderType=cv2.BORDER_CONSTANT)

    n = {}
    for i in range(3):
        for j in range(i, 3):
            n[i, j] = window(weight * (slopes[i][0] * slopes[j][0] + slopes[i][1] * slopes[j][1]))
        n[i, i] = n[i, i] + hold
        n[i, 3] = window(weight * (slopes[i][0] * errors[0] + slopes[i][1] * errors[1]))
    # Cramer's rule for the symmetric 3 x 3 system
    a, b, c, d, e, f = n[0, 0], n[0, 1], n[0, 2], n[1, 1], n[1, 2], n[2, 2]
    i00, i01, i02 = d * f - e * e, c * e - b * f, b * e - c * d
    i11, i12, i22 = a * f - c * c, b * c - a * e, a * d - b * b
    inverse = 1 / (a * i00 + b * i01 + c * i02)
    x, y, z = n[0, 3], n[1, 3], n[2, 3]
    return np.stack([(i00 * x + i01 * y + i02 * z) * inverse,
                     (i01 * x + i11 * y + i12 * z) * inverse,
                     (i02 * x + i12 * y + i22 * z) * inverse])
