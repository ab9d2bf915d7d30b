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
"""Outputs of `range_node` as arrays again."""

import numpy as np

from ..errors import ImageError

KINDS = {'32FC1': np.float32, 'mono8': np.uint8, '16UC1': np.uint16}


def values_of(message):
    """
    Return an image of numbers.

    Parameters
    ----------
    message : sensor_msgs.msg.Image
        32FC1, mono8 or 16UC1.

    Returns
    -------
    values : numpy.ndarray, float32, uint8 or uint16, shape (H, W)
        Read only.

    Raises
    ------
    ImageError
        For any other encoding.

    """
    if message.encoding not in KINDS:
        raise ImageError(f'encoding {message.encoding!r} is none of {", ".join(KINDS)}')
    return np.frombuffer(message.data, KINDS[message.encoding]).reshape(message.height,
                                                                        message.width)


def depth_of(message):
    """Return `depth/image`, 32FC1 or 16UC1, as float32 (H, W), m; NaN = unknown."""
    values = values_of(message)
    if values.dtype != np.uint16:
        return values
    return np.where(values > 0, values * np.float32(1e-3), np.float32(np.nan))
