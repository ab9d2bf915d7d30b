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
"""Pairs of messages as pairs of images."""

from dataclasses import replace

from .decompressing import opened
from .reading import image_to_rgb
from .synchronizer import SIDES
from ..errors import ImageError


def rgb_pair(pair):
    """
    Return a Pair of image messages, raw or compressed, as a Pair of RGB images.

    Parameters
    ----------
    pair : Pair
        Images, calibration and stamp.

    Returns
    -------
    pair : Pair
        Of images, uint8 (H, W, 3).

    Raises
    ------
    ImageError
        Names the camera.

    """
    pair, images = opened(pair), {}
    for side in SIDES:
        try:
            images[side] = image_to_rgb(getattr(pair, side))
        except ImageError as error:
            raise ImageError(f'{side} image: {error}') from error
    return replace(pair, **images)
