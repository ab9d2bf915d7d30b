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
The quality of a range image, measured against the truth.

Every function takes a `RangeResult` and a `Truth` of the same pixels (the rectified left camera)
and returns plain numbers, so that the report, the JSON file and the tests share one definition.
A share is a number 0..1. A number is None if there is no pixel to measure.

"""

from dataclasses import dataclass

import cv2
import numpy as np

from ..core import ImageError, Status
from ..core.constants import ROBUST_STD
from ..core.triangulation import disparity_from_depth, points_from_depth

CORRECT_SHARE = 0.01
"""A range is correct within 1 % of the distance: the promise of the paper, sec. 1."""

LOCKING_ORDER = 3
"""Harmonics of the smooth curve of pixel locking."""

LOCKING_BINS = 20

LOCKING_SHARE = 0.005
"""Smallest share of all pixels in a bin: errors of neighbors are correlated."""

LEFT_OUT = 0.25
"""No point this close to its plane is left out, px."""

RIGHT = 1.0
"""A range is right within so many px of the true correspondence."""

SURE = 0.9
"""A range of a higher confidence counts as sure."""

BEND_REACH = 6
"""Half the length over which a bend is measured, px."""

BEND = (0.2, 0.5)
"""Second difference of the true disparity over that length where a surface bends, px."""

BEND_PIXELS = 500
"""Fewest pixels from which figures of bends are taken."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The truth of one pair, in the pixels of the rectified left camera."""

    depth: np.ndarray
    """float32 (H, W), m along Z of the rectified left camera, NaN = unknown."""
    visible: np.ndarray
    """bool (H, W): seen by both cameras and lit by the projector."""
    disparity: np.ndarray = None
    """float64 (H, W), px, of the true correspondence in the pair as given; None: the depth's."""
    lit: np.ndarray = None
    """bool (H, W): lit and inside the raw left image; None: not known."""


def measure(result, truth):
    """
    Measure a range image against the truth.

    Parameters
    ----------
    result : color_stereo_ros.core.RangeResult
        What was measured.
    truth : Truth
        The true disparities and who sees them.

    Returns
    -------
    figures : dict
        Name to number, dict or None; documented in docs/evaluation.md.

    Raises
    ------
    ImageError
        If the two do not have the same size, or the truth knows no visible pixel.

    """
    check_sizes(result, truth)
    return {**accuracy(result, truth),
            'false_share': false_share(result, truth),
            'words': words(result, truth),
            'planes': plane_fit(result, truth),
            'locking': pixel_locking(result, truth),
            'curve': density_curve(result, truth),
            'reliability': reliability(result, truth),
            'z_scores': z_scores(result, truth),
            'status': status_shares(result, truth)}


def check_sizes(result, truth):
    """Raise ImageError unless result and truth have the same pixels and some are visible."""
    shape = result.depth.shape
    for name in ('depth', 'visible'):
        other = getattr(truth, name).shape
        if other != shape:
            raise ImageError(f'truth.{name} has {other[1]} x {other[0]} pixels, the range image '
                             f'{shape[1]} x {shape[0]}')
    if not truth.visible.any():
        raise ImageError('truth.visible is false everywhere: there is nothing to measure')


def true_disparity(truth, geometry):
    """Return the disparity of the true correspondence, px, float64 (H, W), NaN = unknown."""
    if truth.disparity is not None:
        return truth.disparity
    return disparity_from_depth(truth.depth.astype(np.float64), geometry)


def disparity_errors(result, truth):
    """Return measured minus true disparity, px, float64 (H, W), NaN where either is unknown."""
    return result.disparity - true_disparity(truth, result.geometry)


