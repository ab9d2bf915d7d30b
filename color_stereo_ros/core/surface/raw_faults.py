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
"""What compression and hot pixels leave in a raw image: how it is noticed and made up for."""

from dataclasses import dataclass
import math

import cv2
import numpy as np

from .grid_kernels import F4
from .raw_kernels import EDGE_REACH, EDGE_ROWS, look_at_rows, QUANTITIES
from .tuning import TUNING

LUMA = np.array(TUNING.raw.luma, F4)
RING = np.pad(np.zeros((3, 3), np.uint8), 1, constant_values=1)
"""The pixels two columns or two rows away: demosaicing spreads a pixel over one."""
BLOCK = TUNING.raw.block
COSINES = cv2.dct(np.eye(BLOCK, dtype=F4), flags=cv2.DCT_ROWS).T
"""Waves of the transform of a block, one a row."""
TENT = np.ones((3, 3), np.uint8)
"""What demosaicing makes of a pixel."""


@dataclass(frozen=True)
class Look:
    """What a few rows of a raw image tell of its camera, before anything is matched."""

    gray: bool
    """It shows light without any color. The compression of JPEG leaves 1 or 2 DN of it."""
    hot: bool
    """More single pixels stand out than scenes and noise explain."""
    subsampled: bool
    """Its chroma has half of its columns, see `chroma_is_subsampled`."""
    sharpness: float
    """Of its sharpest edges, see `sharpness`."""
    noise_weight: float
    """See `noise_weight`."""


