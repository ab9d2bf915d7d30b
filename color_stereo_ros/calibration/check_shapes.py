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
How exact a measured plane or a sphere bar is, in the terms of VDI/VDE 2634 part 2.

    flatness measurement error    range of the signed distances of the points from the best plane
    probing error, form           range of the radial distances from the best sphere
    probing error, size           measured minus true diameter
    sphere-spacing error          measured minus true distance of the centers

The plane is that of least squares, and so is the sphere, whose radius is free. As the guideline
allows, up to 3 of 1,000 points are left out of a range. Points that lie beside the object, off by
more than a pixel of the plane or .15 radii of the sphere, are left out before that, and points
off by four standard deviations do not count in the fit of the sphere: the guideline does not
allow these. It asks for several positions in the volume and for calibrated artifacts: figures
from one position are of its kind, and no claim of conformity.

"""

from dataclasses import dataclass

import cv2
import numpy as np

from ..core.constants import ROBUST_STD
from ..errors import CalibrationError

REJECTED = 0.003  # share of the points; given: VDI/VDE 2634 part 2
GATE = 1.0  # px of disparity; chosen: what is farther off is no point of the plane
TRIALS, SAMPLE = 300, 1500  # of three points, of points; chosen: half of them may be others
LEAST_POINTS = 1000  # chosen: a board that fills a twentieth of a small image has more
LEAST_SHARE = 0.3  # of the ranges; chosen: a board that fills the view has nearly all
BLOCK = 16  # px; chosen: noise averages out, the shape stays
WITHIN = 68.27  # percent of a normal distribution lie within one standard deviation
STEEP = np.cos(np.radians(60))  # chosen: seen from the side a sphere is measured badly
VOXEL = 0.2  # radii; chosen: normals point to the center within this
CANDIDATE = 0.15  # radii; chosen: so near to the surface lie the points of a sphere


@dataclass(frozen=True, eq=False)
class Plane:
    """A measured plane."""

    coefficients: np.ndarray
    """float64 (3,): disparity in px = a + b column + c row."""
    inside: np.ndarray
    """bool (H, W): pixels of the board, those without a range included."""
    residual_mm: np.ndarray
    """float32 (H, W), signed distance from the best plane, mm, + = towards the camera; NaN."""
    rms_mm: float
    rms_px: float
    """The same in disparity, px."""
    claim_ratio: float
    """68 % of the points are off by at most so many of their claimed standard deviations."""
    claimed_px: float
    """Median of the claimed standard deviations of the disparity, px."""
    claimed_wrong: float
    """Share of the ranges that should be off by more than a pixel, by their confidence."""
    flatness_mm: float
    """Flatness measurement error."""
    shape_mm: float
    """Root mean square of the means of blocks: what noise does not explain."""
    density: float
    """Share of the pixels of the board that have a range."""
    outliers: float
    """Share of the ranges on the board that are off by more than a pixel."""
    distance_mm: float
    """Of the plane from the rectified left camera along its optical axis."""
    tilt_degrees: float
    """Between the normal of the plane and the optical axis."""


def measured_plane(result):
    """
    Fit a plane to a board that fills most of the view.

    Parameters
    ----------
    result : RangeResult
        Of the pair.

    Returns
    -------
    plane : Plane

    Raises
    ------
    CalibrationError
        If there are too few ranges, or they lie on no plane.

    """
    known = np.isfinite(result.disparity)
    rows, columns = np.nonzero(known)
    if rows.size < LEAST_POINTS:
        raise CalibrationError(f'{rows.size} pixels have a range: too few to judge a plane')
    values = result.disparity[known].astype(np.float64)
    design = np.column_stack([np.ones(rows.size), columns, rows]).astype(np.float64)
    plane, keep = _plane_of(design, values)
    if keep.mean() < LEAST_SHARE:
        raise CalibrationError(f'{keep.mean():.0%} of the ranges lie on one plane: a flat board '
                               'must fill most of the view')
    on_plane = np.zeros(known.shape, bool)
    on_plane[rows[keep], columns[keep]] = True
    inside = _hull(on_plane)
    return _described(result, plane, on_plane & inside, inside)


def _plane_of(design, values):
    """Return the coefficients of the plane that most points lie on, and which these are."""
    rng = np.random.default_rng(0)
    few = rng.choice(len(values), min(SAMPLE, len(values)), replace=False)
    best, most = None, -1
    for _ in range(TRIALS):
        three = rng.choice(few, 3, replace=False)
        try:
            plane = np.linalg.solve(design[three], values[three])
        except np.linalg.LinAlgError:
            continue
        count = np.count_nonzero(np.abs(values[few] - design[few] @ plane) < GATE)
        if count > most:
            best, most = plane, count
    if best is None:
        raise CalibrationError('the ranges lie on no plane')
    for _ in range(3):
        keep = np.abs(values - design @ best) < GATE
        best = np.linalg.lstsq(design[keep], values[keep], rcond=None)[0]
    return best, np.abs(values - design @ best) < GATE


def _hull(mask):
    """Return the convex hull of the largest piece of a mask."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, np.ones((9, 9), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(opened)
    if len(stats) < 2:
        return mask
    largest = labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])
    points = np.argwhere(largest)[:, ::-1].astype(np.int32)
    drawn = np.zeros(mask.shape, np.uint8)
    cv2.fillConvexPoly(drawn, cv2.convexHull(points), 1)
    return drawn.astype(bool)


