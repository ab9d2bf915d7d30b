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
Images as the compressing plugins of image_transport write them.

The formats are those of the plugins for ROS 2 Jazzy: `src/codec.cpp` of
compressed_depth_image_transport and `src/compressed_publisher.cpp` of compressed_image_transport.

"""

import struct

import cv2
import numpy as np

from .contents import CompressedImage

INVERSE_DEPTH = 0
"""The one compressionFormat of compressed_depth_image_transport."""
CODES = 65534
"""Most steps between the codes of the nearest depth and of the farthest, 1; 0 = unknown."""
USUAL_A = 100.0 * (100.0 + 1.0)
"""m, of the plugin: q (q + 1), where its parameter depth_quantization q is 100 by default."""
PNG_LEVEL = 1
"""The fastest: higher ones take several times as long, and the noise of a depth stays."""
JPEG_QUALITY = 95
"""OpenCV's default, and that of the plugin."""


def compressed_depth(pixels, encoding, header, nearest, farthest):
    """
    Return a depth image as compressed_depth_image_transport writes it.

    A depth Z in m becomes the code A / Z + B, rounded; a reader computes A / (code - B), and NaN
    for the code 0. A and B stand in the message. A is that of the plugin, or smaller where the
    codes between the limits would not fit 16 bits; B gives the farthest depth the code 1. The
    error is at most half a code, Z^2 / (2 A). mm are stored as they are.

    Parameters
    ----------
    pixels : numpy.ndarray, float32 or uint16, shape (H, W)
        m with NaN = unknown, or mm with 0 = unknown.
    encoding : str
        '32FC1' or '16UC1'.
    header : Header
        Stamp and frame of the message.
    nearest, farthest : float
        Limits of the depth, m.

    Returns
    -------
    content : CompressedImage
        data: int32 format, float32 A, float32 B, then a PNG of 16 bits.

    """
    a = b = 0.0
    if encoding == '32FC1':
        a = min(USUAL_A, CODES / (1 / nearest - 1 / farthest))
        b = 1 - a / farthest
        codes = np.rint(np.float32(a) / pixels + np.float32(b))
        pixels = np.nan_to_num(np.clip(codes, 1, CODES + 1), nan=0.0).astype(np.uint16)
    data = struct.pack('<iff', INVERSE_DEPTH, a, b) + _encoded(
        '.png', pixels, cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL)
    return CompressedImage(header, f'{encoding}; compressedDepth png',
                           np.frombuffer(data, np.uint8))


def jpeg(picture, header):
    """
    Return a picture as compressed_image_transport writes it.

    Parameters
    ----------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.
    header : Header
        Stamp and frame of the message.

    Returns
    -------
    content : CompressedImage

    """
    data = _encoded('.jpg', cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), cv2.IMWRITE_JPEG_QUALITY,
                    JPEG_QUALITY)
    return CompressedImage(header, 'bgr8; jpeg compressed bgr8', np.frombuffer(data, np.uint8))


def _encoded(suffix, pixels, *options):
    """Return an image as the bytes of a file; OpenCV raises where it cannot."""
    return cv2.imencode(suffix, pixels, options)[1].tobytes()