def words(result, truth):
    """
    Return the figures by which ranges are judged where a calibration may be wrong.

    Right and wrong refer to the true correspondence in the pair as given. Only `depth_percent`
    compares meters.

    Returns
    -------
    figures : dict
        `visible` (pixels); `density`, `right` (shares of the visible pixels); `wrong` (share of
        the visible pixels with a range); `median_px`; `false`, `false_wrong` (shares of all
        ranges: where only the left camera sees, and off by more than 1 px there, too); `cover`
        (share of the lit pixels that are right, visible or not; None if `truth.lit` is not
        known); `depth_percent` (mean error, % of the true depth); `hi` (share wrong among sure
        ranges); `sure` (share of the right ranges that are sure); `sure_pixels` (share of all
        pixels); `z68`; `bends` (of `bend_figures`).

    """
    given = np.isfinite(result.disparity)
    known = np.isfinite(true_disparity(truth, result.geometry))
    error = np.abs(disparity_errors(result, truth))
    visible, sure = truth.visible & known, given & (result.confidence > SURE)
    with np.errstate(invalid='ignore'):
        right, off = given & (error <= RIGHT), given & (error > RIGHT)
    answered, hidden = visible & given, given & known & ~visible
    figures = {
        'visible': int(np.count_nonzero(visible)),
        'density': share(answered, visible), 'right': share(right & visible, visible),
        'wrong': share(off & visible, answered), 'median_px': _number(np.median, error[answered]),
        'false': share(hidden, given), 'false_wrong': share(hidden & off, given),
        'cover': None if truth.lit is None else share(right & truth.lit, truth.lit & known),
        'depth_percent': _number(np.mean, 100 * np.abs(result.depth - truth.depth)[answered]
                                 / truth.depth[answered]),
        'hi': share(off & visible & sure, visible & sure),
        'sure': share(right & visible & sure, right & visible),
        'sure_pixels': float(np.mean(sure))}
    return {**figures, 'z68': z68(error, result.disparity_std, answered),
            'bends': bend_figures(result, truth)}


def share(part, whole):
    """Return the share of the pixels of one mask that are in another, None without any."""
    count = np.count_nonzero(whole)
    return np.count_nonzero(part) / count if count else None


def z68(errors, deviations, mask):
    """Return the 68th percentile of abs(error / disparity_std), None where there is no std."""
    with np.errstate(invalid='ignore', divide='ignore'):
        scores = np.abs(errors[mask] / deviations[mask])
    return _number(lambda each: np.percentile(each, 68), scores[np.isfinite(scores)])


def bends(truth, geometry):
    """
    Return where a smooth surface bends within a matching window, bool (H, W).

    There the second difference of the true disparity over `2 * BEND_REACH` px lies within `BEND`
    along the row or along the column, and no depth edge is near.

    """
    disparity = true_disparity(truth, geometry)
    largest = np.zeros(disparity.shape)
    for axis in (0, 1):
        ahead, behind = np.roll(disparity, -BEND_REACH, axis), np.roll(disparity, BEND_REACH, axis)
        largest = np.fmax(largest, np.abs(ahead - 2 * disparity + behind))
    inner = np.zeros(disparity.shape, bool)
    inner[BEND_REACH:-BEND_REACH, BEND_REACH:-BEND_REACH] = True
    return (truth.visible & inner & ~depth_edges(truth, geometry)
            & (largest >= BEND[0]) & (largest <= BEND[1]))


def bend_figures(result, truth):
    """Return `median_px`, `z68` and `pixels` of the ranges where surfaces bend, None if few."""
    mask = bends(truth, result.geometry) & np.isfinite(result.disparity)
    if np.count_nonzero(mask) < BEND_PIXELS:
        return None
    errors = np.abs(disparity_errors(result, truth))
    return {'median_px': float(np.median(errors[mask])), 'pixels': int(np.count_nonzero(mask)),
            'z68': z68(errors, result.disparity_std, mask)}


