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
"""The lens models: the values of `distortion_model` in a camera_info."""

import cv2
import numpy as np

from ..registry import Registry

ITERATIONS = 100   # at most, to undo a distortion; chosen: a few suffice unless it folds
COEFFICIENT_DUST = 1e-6  # a coefficient that is no more counts as zero: 1e-6 focal lengths
PRECISION = 1e-12  # at which they end, as a part of the focal length; chosen: rounding is 1e-16
STEP = 1e-6        # of numeric derivatives; chosen: near the cube root of the rounding


class Lens:
    """
    Base of the lens models; an entry of `LENSES` is an instance of a subclass.

    Normalized image coordinates (X/Z, Y/Z), float64 (N, 2), are mapped to distorted ones, which
    the camera matrix K maps to pixels. A model needs `lengths` and `distort`; the other steps
    follow from it, and a subclass replaces one where a better way is known.

    """

    lengths = (0,)
    """Numbers of coefficients D that the model may have, increasing; 0 = no distortion."""

    def distort(self, rays, D):
        """
        Apply the distortion.

        Parameters
        ----------
        rays : numpy.ndarray, float64, shape (N, 2)
            Normalized coordinates X/Z and Y/Z.
        D : numpy.ndarray, float64
            Coefficients in the order of camera_info; empty or zero = none.

        Returns
        -------
        distorted : numpy.ndarray, float64, shape (N, 2)

        """
        raise NotImplementedError

    def undistort(self, pixels, K, D):
        """
        Return the rays that raw pixels see.

        Parameters
        ----------
        pixels : numpy.ndarray, float64, shape (N, 2)
            Column and row in the raw image.
        K : numpy.ndarray, float64, shape (3, 3)
            Camera matrix, px.
        D : numpy.ndarray, float64
            Distortion coefficients.

        Returns
        -------
        rays : numpy.ndarray, float64, shape (N, 2)
            Normalized coordinates.

        """
        target = (pixels - K[:2, 2]) @ np.linalg.inv(K[:2, :2]).T
        rays = target.copy()
        for _ in range(ITERATIONS):
            change = target - self.distort(rays, D)
            rays += change
            if np.abs(change).max(initial=0.0) < PRECISION:
                break
        return rays

    def project(self, points, intrinsics):
        """
        Project points, with the derivatives of their pixels.

        Parameters
        ----------
        points : numpy.ndarray, float64, shape (N, 3)
            m, raw camera; Z > 0.
        intrinsics : numpy.ndarray, float64, shape (4 + n,)
            fx, fy, cx, cy, px, and the n coefficients D.

        Returns
        -------
        pixels : numpy.ndarray, float64, shape (N, 2)
            Of the raw image.
        by_points : numpy.ndarray, float64, shape (N, 2, 3)
            Derivatives by the points, px/m.
        by_intrinsics : numpy.ndarray, float64, shape (N, 2, 4 + n)
            Derivatives by the intrinsics, px per unit.

        """
        focal, center, D = intrinsics[:2], intrinsics[2:4], intrinsics[4:]
        depth = points[:, 2:]
        rays = points[:, :2] / depth
        distorted = self.distort(rays, D)
        by_rays = np.stack([(self.distort(rays + step, D) - self.distort(rays - step, D))
                            / (2 * STEP) for step in STEP * np.eye(2)], axis=-1)
        by_D = [(self.distort(rays, D + step) - self.distort(rays, D - step)) / (2 * STEP)
                for step in STEP * np.eye(D.size)]
        by_rays *= focal[:, None]
        # d(X/Z, Y/Z) / d(X, Y, Z) = (I, -ray) / Z
        by_points = np.concatenate([by_rays, -by_rays @ rays[:, :, None]], -1) / depth[:, None]
        by_intrinsics = np.zeros((len(points), 2, intrinsics.size))
        by_intrinsics[:, [0, 1], [0, 1]] = distorted
        by_intrinsics[:, [0, 1], [2, 3]] = 1.0
        for index, change in enumerate(by_D):
            by_intrinsics[:, :, 4 + index] = focal * change
        return focal * distorted + center, by_points, by_intrinsics

    def rectifying_map(self, camera):
        """
        Return where each rectified pixel lies in the raw image.

        Parameters
        ----------
        camera : CameraModel
            One camera of the pair.

        Returns
        -------
        x, y : numpy.ndarray, float32, shape (H, W)
            Raw pixel coordinates; of any value where the ray lies behind the raw camera.

        """
        columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        points = np.stack([columns, rows, np.ones_like(rows)], axis=-1).reshape(-1, 3)
        # A row vector times A^-T is A^-1 times the column vector, here (P R)^-1.
        rays = points @ np.linalg.inv(camera.P[:, :3] @ camera.R).T
        with np.errstate(divide='ignore', invalid='ignore'):
            normalized = rays[:, :2] / rays[:, 2:]
        distorted = self.distort(normalized, camera.D)
        raw = distorted @ camera.K[:2, :2].T + camera.K[:2, 2]
        x, y = raw.T.reshape(2, camera.height, camera.width).astype(np.float32)
        return x, y

    def rectified_views(self, left, right, rotation, translation):
        """
        Choose the rectified cameras of a pair; here those of the pair without distortion.

        Parameters
        ----------
        left, right : CameraModel
            Of which R and P are unknown yet.
        rotation : numpy.ndarray, float64, shape (3, 3)
            X_right = R X_left + t.
        translation : numpy.ndarray, float64, shape (3, 1)
            X_right = rotation X_left + translation, m.

        Returns
        -------
        views : ((R, P), (R, P))
            Of both cameras, as in camera_info.

        """
        return _views(cv2.stereoRectify, left, right, np.zeros(4), np.zeros(4), rotation,
                      translation, alpha=0.0)


