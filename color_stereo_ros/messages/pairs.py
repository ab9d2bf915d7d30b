# SPDX-License-Identifier: Apache-2.0
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
