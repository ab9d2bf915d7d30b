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
"""How wide the edges of a board are in an image: by the lens, the focus and motion."""

import cv2
import numpy as np

REACH = 6.0     # px on either side of an edge, at most; chosen: motion blur of 10 px is seen
SHARE = 0.1     # of a square: markers begin behind it
STEP = 0.25     # px between samples of a profile
LEVELS = 5, 95  # percent of the pixels of the board that count as black and white
LEAST = 6       # edges of a direction


def edge_width(board, detection, gray):
    """
    Return the width of the edges between the squares of a board.

    The width is the contrast over the largest slope. Of the two directions of the edges the
    wider one counts: motion blurs along one direction.

    Parameters
    ----------
    board : Board
        The calibration board.
    detection : Detection
        The corners of the view.
    gray : numpy.ndarray, uint8, shape (H, W)
        The image, gray.

    Returns
    -------
    width : float
        px; NaN for a board without squares, or where too few edges are seen.

    """
    if board.kind == 'circles':
        return np.nan
    low, high = detection.pixels.min(axis=0), detection.pixels.max(axis=0) + 1
    (left, top), (right, bottom) = (np.clip(each, 0, gray.shape[::-1]).astype(int)
                                    for each in (low, high))
    dark, bright = np.percentile(gray[top:bottom, left:right], LEVELS)
    place = np.full(len(board.corners), -1)
    place[detection.ids] = np.arange(len(detection.ids))
    grid = place.reshape(board.rows - 1, board.columns - 1)
    ends = (grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:])
    widths = [_width(detection.pixels, first.ravel(), second.ravel(), gray, bright - dark)
              for first, second in ends]
    return np.nan if np.isnan(widths).any() else float(max(widths))


def _width(pixels, first, second, gray, contrast):
    """Return the median width of the edges from first to second corners, px."""
    seen = (first >= 0) & (second >= 0)
    if seen.sum() < LEAST:
        return np.nan
    start, end = pixels[first[seen]], pixels[second[seen]]
    length = np.linalg.norm(end - start, axis=1)
    across = (end - start)[:, ::-1] * (1, -1) / length[:, None]
    reach = max(1.0, min(REACH, SHARE * np.median(length)))
    offsets = np.arange(-reach, reach + STEP, STEP)
    places = ((start + end) / 2)[:, None] + across[:, None] * offsets[:, None]
    profiles = cv2.remap(gray, places.astype(np.float32), None, cv2.INTER_LINEAR,
                         borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
    slopes = np.abs(profiles[:, 4:] - profiles[:, :-4]).max(axis=1)  # DN per px
    return float(np.median(contrast / np.maximum(slopes, 1.0)))
