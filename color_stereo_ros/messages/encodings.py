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
"""The encodings of sensor_msgs/Image: which are read, and how the bytes of each are laid out."""

import cv2
import numpy as np

from ..errors import brief

PLAIN = {'rgb8': (3, None), 'bgr8': (3, cv2.COLOR_BGR2RGB),
         'rgba8': (4, cv2.COLOR_RGBA2RGB), 'bgra8': (4, cv2.COLOR_BGRA2RGB)}
"""Channels of an encoding, and OpenCV's conversion to RGB."""

COLORS = 'rgb', 'bgr'
"""With what the encodings of plain colors begin."""

# ROS names the first two pixels of rows 0 and 1. OpenCV's older two-letter names start at pixel
# (1, 1) instead (its BayerBG is rggb); these four-letter names mean the same as in ROS.
BAYER = {'bayer_rggb': cv2.COLOR_BayerRGGB2RGB, 'bayer_bggr': cv2.COLOR_BayerBGGR2RGB,
         'bayer_gbrg': cv2.COLOR_BayerGBRG2RGB, 'bayer_grbg': cv2.COLOR_BayerGRBG2RGB}
"""OpenCV's conversion of a mosaic to RGB; the encodings of messages end with 8 or 16."""

MONO = {'mono': cv2.COLOR_GRAY2RGB}
"""OpenCV's conversion of a gray image to RGB; the encodings of messages end with 8 or 16."""

READ = (*PLAIN, *(name + bits for bits in ('8', '16') for name in (*BAYER, *MONO)))
"""The encodings that `reading.image_to_rgb` reads."""

WRITTEN = {'rgb8': (np.uint8, 3), 'bgr8': (np.uint8, 3), 'mono8': (np.uint8, 1),
           '16UC1': (np.uint16, 1), '32FC1': (np.float32, 1),
           **{name + '8': (np.uint8, 1) for name in BAYER}}
"""Type and channels of the encodings that `contents.image` writes."""

_NUMBERS = ('8UC1', '16UC1', '32FC1', '64FC1')


def conversion(encoding):
    """Return OpenCV's conversion to RGB, None if the encoding is RGB already."""
    if encoding in PLAIN:
        return PLAIN[encoding][1]
    return (BAYER | MONO)[encoding.removesuffix('16').removesuffix('8')]


def complaint(encoding):
    """Return why images of an encoding cannot be read, as a sentence without an end."""
    if encoding in _NUMBERS:
        reason = 'does not tell what its numbers are; gray images are mono8 or mono16'
    elif encoding in ('8UC3', '8UC4'):
        reason = 'does not tell the order of its channels'
    elif encoding == '':
        reason = 'is empty'
    else:
        reason = 'is not supported'
    return f'encoding = {brief(encoding)} {reason}; expected one of {", ".join(READ)}'
