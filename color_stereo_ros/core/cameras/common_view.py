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
"""What both cameras of a pair see, and rectified cameras that keep it."""

import numpy as np

from .lenses import LENSES
from ...errors import CalibrationError

SAMPLES = (33, 25)           # rays of a raw image, columns and rows
BASELINES = (0.25, 64.0)     # depths at which views are compared, baselines
DEPTHS = 33
LEAST_SHARE = 0.25           # of the common view; chosen: OpenCV keeps half or next to nothing
OUTLIERS = (2.5, 97.5)       # percentiles of a view that bound it: corners reach far
BESIDE = 1e-3                # least Z of a ray of length 1 that a rectified image can hold
PIXEL = 0.5                  # px that a raw image reaches beyond the centers of its last pixels
LOST_SHARE = 0.01            # of the common view that equal cx may cost; chosen: noise of sampling


class Sampled:
    """Rays of one raw image, and whether points fall into it."""

    def __init__(self, camera):
        """Take a CameraModel of which R and P are not used."""
        self.camera = camera
        self.lens = LENSES[camera.distortion_model]
        self.last = np.array([camera.width - 1, camera.height - 1], np.float64)
        axes = [np.linspace(0, last, count) for last, count in zip(self.last, SAMPLES)]
        pixels = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        normalized = self.lens.undistort(pixels, camera.K, camera.D)
        self.rays = np.column_stack([normalized, np.ones(len(normalized))])
        # beyond the corners a distortion may fold back into the image
        self.reach = np.abs(normalized).max(axis=0) * (1 + BESIDE)

    def sees(self, points, margin=0.0):
        """Return whether points (N, 3) of the raw camera fall into its image, bool (N,); px."""
        rays = projected(points)
        regular = (np.abs(rays) <= self.reach).all(axis=1)  # False for NaN
        K = self.camera.K
        pixels = self.lens.distort(np.where(regular[:, None], rays, 0.0), self.camera.D)
        pixels = pixels @ K[:2, :2].T + K[:2, 2]
        return regular & inside(pixels, self.last, margin)


def projected(points):
    """Return X/Z and Y/Z of points (N, 3), float64 (N, 2); NaN beside and behind the camera."""
    near = BESIDE * np.linalg.norm(points, axis=1)
    depth = np.where(points[:, 2] > near, points[:, 2], np.nan)
    return points[:, :2] / depth[:, None]


def inside(pixels, last, margin=0.0):
    """Return whether pixels (N, 2) lie between (0, 0) and the last one; False for NaN."""
    return ((pixels >= -margin) & (pixels <= last + margin)).all(axis=1)


def kept_share(left, right, rotation, translation, views):
    """
    Return how much of the common view rectified cameras keep.

    Parameters
    ----------
    left, right : Sampled
        Both cameras, as sampled on a grid.
    rotation : numpy.ndarray, float64, shape (3, 3)
        X_right = R X_left + t.
    translation : numpy.ndarray, float64, shape (3, 1)
        X_right = rotation X_left + translation, m.
    views : ((R, P), (R, P))
        The rectified cameras.

    Returns
    -------
    share : float
        Largest share of the left image that both rectified images hold at one depth, divided by
        the largest share that both raw images hold at one; NaN if they hold none.

    """
    if not all(np.isfinite(P).all() and P[0, 0] > 0 for _, P in views):
        return 0.0
    most, kept = 0.0, 0.0
    for depth in np.linalg.norm(translation) * np.geomspace(*BASELINES, DEPTHS):
        points = depth * left.rays
        opposite = points @ rotation.T + translation.ravel()
        common = right.sees(opposite)
        held = common.copy()
        for each, (R, P) in zip((points, opposite), views):
            pixels = projected(each @ R.T) * P[[0, 1], [0, 1]] + P[:2, 2]
            held &= inside(pixels, left.last)
        most, kept = max(most, common.mean()), max(kept, held.mean())
    return kept / most if most else float('nan')


