# SPDX-License-Identifier: Apache-2.0
"""What compression and hot pixels leave in a raw image: how it is noticed and made up for."""

import math

import cv2
import numpy as np

from .grid_kernels import F4
from .tuning import TUNING

LUMA = np.array(TUNING.raw.luma, F4)
RING = np.pad(np.zeros((3, 3), np.uint8), 1, constant_values=1)
"""The pixels two columns or two rows away: demosaicing spreads a pixel over one."""
BLOCK = TUNING.raw.block
COSINES = cv2.dct(np.eye(BLOCK, dtype=F4), flags=cv2.DCT_ROWS).T
"""Waves of the transform of a block, one a row."""
TENT = np.ones((3, 3), np.uint8)
"""What demosaicing makes of a pixel."""


def chroma_is_subsampled(image, tuning):
    """
    Return whether the chroma of an image has half of its columns, as in JPEG 4:2:0.

    The decoder interpolates the missing columns. The second differences of chroma along a row
    then come in pairs, on even or on odd columns. They do not in an image of a sensor, with or
    without demosaicing. Differences of two channels have no luma in them.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.
    tuning : RawTuning

    """
    first, step = tuning.rows
    rows = image[first::max(1, min(step, len(image) // tuning.least_rows))]
    if rows.shape[0] == 0 or rows.shape[1] < tuning.least_columns:
        return False
    red, green, blue = (channel.astype(np.int16) for channel in cv2.split(rows))
    total = 0.0
    for chroma in (red - green, blue - green):
        third = np.abs(np.diff(chroma, 3))
        even, odd = third[:, 0::2].mean(), third[:, 1::2].mean()
        total += math.log((even + tuning.least_change) / (odd + tuning.least_change))
    return abs(total) > 2 * tuning.pairing + tuning.chance / math.sqrt(third[:, ::2].size)


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
    """Return the number of which values, float32 (N,), are multiples; 1 where none is found."""
    found, best = 1, tuning.periodic
    for step in range(2, tuning.largest_quantization + 1):
        large = values[values > tuning.beyond_zero * step]
        if np.count_nonzero(large > 2 * tuning.beyond_zero * step) < tuning.least_values:
            break
        score = np.cos(large * F4(2 * np.pi / step)).mean()
        if score > best:
            found, best = step, score
    return found


def sharpness(image, tuning):
    """
    Return how sharp the sharpest edges of an image are: change over two pixels over their height.

    Only the green channel is looked at. 1 where there are too few edges to tell.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.
    tuning : UnlikeTuning

    """
    rows = np.ascontiguousarray(image[tuning.edge_rows // 2::tuning.edge_rows, :, 1])
    if rows.shape[0] == 0 or rows.shape[1] <= tuning.edge_reach:
        return 1.0
    around = np.ones((1, tuning.edge_reach), np.uint8)
    height = cv2.subtract(cv2.dilate(rows, around), cv2.erode(rows, around))[:, 1:-1]
    change = cv2.absdiff(rows[:, 2:], rows[:, :-2])
    edges = height > tuning.least_edge
    count = np.count_nonzero(edges)
    if count < tuning.least_edges:
        return 1.0
    share = change[edges].astype(F4) / height[edges]
    at = count - 1 - count // tuning.edge_rank
    return float(np.partition(share, at)[at])


def has_hot_pixels(image, tuning):
    """
    Return whether more single pixels stand out of an image than scenes and noise explain.

    image: uint8 (H, W, 3); tuning: RawTuning.

    """
    height, width = image.shape[:2]
    first, step = tuning.rows
    centers = np.arange(max(first, 2), height - 2, step)
    if centers.size == 0 or width < tuning.least_columns:
        return False
    strips = image[(centers[:, None] + np.arange(-2, 3)).ravel()]
    spikes = cv2.subtract(strips, cv2.dilate(strips, RING))[2::5]
    return np.count_nonzero(spikes > tuning.spike) > tuning.hot_share * spikes.size


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
