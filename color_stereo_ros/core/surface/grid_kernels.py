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
The half grid: what all kernels of the surface method share.

Words used there. The *half grid* has one node per 2 x 2 rectified pixels, at their center; the
right image keeps all its columns on half the rows, so that a disparity is sampled finely. u, v are
the two chromaticity coordinates, s the brightness they were divided by. A plane d + a i + b j
gives the disparity (full pixels) i nodes to the right and j nodes below a node. NaN = unknown;
therefore never fastmath=True.

All half-grid arrays of the left image (and the rows of the right one) carry a frame of PAD
unknown nodes. They are rounded up to whole tiles of TILE_ROWS x TILE_COLUMNS nodes, so that no
loop tests for the border of the image. A tile is *smooth* where one surface fills it and its
surroundings. There windows need no gate, and sums over them are separable.

Kernels get bare arrays and write into them; the modules of the steps (`views`,
`coarse`, `planes`, `neighbors`, `trust`, `pixels`) give them meaning.

"""

import numpy as np

from .tuning import TUNING
from ..compiled import part

FAST = {'nsz', 'arcp', 'contract', 'afn', 'reassoc'}  # the NaN-safe subset
F4 = np.float32
I4 = np.int32
U4 = np.uint32
NAN = F4(np.nan)
# Constants of `tuning`, compiled into the kernels.
PAD = TUNING.grid.pad
TILE_ROWS, TILE_COLUMNS = TUNING.grid.tile_rows, TUNING.grid.tile_columns
PHASE_VARIANCE = F4(TUNING.pair.phase_variance)
SILENT_VARIANCE = F4(TUNING.views.silent_variance)
LARGEST_BLUR_GAIN = F4(TUNING.pair.largest_blur_gain)
LEAST_FORESHORTENING = F4(TUNING.pair.least_foreshortening)


@part()
def any_above(values, bound):
    """Return whether any entry is larger than a bound; NaN is not."""
    for y in range(values.shape[0]):
        for x in range(values.shape[1]):
            if values[y, x] > bound:
                return True
    return False


@part(fastmath=FAST)
def foreshortening(a, b, psf):
    """
    Return the gain of second differences that gives the left view the blur of the right one.

    Both cameras have a point spread of variance psf, px^2, but foreshorten a plane differently.
    1 px of the left image shows the same as 1 - a' px of the right one, where a' = a / 2 and
    b' = b / 2 are the slopes in px per px. Carried along the plane to the left image, the
    variance of the right point spread along rows is (1 + b'^2) / (1 - a')^2 times as large. A gain
    g adds 2 g nodes^2, or 8 g px^2, to that of the left one. A negative gain sharpens.

    """
    face = max(F4(1) - F4(0.5) * a, LEAST_FORESHORTENING)
    excess = (F4(1) + F4(0.25) * b * b) / (face * face) - F4(1)
    return min(F4(0.125) * psf * excess, LARGEST_BLUR_GAIN)


@part()
def copy_tile(d, a, b, top, left, new_d, new_a, new_b):
    """Copy the planes of one tile."""
    for y in range(top, top + TILE_ROWS):
        for x in range(left, left + TILE_COLUMNS):
            new_d[y, x] = d[y, x]
            new_a[y, x] = a[y, x]
            new_b[y, x] = b[y, x]