def accuracy(result, truth):
    """
    Return density, share correct, bad-pixel shares and errors in px, m and % of the distance.

    Density and `correct` are shares of the visible pixels with a true depth, everything else is
    taken over those of them that have a range.

    """
    known = truth.visible & np.isfinite(truth.depth)
    answered = known & np.isfinite(result.depth)
    count = np.count_nonzero(known)
    depth = truth.depth[answered].astype(np.float64)
    meters = np.abs(result.depth[answered] - depth)
    pixels = np.abs(disparity_errors(result, truth)[answered])
    figures = {
        'visible_pixels': int(count),
        'density': np.count_nonzero(answered) / count if count else None,
        'correct': np.count_nonzero(meters <= CORRECT_SHARE * depth) / count if count else None}
    for name, limit in (('bad_05', 0.5), ('bad_1', 1.0), ('bad_2', 2.0)):
        figures[name] = _number(np.mean, pixels > limit)
    figures.update(_summary('px', pixels))
    figures.update(_summary('m', meters))
    figures.update(_summary('percent', 100 * meters / depth))
    return figures


def _summary(unit, errors):
    return {f'mean_{unit}': _number(np.mean, errors),
            f'median_{unit}': _number(np.median, errors),
            f'p95_{unit}': _number(lambda e: np.percentile(e, 95), errors)}


def _number(function, values):
    return float(function(values)) if values.size else None


def false_share(result, truth):
    """
    Return the share of all ranges that lie where at most one camera sees a lit surface.

    There the truth has a depth and is not visible: half-occluded strips, shadows, the part of
    the left image that the right camera does not see.

    """
    ranges = np.isfinite(result.depth)
    count = np.count_nonzero(ranges)
    false = ranges & np.isfinite(truth.depth) & ~truth.visible
    return np.count_nonzero(false) / count if count else None


def plane_fit(result, truth):
    """
    Return the noise of the ranges about the best plane through each planar piece of the truth.

    The plane is fitted to the measurement, so this is precision, not trueness. Points farther
    than three robust standard deviations from their plane are left out and counted.

    Returns
    -------
    figures : dict or None
        `rms_mm` along the normal, `rms_px` in disparity, `planes`, `pixels`, `left_out` (share);
        None if no piece of the truth is planar.

    """
    labels, count = planar_regions(truth, result.geometry)
    points = points_from_depth(result.depth, result.geometry).astype(np.float64)
    answered = np.isfinite(result.depth)
    fits = [_plane_residuals(points, result.disparity, answered & (labels == label))
            for label in range(1, count + 1)]
    fits = [fit for fit in fits if fit is not None]
    if not fits:
        return None
    millimeters, pixels, totals = zip(*fits)
    millimeters, pixels = np.concatenate(millimeters), np.concatenate(pixels)
    return {'rms_mm': float(1e3 * np.sqrt(np.mean(millimeters ** 2))),
            'rms_px': float(np.sqrt(np.mean(pixels ** 2))),
            'planes': len(fits), 'pixels': int(millimeters.size),
            'left_out': 1.0 - millimeters.size / sum(totals)}


def _plane_residuals(points, disparity, mask):
    """Return distances (m) and disparity residuals (px) from the best plane, and the pixels."""
    rows, columns = np.nonzero(mask)
    if rows.size < 100:
        return None
    # A plane in space is an affine function of the pixel in disparity.
    design = np.column_stack([np.ones(rows.size), columns, rows]).astype(np.float64)
    design[:, 1:] -= design[:, 1:].mean(axis=0)
    values = disparity[mask].astype(np.float64)
    keep = np.ones(rows.size, bool)
    for _ in range(5):
        plane = np.linalg.lstsq(design[keep], values[keep], rcond=None)[0]
        residuals = values - design @ plane
        keep = np.abs(residuals) <= max(3 * robust_std(residuals), LEFT_OUT)
    cloud = points[mask][keep]
    cloud = cloud - cloud.mean(axis=0)
    normal = np.linalg.eigh(cloud.T @ cloud)[1][:, 0]
    return cloud @ normal, residuals[keep], rows.size