class Pinhole(Lens):
    """OpenCV's polynomial of the distance from the axis and what it adds to that."""

    def __init__(self, lengths):
        """Tell how many coefficients the model may have."""
        self.lengths = lengths

    def distort(self, rays, D):
        """Apply the distortion; see `Lens.distort`."""
        if not np.any(D):
            return rays
        points = np.column_stack([rays, np.ones(len(rays))])
        return cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), D)[0][:, 0]

    def undistort(self, pixels, K, D):
        """Return the rays that raw pixels see; see `Lens.undistort`."""
        pixels, K = _without_skew(pixels, K)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, ITERATIONS, PRECISION)
        if hasattr(cv2, 'undistortPointsIter'):
            return cv2.undistortPointsIter(pixels[None], K, D, np.eye(3), np.eye(3),
                                           criteria)[:, 0]
        return cv2.undistortPoints(pixels[None], K, D, None, None, None, criteria)[:, 0]

    def project(self, points, intrinsics):
        """Project points with derivatives; see `Lens.project`."""
        D = intrinsics[4:]
        pixels, by_all = cv2.projectPoints(
            np.ascontiguousarray(points), np.zeros(3), np.zeros(3), _matrix(intrinsics),
            _coefficients(D))
        # columns: rotation, translation, focal lengths, center, coefficients
        by_all = by_all.reshape(-1, 2, by_all.shape[1])
        return pixels[:, 0], by_all[:, :, 3:6], by_all[:, :, 6:10 + D.size]

    def rectifying_map(self, camera):
        """Return where each rectified pixel lies; see `Lens.rectifying_map`."""
        return _map(cv2.initUndistortRectifyMap, camera)

    def rectified_views(self, left, right, rotation, translation):
        """Choose views without black borders where possible; see `Lens.rectified_views`."""
        return _views(cv2.stereoRectify, left, right, _coefficients(left.D),
                      _coefficients(right.D), rotation, translation, alpha=0.0)


