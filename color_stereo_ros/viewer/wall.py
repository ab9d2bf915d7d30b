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
Where things stand in the scene: the points in the middle, the pictures beside them.

The scene has the coordinates of the points: rectified left camera, x right, y down, z forward, m.
All pictures stand in one plane at the depth of the points, so that a look along z shows all.

"""

from dataclasses import dataclass

import numpy as np

from .pictures import NAMES

COLUMNS = 2
ROWS = -(-len(NAMES) // COLUMNS)
GAP = 0.12
"""Between pictures, of their height; chosen: a line of text fits."""
BESIDE = 0.75
"""Place for a legend, of the height of its picture; chosen: that of the status fits."""
TALL = 1.5
"""Height of the wall, of that of the field of view; chosen: half of the window is points."""
FIELD = np.radians(50.0)
"""Vertical field of view of the browser's camera."""


@dataclass(frozen=True)
class Place:
    """Where a picture stands."""

    corner: tuple
    """x, y of the upper left corner, m."""
    width: float
    """m."""
    height: float
    """m."""


class Wall:
    """
    The places of the pictures, and the cameras that look at them.

    Parameters
    ----------
    geometry : RectifiedGeometry
    depth : float
        m, where the pictures stand.

    """

    def __init__(self, geometry, depth):
        self.depth, self.size = depth, (geometry.width, geometry.height)
        left, right = ((at - geometry.center_x_left) / geometry.focal_x * depth
                       for at in (0, geometry.width))
        top, bottom = ((at - geometry.center_y) / geometry.focal_y * depth
                       for at in (0, geometry.height))
        self._points = left, top, right, bottom
        cell = TALL * (bottom - top) / ROWS
        height = cell / (1 + GAP)
        width = height * geometry.width / geometry.height
        # legends are beside the pictures of the second column
        columns = 0.0, width + GAP * height
        across = columns[1] + width + BESIDE * height
        first = left - GAP * height - across
        above = (top + bottom) / 2 - TALL * (bottom - top) / 2 + GAP * height
        self.places = {
            name: Place((first + columns[at % COLUMNS], above + (at // COLUMNS) * cell),
                        width, height)
            for at, name in enumerate(NAMES)}
        self._pictures = (first, above - GAP * height, first + across,
                          above - GAP * height + ROWS * cell)

    def pixel_of(self, origin, direction):
        """
        Return what a ray hits.

        Parameters
        ----------
        origin, direction : array-like, shape (3,)
            m.

        Returns
        -------
        hit : (str, float, float) or None
            Name of the picture, column and row of the image, px.

        """
        origin, direction = np.asarray(origin, float), np.asarray(direction, float)
        if not abs(direction[2]) > 1e-9 or (self.depth - origin[2]) / direction[2] <= 0:
            return None
        x, y, _ = origin + (self.depth - origin[2]) / direction[2] * direction
        for name, place in self.places.items():
            across = (x - place.corner[0]) / place.width
            down = (y - place.corner[1]) / place.height
            if 0 <= across < 1 and 0 <= down < 1:
                width, height = self.size
                return name, across * width - 0.5, down * height - 0.5
        return None

    def spot(self, name, x, y):
        """Return where a pixel of a picture is in the scene, float64 (3,), m."""
        place, (width, height) = self.places[name], self.size
        return np.array([place.corner[0] + (x + 0.5) / width * place.width,
                         place.corner[1] + (y + 0.5) / height * place.height, self.depth])

    def camera(self, view='all', aspect=1.15):
        """
        Return from where all, the points or the pictures are seen as a whole.

        Parameters
        ----------
        view : str
            'all', 'points' or 'pictures'.
        aspect : float
            Width over height of the window.

        Returns
        -------
        position, look_at : numpy.ndarray, float64, shape (3,)
            m.

        """
        boxes = {'all': (self._points, self._pictures), 'points': (self._points,),
                 'pictures': (self._pictures,)}[view]
        left, top = np.min([box[:2] for box in boxes], axis=0)
        right, bottom = np.max([box[2:] for box in boxes], axis=0)
        size = 1.04 * max(bottom - top, (right - left) / aspect)
        middle = np.array([(left + right) / 2, (top + bottom) / 2, self.depth])
        return middle - [0, 0, size / 2 / np.tan(FIELD / 2)], middle
