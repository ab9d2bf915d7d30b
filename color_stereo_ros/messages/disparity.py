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
"""The disparities of a result as the content of a stereo_msgs/DisparityImage."""

import numpy as np

from .contents import DisparityImage, image, RegionOfInterest


def disparity(result, header):
    """
    Return the disparities of a result.

    The convention of the message is Z = f t / d, so cx_left - cx_right is taken from the pixels
    and from the limits alike; unknown pixels lie 1 px below `min_disparity`.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    header : Header
        Stamp and frame of the message.

    Returns
    -------
    content : DisparityImage

    """
    geometry, offset = result.geometry, result.geometry.principal_offset
    lowest, highest = (float(limit - offset) for limit in result.disparity_limits)
    shifted = result.disparity - np.float32(offset)
    # the limits are rounded to float32 by the message: keep the last ulp of a match inside them
    np.clip(shifted, np.float32(lowest), np.float32(highest), out=shifted)
    shifted[np.isnan(shifted)] = np.float32(lowest - 1.0)
    return DisparityImage(
        header, image(shifted, '32FC1', header), f=float(geometry.focal_x),
        t=float(geometry.baseline), valid_window=_valid_window(result), min_disparity=lowest,
        max_disparity=highest, delta_d=_step(result))


def _step(result):
    """Return the smallest step that the disparities resolve: their median deviation, px."""
    known = result.disparity_std[::4, ::4]
    known = known[np.isfinite(known)]
    return float(np.median(known)) if known.size else 1.0


def _valid_window(result):
    """Return the columns whose partner can lie in the right image: 0 <= x - d <= width - 1."""
    width, height = result.geometry.width, result.geometry.height
    lowest, highest = result.disparity_limits
    first = int(np.clip(np.floor(lowest), 0, width))
    beyond = int(np.clip(np.ceil(width + highest), first, width))
    return RegionOfInterest(x_offset=first, y_offset=0, height=height, width=beyond - first)
