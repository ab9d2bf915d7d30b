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
"""The gray image of a board, in which a Bayer mosaic does not move edges."""

import cv2
import numpy as np

STEP = 4            # px between the pixels that are compared; wider than a blurred edge
ROWS = 3            # every third row is looked at; odd, so that both kinds of rows are seen
STRONG = 90         # percentile of the steps of brightness that show the gains
LEAST_STEP = 12     # DN; below, noise decides
LEAST_GAIN = 0.25   # of the strongest channel; a weaker one would bring noise only
EVEN = np.array([[0, 1, 0], [1, 4, 1], [0, 1, 0]]) / 8  # 0 where signs change from px to px


def gray_of(image):
    """
    Return the luminance of a board under a Bayer mosaic.

    Where the channels see the same, the mosaic itself is a gray image at full resolution, and
    (R + 2 G + B) / 4 of a demosaiced image is that image with a slight blur. Then the errors of
    red and blue edges cancel, which other weights leave as a shift of up to .08 px with a period
    of two pixels (D. Alleysson, S. Susstrunk and J. Herault, 2005). Lamps and sensors make the
    channels unequal: each is divided by its gain.

    Conversion blurs green pixels less than red and blue ones. Edges then have a pattern that
    changes its sign from pixel to pixel, and a small filter removes it.

    Parameters
    ----------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    Returns
    -------
    gray : numpy.ndarray, uint8, shape (H, W)
        White of the brightest channel stays what it is.

    """
    if (image == image[..., :1]).all():
        return np.ascontiguousarray(image[..., 0])
    weights = np.array([0.25, 0.5, 0.25]) / channel_gains(image)
    gray = cv2.transform(image.astype(np.float32), np.float32(weights)[None])
    return np.clip(np.rint(cv2.filter2D(gray, -1, EVEN)), 0, 255).astype(np.uint8)


def channel_gains(image):
    """
    Return how large steps of brightness are in R, G, B, float64 (3,), 1 = the largest.

    Black and white boards have the strongest edges of most images. Their steps, colored ones
    left aside by the median, show the gains.

    """
    rows = image[::ROWS].astype(np.float64)
    steps = rows[:, STEP:] - rows[:, :-STEP]
    total = np.abs(steps.sum(axis=2))
    strong = total >= max(np.percentile(total, STRONG), 3 * LEAST_STEP)
    if not strong.any():
        return np.ones(3)
    gains = np.median(steps[strong] / steps[strong].sum(axis=1, keepdims=True), axis=0)
    return np.maximum(gains / gains.max(), LEAST_GAIN)