def planar_regions(truth, geometry, step=4, tolerance=0.002, smallest=0.005):
    """
    Return the planar pieces of the truth.

    A plane is affine in disparity, so second differences over `step` pixels vanish on it.

    Parameters
    ----------
    truth : Truth
        The true disparities and who sees them.
    geometry : color_stereo_ros.core.RectifiedGeometry
        Of the rectified pair.
    step : int
        Reach of the second difference, px.
    tolerance : float
        Largest second difference, px.
    smallest : float
        Smallest piece, share of all pixels.

    Returns
    -------
    labels : numpy.ndarray, int32, shape (H, W)
        0 = not planar or not visible, 1..count = pieces.
    count : int

    """
    disparity = disparity_from_depth(truth.depth.astype(np.float64), geometry)
    flat = truth.visible & np.isfinite(disparity)
    for axis in (0, 1):
        ahead, behind = np.roll(disparity, -step, axis), np.roll(disparity, step, axis)
        with np.errstate(invalid='ignore'):
            flat &= np.abs(ahead - 2 * disparity + behind) <= tolerance
    border = np.zeros_like(flat)
    border[step:-step, step:-step] = True
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        (flat & border).astype(np.uint8), connectivity=4)
    large = [label for label in range(1, count)
             if stats[label, cv2.CC_STAT_AREA] >= smallest * flat.size]
    table = np.zeros(count, np.int32)
    table[large] = np.arange(1, len(large) + 1)
    return table[labels], len(large)


def depth_edges(truth, geometry, jump=1.5, reach=8):
    """
    Return where a depth edge is near.

    Parameters
    ----------
    truth : Truth
        The true disparities and who sees them.
    geometry : color_stereo_ros.core.RectifiedGeometry
        Of the rectified pair.
    jump : float
        Difference of disparity between neighbors that counts as an edge, px.
    reach : int
        Largest distance from the edge, px.

    Returns
    -------
    near : numpy.ndarray, bool, shape (H, W)

    """
    disparity = disparity_from_depth(truth.depth.astype(np.float64), geometry)
    disparity = np.where(np.isfinite(disparity), disparity, -1e6)
    edges = np.zeros(disparity.shape, np.uint8)
    edges[:, 1:] |= np.abs(np.diff(disparity, axis=1)) > jump
    edges[1:, :] |= np.abs(np.diff(disparity, axis=0)) > jump
    return cv2.dilate(edges, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) > 0


def pixel_locking(result, truth):
    """
    Return how the error depends on the fractional part of the true disparity.

    The errors of visible smooth surfaces are averaged in 20 bins of the fraction, those farther
    than three robust standard deviations (and than 0.25 px) from the median of their bin left
    out; a periodic curve (Fourier series of third order) is fitted to the bins. Its peak to peak
    is the pixel locking. Bins count alike, so that one flat target does not decide.

    Returns
    -------
    figures : dict or None
        `peak_to_peak_px`, `fraction` (20 values 0..1) and `mean_px`, the curve itself; None
        unless all fractions occur often.

    """
    true = disparity_from_depth(truth.depth.astype(np.float64), result.geometry)
    errors = result.disparity - true
    mask = (truth.visible & np.isfinite(errors) & (np.abs(errors) < 1)
            & ~depth_edges(truth, result.geometry))
    index = (np.mod(true[mask], 1.0) * LOCKING_BINS).astype(int) % LOCKING_BINS
    if np.bincount(index, minlength=LOCKING_BINS).min() < LOCKING_SHARE * true.size:
        return None
    errors = errors[mask]
    means = np.array([_trimmed_mean(errors[index == i]) for i in range(LOCKING_BINS)])
    fraction = (np.arange(LOCKING_BINS) + 0.5) / LOCKING_BINS
    curve = np.linalg.lstsq(_harmonics(fraction), means, rcond=None)[0]
    return {'peak_to_peak_px': float(np.ptp(_harmonics(np.arange(200) / 200) @ curve)),
            'fraction': fraction.tolist(),
            'mean_px': (_harmonics(fraction) @ curve).tolist()}


def _trimmed_mean(values):
    center = np.median(values)
    near = np.abs(values - center) <= max(3 * robust_std(values), LEFT_OUT)
    return values[near].mean()


