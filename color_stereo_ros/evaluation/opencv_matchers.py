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
OpenCV's stereo matchers on the same rectified pair, under conditions that suit them.

Both matchers leave a strip as wide as the number of disparities without an answer at the left
border of an image; here the pair is laid on a wider canvas, so nothing of it is lost. The right
image is shifted by the smallest disparity, so that negative disparities (verged rigs) need no
special case.

"""

import time

import cv2
import numpy as np

from ..core import RangeResult, Status
from ..core.triangulation import depth_from_disparity, disparity_limits, search_interval

METHODS = {'bm': 'OpenCV StereoBM, gray, 15 x 15',
           'sgbm': 'OpenCV StereoSGBM, color, 5 x 5',
           '3way': 'OpenCV StereoSGBM 3WAY, color, 5 x 5'}


def match(method, pair, range_settings):
    """
    Run one of OpenCV's matchers over the disparities of a working range.

    Parameters
    ----------
    method : str
        A key of `METHODS`.
    pair : color_stereo_ros.core.RectifiedPair
        The rectified images.
    range_settings : color_stereo_ros.core.RangeSettings
        The depths that are searched.

    Returns
    -------
    result : color_stereo_ros.core.RangeResult
        OpenCV gives no confidence and no standard deviation: the confidence is 1 where there is
        a range, the standard deviation NaN.

    """
    start = time.perf_counter()
    limits = disparity_limits(pair.geometry, range_settings)
    first, last = search_interval(limits)
    count = -(-(last - first + 1) // 16) * 16
    disparity = _on_canvas(_matcher(method, count), pair, first, count,
                           gray=method == 'bm')
    matched = time.perf_counter()
    return _as_result(disparity, pair, limits, matched - start)


def _matcher(method, count):
    """Return a matcher for the disparities 0 .. count - 1."""
    if method == 'bm':
        matcher = cv2.StereoBM_create(count, 15)
        matcher.setUniquenessRatio(5)
        matcher.setDisp12MaxDiff(1)
        return matcher
    mode = cv2.STEREO_SGBM_MODE_SGBM if method == 'sgbm' else cv2.STEREO_SGBM_MODE_SGBM_3WAY
    return cv2.StereoSGBM_create(
        minDisparity=0, numDisparities=count, blockSize=5, P1=8 * 3 * 25, P2=32 * 3 * 25,
        disp12MaxDiff=1, uniquenessRatio=5, speckleWindowSize=100, speckleRange=2, mode=mode)


def _on_canvas(matcher, pair, first, count, gray):
    """Return the disparity, px, float32 (H, W), NaN = unknown."""
    height, width = pair.left.shape[:2]
    left_at = max(count, -first)
    right_at = left_at + first  # so that a disparity of `first` becomes 0
    canvas_width = max(left_at, right_at) + width
    left, right = (_placed(_gray(image) if gray else image, at, canvas_width)
                   for image, at in ((pair.left, left_at), (pair.right, right_at)))
    raw = matcher.compute(left, right)[:, left_at:left_at + width]
    return np.where(raw < 0, np.float32(np.nan), raw.astype(np.float32) / 16 + np.float32(first))


def _gray(image):
    return cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)


def _placed(image, at, width):
    rest = width - at - image.shape[1]
    return cv2.copyMakeBorder(image, 0, 0, at, rest, cv2.BORDER_REPLICATE)


def _as_result(disparity, pair, limits, seconds):
    outside = (disparity < limits[0]) | (disparity > limits[1])
    status = np.full(disparity.shape, Status.NO_MATCH, np.uint8)
    status[np.isfinite(disparity)] = Status.VALID
    status[outside] = Status.OUT_OF_RANGE
    status[~pair.left_inside] = Status.OUTSIDE_IMAGE
    disparity = np.where(status == Status.VALID, disparity, np.float32(np.nan))
    depth = depth_from_disparity(disparity, pair.geometry)
    return RangeResult(
        disparity=disparity, depth=depth,
        confidence=np.isfinite(depth).astype(np.float32), status=status,
        disparity_std=np.full(depth.shape, np.nan, np.float32), image_source=pair.left,
        geometry=pair.geometry, disparity_limits=limits, seconds={'matching': seconds})