class Equidistant(Lens):
    """OpenCV's fisheye: a polynomial of the angle from the axis."""

    lengths = (0, 4)

    def distort(self, rays, D):
        """Apply the distortion; see `Lens.distort`."""
        return cv2.fisheye.distortPoints(rays[None], np.eye(3), _coefficients(D))[0]

    def undistort(self, pixels, K, D):
        """Return the rays that raw pixels see; see `Lens.undistort`."""
        pixels, K = _without_skew(pixels, K)
        return cv2.fisheye.undistortPoints(pixels[None], K, _coefficients(D))[0]

    def project(self, points, intrinsics):
        """Project points with derivatives; see `Lens.project`."""
        D = intrinsics[4:]
        pixels, by_all = cv2.fisheye.projectPoints(
            np.ascontiguousarray(points[None]), np.zeros(3), np.zeros(3), _matrix(intrinsics),
            _coefficients(D))
        # columns: focal lengths, center, four coefficients, rotation, translation, skew
        by_all = by_all.reshape(-1, 2, by_all.shape[1])
        return pixels.reshape(-1, 2), by_all[:, :, 11:14], by_all[:, :, :4 + D.size]

    def rectifying_map(self, camera):
        """Return where each rectified pixel lies; see `Lens.rectifying_map`."""
        return _map(cv2.fisheye.initUndistortRectifyMap, camera)

    def rectified_views(self, left, right, rotation, translation):
        """Choose views without black borders where possible; see `Lens.rectified_views`."""
        return _views(cv2.fisheye.stereoRectify, left, right, _coefficients(left.D),
                      _coefficients(right.D), rotation, translation, balance=0.0)


def coefficients_of(lens, D):
    """
    Return the coefficients of a lens in a number that the lens knows.

    Missing ones are zero. Zeros behind the last coefficient of the lens are dropped.

    Parameters
    ----------
    lens : Lens
        The model of the lens.
    D : numpy.ndarray, float64, shape (n,)
        Distortion coefficients.

    Returns
    -------
    D : numpy.ndarray, float64
        Longer than `lens.lengths[-1]` only where the lens does not have one of the values.

    """
    longer = [length for length in lens.lengths if length >= D.size]
    if longer:
        return np.concatenate([D, np.zeros(longer[0] - D.size)])
    beyond = np.abs(D[lens.lengths[-1]:]) > COEFFICIENT_DUST
    return D if beyond.any() else D[:lens.lengths[-1]]


def _coefficients(D):
    """Return coefficients for OpenCV, which takes no empty array."""
    return D.copy() if D.size else np.zeros(4)


def _matrix(intrinsics):
    """Return the camera matrix (3, 3) of fx, fy, cx, cy."""
    fx, fy, cx, cy = intrinsics[:4]
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _straight(K):
    """Return a camera matrix without its skew: OpenCV reads only focal lengths and center."""
    straight = K.copy()
    straight[0, 1] = 0.0
    return straight


def _without_skew(pixels, K):
    """Return the pixels that a camera without skew would see, and its camera matrix."""
    if K[0, 1] == 0:
        return pixels, K
    # u = fx x + s y + cx and v = fy y + cy, with x and y the distorted coordinates
    lean = K[0, 1] / K[1, 1] * (pixels[:, 1] - K[1, 2])
    return pixels - np.stack([lean, np.zeros_like(lean)], axis=1), _straight(K)


def _map(init_maps, camera):
    """Return the columns and rows, float32 (H, W), px, of a function of OpenCV for a camera."""
    x, y = init_maps(_straight(camera.K), _coefficients(camera.D), camera.R.copy(),
                     camera.P[:, :3].copy(), (camera.width, camera.height), cv2.CV_32FC1)
    if camera.K[0, 1] != 0:
        x += np.float32(camera.K[0, 1] / camera.K[1, 1]) * (y - np.float32(camera.K[1, 2]))
    return x, y


def _views(rectify, left, right, D_left, D_right, rotation, translation, **fit):
    """Return R (3, 3) and P (3, 4), float64, of both views from a function of OpenCV."""
    R_left, R_right, P_left, P_right = rectify(
        _straight(left.K), D_left, _straight(right.K), D_right, (left.width, left.height),
        rotation, translation, flags=0, **fit)[:4]
    return (R_left, P_left), (R_right, P_right)


LENSES = Registry('distortion model', Lens, {
    'plumb_bob': Pinhole((0, 4, 5)),
    'rational_polynomial': Pinhole((0, 8, 12, 14)),
    'equidistant': Equidistant(),
})
"""Lens by distortion_model; their order is that of all lists."""
