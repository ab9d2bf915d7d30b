# SPDX-License-Identifier: Apache-2.0
"""The frozen data that flows through the core, the status codes, and the one exception family."""

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np


class ColorStereoError(ValueError):
    """Base of every error that this package raises on purpose; its text names value and range."""


class SettingsError(ColorStereoError):
    """A setting has a wrong type, lies outside its range, or contradicts another one."""


class CalibrationError(ColorStereoError):
    """A stereo calibration is missing, malformed or physically impossible."""


class ImageError(ColorStereoError):
    """An image has the wrong size, type or encoding."""


class RecordingError(ColorStereoError):
    """A recording or a result file cannot be read or written."""


class Status(IntEnum):
    """Why a pixel has no range; the values of the `status/image` topic."""

    VALID = 0
    OUTSIDE_IMAGE = 1
    DARK = 2
    SATURATED = 3
    NO_MATCH = 4
    AMBIGUOUS = 5
    INCONSISTENT = 6
    OUT_OF_RANGE = 7
    IMPLAUSIBLE = 8

    @property
    def label(self):
        """Return the name as people write it, for example 'out of range'."""
        return self.name.lower().replace('_', ' ')

    @property
    def meaning(self):
        """Return one sentence for people."""
        return STATUS_MEANINGS[self]


STATUS_MEANINGS = {
    Status.VALID: 'the pixel has a range',
    Status.OUTSIDE_IMAGE: 'the rectified pixel lies outside the raw left image',
    Status.DARK: 'too little pattern light: shadow, dark surface, or outside the projection',
    Status.SATURATED: 'a color channel is overexposed',
    Status.NO_MATCH: 'no similar color within the disparity limits',
    Status.AMBIGUOUS: 'several places match equally well, or the colors are too uniform',
    Status.INCONSISTENT: 'left and right disagree: seen by the left camera only',
    Status.OUT_OF_RANGE: 'the match lies outside range.min_depth .. range.max_depth',
    Status.IMPLAUSIBLE: 'the match does not fit the surface around it',
}


@dataclass(frozen=True)
class RectifiedGeometry:
    """
    The geometry of a rectified pair: x_left - x_right = focal_x * baseline / Z + principal_offset.

    Pixel (0, 0) is the center of the top-left pixel.

    """

    width: int
    """Columns, px."""
    height: int
    """Rows, px."""
    focal_x: float
    """P[0, 0] of both cameras, px."""
    focal_y: float
    """P[1, 1] of both cameras, px."""
    center_x_left: float
    """P[0, 2] of the left camera, px."""
    center_x_right: float
    """P[0, 2] of the right camera, px."""
    center_y: float
    """P[1, 2] of both cameras, px."""
    baseline: float
    """Distance of the optical centers, m, > 0."""

    @property
    def principal_offset(self):
        """Return cx_left - cx_right, px: the disparity of a point at infinity."""
        return self.center_x_left - self.center_x_right

    @property
    def focal_baseline(self):
        """Return focal length times baseline, px m."""
        return self.focal_x * self.baseline


@dataclass(frozen=True, eq=False)
class RectifiedPair:
    """Two color images whose epipolar lines are the image rows."""

    left: np.ndarray
    """uint8 (H, W, 3), RGB; 0 outside the raw image."""
    right: np.ndarray
    """uint8 (H, W, 3), RGB; 0 outside the raw image."""
    left_inside: np.ndarray
    """bool (H, W): the rectified pixel lies inside the raw left image."""
    right_inside: np.ndarray
    """bool (H, W): the rectified pixel lies inside the raw right image."""
    geometry: RectifiedGeometry


@dataclass(frozen=True, eq=False)
class Match:
    """What a matching method finds for one rectified pair, in pixels of the left image."""

    disparity: np.ndarray
    """float32 (H, W), x_left - x_right in px, NaN = unknown."""
    disparity_std: np.ndarray
    """float32 (H, W), standard deviation of the disparity in px, NaN = unknown."""
    confidence: np.ndarray
    """float32 (H, W), 0..1: the probability of being right within 1 px; 0 = unknown."""
    status: np.ndarray
    """uint8 (H, W), a `Status` code; 0 exactly where the disparity is finite."""


@dataclass(frozen=True, eq=False)
class Measurement(Match):
    """A match and what follows from it by triangulation."""

    depth: np.ndarray
    """float32 (H, W), meters along Z of the rectified left camera, NaN = unknown."""


@dataclass(frozen=True, eq=False)
class RangeResult:
    """What one pair of images gives, in the frame and pixels of the rectified left camera."""

    disparity: np.ndarray
    """float32 (H, W), x_left - x_right in px, NaN = unknown."""
    depth: np.ndarray
    """float32 (H, W), meters along Z of the rectified left camera, NaN = unknown."""
    confidence: np.ndarray
    """float32 (H, W), 0..1: the probability of being right within 1 px; 0 = unknown."""
    status: np.ndarray
    """uint8 (H, W), a `Status` code; 0 exactly where depth is finite."""
    disparity_std: np.ndarray
    """float32 (H, W), standard deviation of the disparity in px, NaN = unknown."""
    image_source: object
    """The rectified left image, uint8 (H, W, 3), RGB, or a function that makes it when asked."""
    geometry: RectifiedGeometry
    disparity_limits: tuple
    """(smallest, largest) disparity searched, px, from range.min_depth and range.max_depth."""
    seconds: dict = field(default_factory=dict)
    """Duration of each stage, s."""

    @cached_property
    def image(self):
        """Return the rectified left image, uint8 (H, W, 3), RGB."""
        return self.image_source() if callable(self.image_source) else self.image_source

    @cached_property
    def depth_std(self):
        """Return the standard deviation of the depth, float32 (H, W), m, NaN = unknown."""
        # Z = f B / (d - d0)  =>  dZ = Z^2 / (f B) dd
        return self.depth * self.depth * self.disparity_std / np.float32(
            self.geometry.focal_baseline)

    @property
    def density(self):
        """Return the share of all pixels that have a range, 0..1."""
        return float(np.count_nonzero(self.status == Status.VALID)) / self.status.size

    def points(self):
        """
        Return the points in the rectified left camera.

        Returns
        -------
        points : numpy.ndarray, float32, shape (H, W, 3)
            x right, y down, z forward, m; NaN = unknown.

        """
        from .triangulation import points_from_depth
        return points_from_depth(self.depth, self.geometry)
