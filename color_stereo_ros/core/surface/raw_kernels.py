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
"""Kernels of the surface method: what a few rows of raw images tell; see `raw_faults`."""

from .grid_kernels import F4, I4
from .tuning import TUNING
from ..compiled import banded, part

# Constants of `tuning`, compiled into the kernels.
LIT = TUNING.brightness.lit
GRAY_DIFFERENCE = TUNING.brightness.gray_difference
FIRST_ROW, ROW_STEP = TUNING.raw.rows
LEAST_ROWS = TUNING.raw.least_rows
LEAST_COLUMNS = TUNING.raw.least_columns
SPIKE = TUNING.raw.spike
NOISE_ROW, NOISE_STEP = TUNING.views.noise_rows
EDGE_ROWS = TUNING.unlike.edge_rows
EDGE_REACH = TUNING.unlike.edge_reach
LEAST_EDGE = TUNING.unlike.least_edge
QUANTITIES = ('lit', 'colored', 'spikes', 'spike_rows', 'even_red', 'odd_red', 'even_blue',
              'odd_blue', 'chroma_rows', 'near', 'far', 'edges')
"""What `look_at_rows` counts of an image, see there."""
(LIT_PIXELS, COLORED, SPIKES, SPIKE_LINES, EVEN_RED, ODD_RED, EVEN_BLUE, ODD_BLUE, CHROMA_LINES,
 NEAR, FAR, EDGES) = range(len(QUANTITIES))


@banded(count=2)
def look_at_rows(k, left, right, counts, scratch, shares):
    """
    Count in some rows of both raw images, uint8 (H, W, 3), what tells about their cameras.

    counts, int64 (2, 12): lit pixels, and those of them with color, see `count_colors`; values
    that stand out, and rows looked at for them, see `count_spikes`; sums of third differences of
    chroma, and rows looked at, see `add_chroma`; sums of differences of neighbors one and two
    columns away, see `add_steps`; and places on edges, see `edge_shares`. scratch is uint8 (2, 3,
    W + EDGE_REACH); shares is float32 (2, places of the rows looked at for edges).

    """
    image, out = left if k == 0 else right, counts[k]
    for at in range(out.size):
        out[at] = 0
    count_colors(image, out)
    if image.shape[1] >= LEAST_COLUMNS:
        count_spikes(image, out)
        add_chroma(image, out)
    if image.shape[1] > 2:
        add_steps(image, out)
    if image.shape[1] > EDGE_REACH:
        edge_shares(image, scratch[k, 0], scratch[k, 1], scratch[k, 2], out, shares[k])


