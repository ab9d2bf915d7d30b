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
"""The rows of the right view, read where an alignment says; see `rows.alignment`."""

from types import SimpleNamespace

import numpy as np

from .grid_kernels import F4
from .row_kernels import moved_rows
from ..cameras.rectification import raw_coordinates
from ..rows.alignment import COUNT


class MovedRows:
    """
    The maps of the right view: as calibrated, or moved by an alignment.

    Parameters
    ----------
    view : View
        The right one; its maps are those of the calibration now.
    camera : CameraModel
    rows, columns : int
        Nodes of the view.
    step_x : int
        Columns per node.
    rectified : bool
        The images arrive rectified already.
    margin : int
        Rows above and below the image from which rows may be taken, nodes.
    first : int
        Column of the first node in the framed arrays of the view.

    """

    def __init__(self, view, camera, rows, columns, step_x, rectified, margin, first):
        """Keep the maps of the calibration, and places beyond the image."""
        self.view, self.margin, self.step_x, self.first = view, margin, step_x, first
        self.raw_size = camera.width, camera.height
        self.still = [each.copy() for each in view.index]
        self.places = extended_places(camera, rows, columns, step_x, rectified, margin)
        (x_row, x_column), (y_row, y_column) = (np.gradient(each) for each in self.places)
        # beyond the field of view a lens polynomial turns back
        self.seen = (x_column * y_row - x_row * y_column > 0).astype(np.uint8)
        self.coefficients = np.zeros(COUNT, F4)
        for coefficients in (np.ones(COUNT), np.zeros(COUNT)):  # no later pair compiles
            self.move(coefficients)

    def move(self, coefficients):
        """
        Move the rows of the view.

        Parameters
        ----------
        coefficients : numpy.ndarray, shape (7,)
            See `rows.alignment`, px; all 0: as calibrated.

        """
        coefficients = np.asarray(coefficients, F4)
        if np.array_equal(coefficients, self.coefficients):
            return
        self.coefficients = coefficients
        if coefficients.any():
            width, height = self.raw_size
            moved_rows(*self.places, self.seen, self.margin, self.step_x, coefficients,
                       F4(width / 2), F4(height / 2), width, height, self.first,
                       *self.view.index)
            return
        for plane, still in zip(self.view.index, self.still):
            np.copyto(plane, still)


def extended_places(camera, rows, columns, step_x, rectified, margin):
    """
    Return where nodes lie in the raw image, with rows above and below the image.

    See `MovedRows` for the arguments.

    Returns
    -------
    x, y : numpy.ndarray, float32, shape (rows + 2 margin, columns)
        px.

    """
    rows += 2 * margin
    if rectified:
        x, y = np.meshgrid(np.arange(columns, dtype=F4) * step_x,
                           np.arange(-margin, rows - margin, dtype=F4) * 2)
        return x + F4(0.5), y + F4(0.5)
    projection = camera.P[:, :3].copy()
    projection[:2, 2] -= 0.5
    projection = np.diag([1.0 / step_x, 0.5, 1.0]) @ projection
    projection[1, 2] += margin
    return raw_coordinates(SimpleNamespace(
        K=camera.K, D=camera.D, R=camera.R, P=projection, width=columns, height=rows,
        distortion_model=camera.distortion_model))
