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
"""What a rig will measure before it is built: depth error, disparities, common field of view."""

from dataclasses import dataclass

import cv2
import numpy as np

from .guidance import Detectable, first_information, grid_of, Guide, Quality
from .least_squares import inverse_information
from ..core.cameras.covariance import depth_derivatives, rectified_derivatives
from ..core.cameras.parameters import StereoParameters
from ..core.triangulation import disparity_from_depth
from ..errors import CalibrationError

COEFFICIENTS = 5     # of the lens that will be calibrated: plumb_bob
DEPTHS = 25          # at which the plan is computed, near to far
FEATURE = 4.8        # px in the image: the size of the pattern's structures in docs/hardware.md
DISPARITY_STD = 0.05  # px, of matching: what a rig in order claims of a pixel
ROWS_LIMIT = 0.24    # px: so far rows may be off before a 2-D pattern loses density, measured


@dataclass(frozen=True)
class Rig:
    """
    A rig as it is drawn.

    Raises
    ------
    CalibrationError
        If a value is impossible; names value and expected range.

    """

    baseline: float
    """Distance of the cameras, m."""
    focal: float
    """Focal length, px."""
    size: tuple
    """(width, height) of the images, px."""
    near: float
    """Nearest depth, m."""
    far: float
    """Farthest depth, m."""
    aim: float = 0.0
    """Depth at which the axes of the cameras cross, m; 0 = parallel cameras."""

    def __post_init__(self):
        """Refuse impossible values."""
        for name, unit in (('baseline', 'm'), ('focal', 'px'), ('near', 'm')):
            if not 0 < getattr(self, name) < np.inf:
                raise CalibrationError(f'{name} = {getattr(self, name)} {unit}, expected > 0')
        if not self.near < self.far < np.inf:
            raise CalibrationError(f'far = {self.far} m, expected more than near = {self.near} m')
        if not 0 <= self.aim < np.inf:
            raise CalibrationError(f'aim = {self.aim} m, expected 0 (parallel) or more')

    @property
    def middle(self):
        """Return the depth for which views are chosen: the geometric mean of the limits, m."""
        return float(np.sqrt(self.near * self.far))

    @property
    def convergence(self):
        """Return the angle between the axes of the cameras, rad."""
        return 2 * np.arctan2(self.baseline / 2, self.aim) if self.aim else 0.0

    def parameters(self):
        """Return the StereoParameters of the drawing: equal lenses without distortion."""
        width, height = self.size
        lens = [self.focal, self.focal, (width - 1) / 2, (height - 1) / 2] + [0.0] * COEFFICIENTS
        half = self.convergence / 2
        rotation = np.array([0.0, 2 * half, 0.0])
        center = self.baseline * np.array([np.cos(half), 0.0, np.sin(half)])
        return StereoParameters(self.size, 'plumb_bob', lens, lens, rotation,
                                -cv2.Rodrigues(rotation)[0] @ center)


@dataclass(frozen=True, eq=False)
class Plan:
    """What a rig will measure; arrays are over `depth`."""

    rig: Rig
    depth: np.ndarray
    """float64 (n,), m, near to far."""
    disparity: np.ndarray
    """float64 (n,), px."""
    matching_std: np.ndarray
    """float64 (n,), m: scatter of a pixel's depth that matching leaves."""
    calibration_std: np.ndarray
    """float64 (n,), m: error that all pixels around share, of the calibration after the views."""
    common_width: np.ndarray
    """float64 (n,), m: what both cameras see, in the middle of its height; 0 = nothing."""
    common_height: np.ndarray
    """float64 (n,), m."""
    common_share: np.ndarray
    """float64 (n,): share of the rectified left image that both cameras see."""
    rows_std: float
    """px, of the rows at the middle depth, root mean square over the image."""
    views: int
    """Guided views of the board that the calibration is based on."""

    @property
    def total_std(self):
        """Return the standard deviation of the depth, m, float64 (n,)."""
        return np.hypot(self.matching_std, self.calibration_std)


def plan(rig, corners, views=15, disparity_std=DISPARITY_STD, corner_sigma=0.05,
         detectable=None):
    """
    Plan a rig.

    The covariance is that of a calibration with guided views of a board.

    Parameters
    ----------
    rig : Rig
        The cameras that are planned.
    corners : numpy.ndarray, float64, shape (N, 3)
        m, of the board.
    views : int
        Guided views of the board.
    disparity_std : float
        px, of matching.
    corner_sigma : float
        px, of a corner of the board.
    detectable : Detectable, optional
        Which views of the board are detected; default: all that lie in the image.

    Returns
    -------
    plan : Plan

    Raises
    ------
    CalibrationError
        If the cameras see nothing in common, or never the board.

    """
    parameters = rig.parameters()
    calibration = parameters.calibration()
    geometry = calibration.geometry
    matrix = expected_matrix(parameters, corners, rig.middle, views, corner_sigma, detectable)
    depth = np.geomspace(rig.near, rig.far, DEPTHS)
    calibrated = [_rms_std(depth_derivatives(calibration, *grid_of(calibration, each)), matrix)
                  for each in depth]
    rows = rectified_derivatives(calibration, *grid_of(calibration, rig.middle))[0]
    common = np.array([_common_view(geometry, each) for each in depth])
    return Plan(
        rig=rig, depth=depth, disparity=disparity_from_depth(depth, geometry),
        # equation of docs/conventions.md: depth_std = Z^2 / (f B) disparity_std
        matching_std=depth**2 / geometry.focal_baseline * disparity_std,
        calibration_std=np.array(calibrated), common_width=common[:, 0],
        common_height=common[:, 1], common_share=common[:, 2],
        rows_std=_rms_std(rows, matrix), views=views)


def expected_matrix(parameters, corners, distance, views, sigma=0.05, detectable=None):
    """
    Return the covariance of the parameters after guided views, float64 (n, n).

    Raises
    ------
    CalibrationError
        If no pose of the board can be detected by both cameras.

    """
    guide = Guide(corners, distance, detectable or Detectable(), sigma)
    information = first_information(parameters, corners)
    _, informations = guide.candidates(parameters)
    if not len(informations):
        raise CalibrationError('no pose of the board can be detected by both cameras: take a '
                               'smaller board, or turn the cameras toward each other')
    quality = Quality.at(parameters.calibration(), distance)
    for _ in range(views):
        information = information + informations[guide.best(quality, information, informations)]
    return inverse_information(information)[:-2, :-2]


def _rms_std(derivatives, matrix):
    """Return the root mean square over points of the standard deviation of a quantity."""
    return float(np.sqrt(np.einsum('pi,ij,pj->p', derivatives, matrix, derivatives).mean()))


def _common_view(geometry, depth):
    """Return width and height, m, and share of the left image of what both cameras see."""
    disparity = disparity_from_depth(depth, geometry)
    first, last = max(0.0, disparity), min(geometry.width, geometry.width + disparity)
    columns = max(0.0, last - first)
    return (columns * depth / geometry.focal_x,
            geometry.height * depth / geometry.focal_y * (columns > 0),
            columns / geometry.width)


def feature_size(focal, columns, field_of_view):
    """
    Return the `pattern.feature_size` of a projector, px of the projector.

    Parameters
    ----------
    focal : float
        Of the cameras, px.
    columns : int
        Of the projector.
    field_of_view : float
        Horizontal, degrees.

    """
    camera_pixels = 2 * focal * np.tan(np.radians(field_of_view) / 2) / columns
    return FEATURE / camera_pixels