def with_common_view(left, right, rotation, translation, views):
    """
    Return rectified cameras that keep what both cameras see.

    Parameters
    ----------
    left, right : CameraModel
        Of which R and P are unknown yet.
    rotation : numpy.ndarray, float64, shape (3, 3)
        X_right = R X_left + t.
    translation : numpy.ndarray, float64, shape (3, 1)
        X_right = rotation X_left + translation, m.
    views : ((R, P), (R, P))
        Those of the lens. They are returned unless they lose the common view: OpenCV scales a
        view about its principal point, which strongly converging cameras have outside of it.

    Returns
    -------
    views : ((R, P), (R, P))

    Raises
    ------
    CalibrationError
        If no point is seen by both cameras.

    """
    sampled = Sampled(left), Sampled(right)
    share = kept_share(*sampled, rotation, translation, views)
    if share >= LEAST_SHARE:
        return views
    if share == share:  # not NaN
        wide = _fitted(sampled, translation, [R for R, _ in views])
        if wide is not None and kept_share(*sampled, rotation, translation, wide) > share:
            return wide
        if share > 0:
            return views
    raise CalibrationError(
        f't = {translation.ravel().tolist()} m and R = {rotation.ravel().tolist()} leave no view '
        f'that both cameras share between {BASELINES[0]} and {BASELINES[1]:.0f} baselines: are R '
        'and t those of X_right = R X_left + t?')


def with_equal_centers(left, right, rotation, translation, views):
    """
    Return rectified cameras with the same cx where that costs nothing.

    Other nodes understand such a pair better. The images of both cameras move by half of the
    difference, towards each other. That must leave both rectified images as full as before, and
    keep what both cameras see but for LOST_SHARE; nearly parallel cameras allow it.

    Parameters
    ----------
    left, right : CameraModel
        Of which R and P are unknown yet.
    rotation : numpy.ndarray, float64, shape (3, 3)
        X_right = R X_left + t.
    translation : numpy.ndarray, float64, shape (3, 1)
        t of X_right = R X_left + t, m.
    views : ((R, P), (R, P))
        Of the rectified cameras, left and right.

    Returns
    -------
    views : ((R, P), (R, P))

    """
    centers = [P[0, 2] for _, P in views]
    if centers[0] == centers[1]:
        return views
    equal = tuple((R, P.copy()) for R, P in views)
    for _, P in equal:
        P[0, 2] = sum(centers) / 2
    sampled = Sampled(left), Sampled(right)
    if any(_empty_border(*before) < _empty_border(*after)
           for before, after in zip(zip(sampled, views), zip(sampled, equal))):
        return views
    before, after = (kept_share(*sampled, rotation, translation, each) for each in (views, equal))
    return equal if after >= (1 - LOST_SHARE) * before else views


def _empty_border(camera, view):
    """Return how many pixels at the border of a rectified image its raw image does not fill."""
    (R, P), (width, height) = view, camera.last + 1
    columns, rows = np.arange(width), np.arange(height)
    border = np.concatenate([
        np.column_stack([columns, np.full(columns.shape, row)]) for row in (0, height - 1)] + [
        np.column_stack([np.full(rows.shape, column), rows]) for column in (0, width - 1)])
    rays = np.column_stack([(border - P[:2, 2]) / P[[0, 1], [0, 1]], np.ones(len(border))])
    return np.count_nonzero(~camera.sees(rays @ R, PIXEL))


def _fitted(sampled, translation, rotations):
    """Return views that hold nearly all of both images; equal cx where that costs nothing."""
    rays = [projected(each.rays @ R.T) for each, R in zip(sampled, rotations)]
    if any(np.isnan(each).mean() > 0.5 for each in rays):
        return None
    low, high = np.nanpercentile(rays, OUTLIERS, axis=1)  # (camera, x and y)
    last = sampled[0].last
    top, bottom = low[:, 1].min(), high[:, 1].max()
    raw = min(each.camera.K[index, index] for each in sampled for index in (0, 1))
    focal = min(raw, last[0] / (high - low)[:, 0].max(), last[1] / (bottom - top))
    left_end, right_end = low[:, 0].min(), high[:, 0].max()
    middles = (high + low)[:, 0] / 2
    if focal * (right_end - left_end) <= last[0]:
        middles = np.full(2, (left_end + right_end) / 2)
    baseline = np.linalg.norm(translation)
    return tuple(
        (R, np.array([[focal, 0, last[0] / 2 - focal * middle, shift],
                      [0, focal, last[1] / 2 - focal * (top + bottom) / 2, 0],
                      [0, 0, 1, 0]], np.float64))
        for R, middle, shift in zip(rotations, middles, (0.0, -focal * baseline)))