def _described(result, plane, used, inside):
    cloud = result.points()[used].astype(np.float64)
    middle = cloud.mean(axis=0)
    normal = np.linalg.eigh((cloud - middle).T @ (cloud - middle))[1][:, 0]
    normal = normal * -np.sign(normal[2])  # towards the camera
    distances = 1e3 * (cloud - middle) @ normal
    residual = np.full(used.shape, np.nan, np.float32)
    residual[used] = distances
    rows, columns = np.nonzero(used)
    pixels = result.disparity[used] - np.column_stack([np.ones(rows.size), columns, rows]) @ plane
    answered = np.isfinite(result.disparity) & inside
    spread_px = result.disparity_std[used].astype(np.float64)
    ray = np.array([0.0, 0.0, 1.0])
    return Plane(plane, inside, residual, _rms(distances), _rms(pixels),
                 float(np.percentile(np.abs(pixels) / spread_px, WITHIN)),
                 float(np.median(spread_px)), float(1 - result.confidence[answered].mean()),
                 spread(distances), _rms(_block_means(residual)),
                 float(answered.sum() / inside.sum()),
                 float(1 - used.sum() / max(answered.sum(), 1)),
                 float(1e3 * (middle @ normal) / (ray @ normal)),
                 float(np.degrees(np.arccos(min(1.0, abs(normal[2]))))))


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float('nan')


def spread(values):
    """Return the range of values, 3 of 1,000 of them left out, those farthest off."""
    order = np.argsort(np.abs(values - np.median(values)))
    kept = values[order[:len(values) - int(REJECTED * len(values))]]
    return float(kept.max() - kept.min())


def _block_means(residual):
    """Return the means of blocks of pixels that are known for the most part."""
    height, width = (BLOCK * (size // BLOCK) for size in residual.shape)
    blocks = residual[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK)
    count = np.isfinite(blocks).sum(axis=(1, 3))
    means = np.nansum(blocks, axis=(1, 3)) / np.maximum(count, 1)
    return means[count > BLOCK * BLOCK / 2]


@dataclass(frozen=True, eq=False)
class Sphere:
    """A measured sphere."""

    center: np.ndarray
    """float64 (3,), m, rectified left camera."""
    radius_mm: float
    form_mm: float
    """Probing error, form."""
    size_mm: float
    """Probing error, size."""
    rms_mm: float
    claimed_mm: float
    """Median of the claimed standard deviations of its points, along the radius."""
    points: int


def measured_spheres(result, radius):
    """
    Find and fit the two spheres of a bar.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    radius : float
        True radius, m.

    Returns
    -------
    spheres : (Sphere, Sphere)
        From left to right.

    Raises
    ------
    CalibrationError
        If two spheres of this radius are not there.

    """
    points, normals = result.points(), result.normals()
    known = np.isfinite(points).all(axis=-1) & np.isfinite(normals).all(axis=-1)
    points = points[known].astype(np.float64)
    normals = normals[known].astype(np.float64)
    facing = -np.einsum('ni,ni->n', normals, points) / np.linalg.norm(points, axis=1) > STEEP
    # an error of the depth moves a point along its ray; the part along the normal counts
    along = np.abs(np.einsum('ni,ni->n', normals, points)) / points[:, 2]
    claimed = (along * result.depth_std[known])[facing]
    points, normals = points[facing], normals[facing]
    centers = points - radius * normals
    found = []
    for _ in range(2):
        center = _densest(centers, radius)
        if center is None:
            break
        near = np.abs(np.linalg.norm(points - center, axis=1) - radius) < CANDIDATE * radius
        near &= np.linalg.norm(centers - center, axis=1) < radius
        if near.sum() < LEAST_POINTS / 4:
            break
        found.append(_sphere(points[near], center, radius, claimed[near]))
        apart = np.linalg.norm(points - found[-1].center, axis=1) > 1.5 * radius
        points, centers, claimed = points[apart], centers[apart], claimed[apart]
    if len(found) < 2:
        raise CalibrationError(f'{len(found)} of two spheres of radius {1e3 * radius:g} mm found: '
                               'are they whole in the view of both cameras, dull and bright?')
    return tuple(sorted(found, key=lambda sphere: sphere.center[0]))


def _densest(centers, radius):
    """Return where most of the possible centers lie, or None."""
    if not len(centers):
        return None
    cells = np.floor(centers / (VOXEL * radius)).astype(np.int64)
    _, inverse, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    center = np.median(centers[inverse.ravel() == np.argmax(counts)], axis=0)
    for _ in range(5):
        near = np.linalg.norm(centers - center, axis=1) < 2 * VOXEL * radius
        center = np.median(centers[near], axis=0)
    return center


def _sphere(points, center, radius, claimed):
    """Return the Sphere of least squares; points off by three standard deviations are left."""
    unknown = np.append(center, radius)
    keep = np.ones(len(points), bool)
    for _ in range(20):
        offset = points - unknown[:3]
        length = np.linalg.norm(offset, axis=1)
        residual = length - unknown[3]
        scale = ROBUST_STD * np.median(np.abs(residual - np.median(residual)))
        keep = np.abs(residual - np.median(residual)) <= max(4 * scale, 1e-9)
        jacobian = np.column_stack([offset / length[:, None], np.ones(len(points))])[keep]
        step = np.linalg.lstsq(jacobian, residual[keep], rcond=None)[0]
        unknown = unknown + step
        if np.abs(step).max() < 1e-9:
            break
    distances = 1e3 * (np.linalg.norm(points - unknown[:3], axis=1) - unknown[3])
    gated = distances[np.abs(distances) < 1e3 * CANDIDATE * radius]
    return Sphere(unknown[:3], float(1e3 * unknown[3]), spread(gated),
                  float(2e3 * (unknown[3] - radius)), _rms(gated),
                  float(1e3 * np.median(claimed)), int(gated.size))