class Looker:
    """
    Looks at the raw images of pairs.

    Parameters
    ----------
    height, width : int
        Of both images, px.
    tuning : Tuning

    """

    def __init__(self, height, width, tuning):
        """Allocate what the kernel writes."""
        self.height, self.width, self.tuning = height, width, tuning
        self.counts = np.zeros((2, len(QUANTITIES)), np.int64)
        self.scratch = np.zeros((2, 3, width + EDGE_REACH), np.uint8)
        self.shares = np.zeros((2, (height // EDGE_ROWS + 1) * width), F4)

    def look(self, left, right):
        """
        Look at a pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            RGB, contiguous.

        Returns
        -------
        looks : tuple of two Look
            Of left and right.

        """
        look_at_rows(read_only(left), read_only(right), self.counts, self.scratch, self.shares)
        return tuple(self.judged(dict(zip(QUANTITIES, counts)), shares)
                     for counts, shares in zip(self.counts.tolist(), self.shares))

    def judged(self, counts, shares):
        """Return the Look of one image: counts by name, and the shares of its edges."""
        tuning, lit = self.tuning, counts['lit']
        colorless = lit - counts['colored']
        values = 3 * self.width * counts['spike_rows']
        return Look(
            gray=lit > 0 and colorless / lit >= tuning.brightness.gray_share,
            hot=counts['spikes'] > tuning.raw.hot_share * values,
            subsampled=chroma_is_subsampled(counts, self.width, tuning.raw),
            sharpness=sharpness(shares[:counts['edges']], tuning.unlike),
            noise_weight=noise_weight(counts, self.height, self.width, tuning.views))


def read_only(image):
    """Return a view that kernels cannot write: they are compiled for one kind of array."""
    view = image.view()
    view.flags.writeable = False
    return view


def chroma_is_subsampled(counts, width, tuning):
    """
    Return whether the chroma of an image has half of its columns, as in JPEG 4:2:0.

    The decoder interpolates the missing columns. The third differences of chroma along a row
    then come in pairs, on even or on odd columns. They do not in an image of a sensor, with or
    without demosaicing. Differences of two channels have no luma in them.

    counts: of `raw_kernels.look_at_rows`, by name; tuning: RawTuning.

    """
    rows = counts['chroma_rows']
    if rows == 0:
        return False
    evens, odds = rows * (-(-(width - 3) // 2)), rows * ((width - 3) // 2)
    total = 0.0
    for color in ('red', 'blue'):
        even, odd = counts[f'even_{color}'] / evens, counts[f'odd_{color}'] / odds
        total += math.log((even + tuning.least_change) / (odd + tuning.least_change))
    return abs(total) > 2 * tuning.pairing + tuning.chance / math.sqrt(evens)


def sharpness(shares, tuning):
    """
    Return how sharp the sharpest edges of an image are: change over two pixels over their height.

    Only the green channel is looked at. 1 where there are too few edges to tell.

    shares: float32 (N,), of the places on edges; tuning: UnlikeTuning.

    """
    count = len(shares)
    if count < tuning.least_edges:
        return 1.0
    at = count - 1 - count // tuning.edge_rank
    return float(np.partition(shares, at)[at])


def noise_weight(counts, height, width, tuning):
    """
    Return the weight that mere noise has at a node of an image.

    The noise of a single-chip camera changes slowly from pixel to pixel, since demosaicing
    interpolates. The noise of other cameras, and that of gray images without any pattern, is
    independent from pixel to pixel: its gradients are steeper.

    counts: of `raw_kernels.look_at_rows`, by name; tuning: ViewTuning.

    """
    demosaiced, independent = tuning.noise_weights
    if height <= tuning.noise_rows[0] or width < 3:
        return independent
    near, far = counts['near'] / (width - 1), counts['far'] / (width - 2)
    low, high = tuning.noise_steps
    share = np.clip((near / max(far, tuning.least_change) - low) / (high - low), 0, 1)
    return demosaiced + share * (independent - demosaiced)


def quantization(image, tuning):
    """
    Return the step of the low frequencies of luma in a JPEG image, DN; 1 where none shows.

    The coefficients of the cosine transform of the blocks are multiples of it. A cropped image,
    whose blocks lie elsewhere, shows none.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.
    tuning : RawTuning
        Constants of this stage.

    """
    columns = image.shape[1] // BLOCK
    tops = range(0, image.shape[0] - BLOCK + 1, BLOCK * tuning.block_rows)
    if not tops or not columns:
        return 1.0
    strips = [image[top:top + BLOCK, :columns * BLOCK].astype(F4) @ LUMA for top in tops]
    blocks = np.stack(strips).reshape(-1, BLOCK, columns, BLOCK)
    steps = [step_of(np.abs(np.einsum('rykx,y,x->rk', blocks, COSINES[v], COSINES[u])).ravel(),
                     tuning) for v, u in tuning.frequencies]
    return float(max(steps))


def step_of(values, tuning):
    """
    Return the number of which values, float32 (N,), are multiples; 1 where none is found.

    Each step is scored by the values that it does not round to 0, the largest ones: they are
    sorted once, and all steps that enough values reach are scored together.

    """
    values = np.sort(values)
    steps = np.arange(2, tuning.largest_quantization + 1)
    reaching = values.size - np.searchsorted(values, 2 * tuning.beyond_zero * steps, 'right')
    steps = steps[:np.argmin(np.append(reaching >= tuning.least_values, False))]
    if not steps.size:
        return 1
    first = np.searchsorted(values, tuning.beyond_zero * steps, 'right')
    values, first = values[first[0]:], first - first[0]
    periods = np.cos((F4(2 * np.pi) / steps.astype(F4))[:, None] * values)
    # means over the values from `first` on
    periods *= np.arange(values.size) >= first[:, None]
    scores = periods.sum(axis=1) / (values.size - first)
    best = int(np.argmax(scores))
    return int(steps[best]) if scores[best] > tuning.periodic else 1


def without_hot_pixels(image, tuning):
    """
    Return an image whose single outstanding pixels are medians of their surroundings.

    A pixel stands out of the ring two pixels away: demosaicing spreads it over its neighbors. The
    neighbors are replaced, too.

    image: uint8 (H, W, 3); tuning: RawTuning.

    """
    out = (cv2.subtract(image, cv2.dilate(image, RING)) > tuning.outlier) | (
        cv2.subtract(cv2.erode(image, RING), image) > tuning.outlier)
    out = cv2.dilate(out.view(np.uint8), TENT)
    return np.where(out, cv2.medianBlur(image, 5), image)