@part()
def count_colors(image, out):
    """Count lit pixels, and those with color, of every fourth pixel of every eighth row."""
    for y in range(image.shape[0] % 8 // 2, image.shape[0], 8):
        row = image[y]
        lit, colored = 0, 0
        for x in range(0, image.shape[1], 4):
            red, green, blue = I4(row[x, 0]), I4(row[x, 1]), I4(row[x, 2])
            brightest = max(red, max(green, blue))
            weakest = min(red, min(green, blue))
            counts = brightest > LIT
            lit += 1 if counts else 0
            colored += 1 if counts & (brightest - weakest > GRAY_DIFFERENCE) else 0
        out[LIT_PIXELS] += lit
        out[COLORED] += colored


@part()
def count_spikes(image, out):
    """Count values that are more than SPIKE above all values two pixels away, rows or columns."""
    height, size = image.shape[0], 3 * image.shape[1]
    for y in range(max(FIRST_ROW, 2), height - 2, ROW_STEP):
        out[SPIKE_LINES] += 1
        above, high, here = (image[y - 2].reshape(-1), image[y - 1].reshape(-1),
                             image[y].reshape(-1))
        low, below = image[y + 1].reshape(-1), image[y + 2].reshape(-1)
        found = I4(0)
        for i in range(size - 12):
            most = max(above[i], below[i])
            for step in range(3, 13, 3):
                most = max(most, max(above[i + step], below[i + step]))
            most = max(most, max(high[i], max(here[i], low[i])))
            most = max(most, max(high[i + 12], max(here[i + 12], low[i + 12])))
            found = I4(found + (I4(1) if I4(here[i + 6]) - I4(most) > SPIKE else I4(0)))
        for side in range(2):  # here the ring is cut by the border
            first = 0 if side == 0 else size - 6
            for i in range(first, first + 6):
                most = I4(0)
                for step in range(-6, 7, 3):
                    at = i + step
                    if (at < 0) | (at >= size):
                        continue
                    most = max(most, max(I4(above[at]), I4(below[at])))
                    if abs(step) == 6:
                        most = max(most, max(I4(high[at]), max(I4(here[at]), I4(low[at]))))
                found = I4(found + (I4(1) if I4(here[i]) - most > SPIKE else I4(0)))
        out[SPIKES] += found


@part()
def add_chroma(image, out):
    """Add third differences of red - green and blue - green along rows, even and odd columns."""
    height, width = image.shape[0], image.shape[1]
    for y in range(FIRST_ROW, height, max(1, min(ROW_STEP, height // LEAST_ROWS))):
        row = image[y]
        out[CHROMA_LINES] += 1
        for color in range(0, 3, 2):
            even, odd = I4(0), I4(0)
            for x in range(0, width - 3, 2):
                c0, c1 = I4(row[x, color]) - I4(row[x, 1]), I4(row[x + 1, color]) - I4(
                    row[x + 1, 1])
                c2, c3 = I4(row[x + 2, color]) - I4(row[x + 2, 1]), I4(row[x + 3, color]) - I4(
                    row[x + 3, 1])
                even = I4(even + abs(I4(c3 - c0 + 3 * (c1 - c2))))
                if x + 4 < width:
                    c4 = I4(row[x + 4, color]) - I4(row[x + 4, 1])
                    odd = I4(odd + abs(I4(c4 - c1 + 3 * (c2 - c3))))
            out[EVEN_RED if color == 0 else EVEN_BLUE] += even
            out[ODD_RED if color == 0 else ODD_BLUE] += odd


@part()
def add_steps(image, out):
    """Add the differences of values one column and two columns apart."""
    size = 3 * image.shape[1]
    for y in range(NOISE_ROW, image.shape[0], NOISE_STEP):
        row = image[y].reshape(-1)
        near, far = I4(0), I4(0)
        for i in range(size - 3):
            near = I4(near + abs(I4(I4(row[i + 3]) - I4(row[i]))))
        for i in range(size - 6):
            far = I4(far + abs(I4(I4(row[i + 6]) - I4(row[i]))))
        out[NEAR] += near
        out[FAR] += far


@part()
def edge_shares(image, green, highest, lowest, out, shares):
    """Write the change of green over two columns as a share of its span over EDGE_REACH ones."""
    width, reach = image.shape[1], EDGE_REACH // 2
    count = 0
    for y in range(EDGE_ROWS // 2, image.shape[0], EDGE_ROWS):
        row = image[y]
        for x in range(reach):  # what lies outside the image repeats its border
            green[x], green[reach + width + x] = row[0, 1], row[width - 1, 1]
        inner = green[reach:reach + width]
        for x in range(width):
            inner[x] = row[x, 1]
        for x in range(width):
            highest[x] = green[x]
            lowest[x] = green[x]
        for step in range(1, 2 * reach + 1):
            moved = green[step:step + width]
            for x in range(width):
                highest[x] = max(highest[x], moved[x])
                lowest[x] = min(lowest[x], moved[x])
        for x in range(1, width - 1):
            height = I4(highest[x]) - I4(lowest[x])
            if height > LEAST_EDGE:
                shares[count] = F4(abs(I4(inner[x + 1]) - I4(inner[x - 1]))) / F4(height)
                count += 1
    out[EDGES] = count
