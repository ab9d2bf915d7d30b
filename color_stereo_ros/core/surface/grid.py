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
"""The half grid as numbers: how many nodes, where they lie in framed arrays, which tiles."""

from dataclasses import dataclass

import numpy as np

from .grid_kernels import PAD, TILE_COLUMNS, TILE_ROWS


@dataclass(frozen=True, eq=False)
class HalfGrid:
    """
    The nodes of the left image, one per 2 x 2 px; see `grid_kernels` for the words.

    Parameters
    ----------
    height, width : int
        Of the rectified images, px.

    """

    height: int
    width: int

    def __post_init__(self):
        """Derive the sizes once: every pair asks for them."""
        rows, columns = self.height // 2, self.width // 2
        shape = tuple(2 * PAD + whole(count, tile) for count, tile in (
            (rows, TILE_ROWS), (columns, TILE_COLUMNS)))
        for name, value in (('rows', rows), ('columns', columns), ('nodes', (rows, columns)),
                            ('shape', shape), ('inner', framed_area(rows, columns, PAD)),
                            ('tiles', tiles_of(shape))):
            object.__setattr__(self, name, value)


def framed_area(rows, columns, first):
    """Return where the nodes lie in a framed array, a pair of slices."""
    return np.s_[PAD:PAD + rows, first:first + columns]


def tiles_of(shape):
    """Return the first row and column of every tile of a framed half grid, int32 (N, 2)."""
    rows = np.arange(PAD, shape[0] - PAD, TILE_ROWS)
    columns = np.arange(PAD, shape[1] - PAD, TILE_COLUMNS)
    return np.stack(np.meshgrid(rows, columns, indexing='ij'), axis=-1).reshape(-1, 2).astype(
        np.int32)


def whole(count, step):
    """Return count rounded up to a multiple of step."""
    return -(-count // step) * step