def _harmonics(fraction):
    angles = 2 * np.pi * fraction[:, None] * np.arange(1, LOCKING_ORDER + 1)
    return np.concatenate([np.ones((fraction.size, 1)), np.cos(angles), np.sin(angles)], axis=1)


def density_curve(result, truth, steps=20):
    """
    Return the errors that remain when only the most trusted pixels are kept.

    Returns
    -------
    curve : dict or None
        Lists `density` (share of the visible pixels), `bad_1` and `median_px`, from the most
        trusted 1/`steps` of the ranges to all of them; None if all are trusted equally.

    """
    known = truth.visible & np.isfinite(truth.depth)
    answered = known & np.isfinite(result.depth)
    trust = result.confidence[answered]
    if trust.size < steps or np.ptp(trust) == 0:
        return None
    errors = np.abs(disparity_errors(result, truth)[answered])
    errors = errors[np.argsort(-trust, kind='stable')]
    sizes = [trust.size * (i + 1) // steps for i in range(steps)]
    count = np.count_nonzero(known)
    return {'density': [size / count for size in sizes],
            'bad_1': [float(np.mean(errors[:size] > 1)) for size in sizes],
            'median_px': [float(np.median(errors[:size])) for size in sizes]}


def reliability(result, truth, bins=10):
    """
    Return whether, of the pixels with confidence c, a share c is right within 1 px.

    All ranges with a true depth count, the false ones of half-occluded regions too.

    Returns
    -------
    figures : dict or None
        Lists `confidence` (mean of each bin), `right` (share) and `pixels` (share of all
        ranges), and `calibration_error`, the mean absolute difference of the first two weighted
        with the third; None if all are trusted equally.

    """
    answered = np.isfinite(truth.depth) & np.isfinite(result.depth)
    trust = result.confidence[answered].astype(np.float64)
    if not trust.size or np.ptp(trust) == 0:
        return None
    right = np.abs(disparity_errors(result, truth)[answered]) <= 1
    index = np.clip((trust * bins).astype(int), 0, bins - 1)
    sizes = np.bincount(index, minlength=bins)
    used = sizes > 0
    means = np.bincount(index, trust, bins)[used] / sizes[used]
    shares = np.bincount(index, right, bins)[used] / sizes[used]
    weights = sizes[used] / trust.size
    return {'confidence': means.tolist(), 'right': shares.tolist(), 'pixels': weights.tolist(),
            'calibration_error': float(np.sum(weights * np.abs(means - shares)))}


def z_scores(result, truth):
    """
    Return the errors of the disparity in units of the standard deviation that came with them.

    Returns
    -------
    figures : dict or None
        `robust_std` (1 is honest, above 1 the standard deviations are too small), `mean` of the
        central 98 %, `within_2` (share, 0.954 is honest); None if the result has no standard
        deviations.

    """
    errors = disparity_errors(result, truth)
    with np.errstate(invalid='ignore', divide='ignore'):
        scores = errors / result.disparity_std
    scores = scores[truth.visible & np.isfinite(scores)]
    if scores.size < 100:
        return None
    low, high = np.percentile(scores, (1, 99))
    return {'robust_std': float(robust_std(scores)),
            'mean': float(np.mean(scores[(scores >= low) & (scores <= high)])),
            'within_2': float(np.mean(np.abs(scores) <= 2))}


def robust_std(values):
    """Return ROBUST_STD times the median absolute deviation, which outliers cannot move."""
    return ROBUST_STD * np.median(np.abs(values - np.median(values)))


def status_shares(result, truth):
    """Return for each `Status` name its share of all pixels and of the visible ones."""
    total, visible = result.status.size, np.count_nonzero(truth.visible)
    shares = {}
    for status in Status:
        mask = result.status == status
        shares[status.name] = {'all': np.count_nonzero(mask) / total,
                               'visible': np.count_nonzero(mask & truth.visible) / visible}
    return shares
