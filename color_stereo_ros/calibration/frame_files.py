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
"""Folders of images that were taken under the frames of a projector."""

from pathlib import Path
import re

import numpy as np

from ..errors import CalibrationError
from ..files.image import read_image

SUFFIXES = '.png', '.bmp', '.tif', '.tiff', '.webp', '.ppm', '.jpg', '.jpeg'


def read_frames(folder, side):
    """
    Read the images of one camera; several of one frame are averaged.

    Parameters
    ----------
    folder : path-like
        Holds `SIDE/NAME.png` or `SIDE_NAME.png`; `NAME_1.png`, `NAME_2.png` are of one frame.
    side : str
        'left' or 'right'.

    Returns
    -------
    images : dict
        Names of frames to float64 (H, W, 3), RGB, DN.

    Raises
    ------
    CalibrationError
        If the folder holds no image of this camera, or images of one frame differ in size.
    RecordingError, ImageError
        If a file cannot be read.

    """
    folder, found = Path(folder), {}
    if not folder.is_dir():
        raise CalibrationError(f'{folder}: is no folder of images')
    paths = [*((path.stem, path) for path in sorted((folder / side).glob('*'))),
             *((path.stem.removeprefix(f'{side}_'), path)
               for path in sorted(folder.glob(f'{side}_*')))]
    for stem, path in paths:
        if path.suffix.lower() in SUFFIXES:
            found.setdefault(_frame_of(stem), []).append(path)
    if not found:
        raise CalibrationError(f'{folder}: holds no image of the {side} camera, such as '
                               f'{side}_white.png or {side}/white.png')
    return {name: _mean(each) for name, each in found.items()}


def _frame_of(stem):
    """Return the name of a frame: white for white_2, but level_64 as it is."""
    if re.fullmatch(r'level_\d+', stem):
        return stem
    return re.sub(r'_\d+$', '', stem)


def _mean(paths):
    """Return the mean of image files of one size."""
    images = [read_image(path) for path in paths]
    for path, image in zip(paths, images):
        if image.shape != images[0].shape:
            raise CalibrationError(f'{path}: has {image.shape[1]} x {image.shape[0]} px, expected '
                                   f'{images[0].shape[1]} x {images[0].shape[0]} px as '
                                   f'{paths[0].name}')
    return np.mean(images, axis=0, dtype=np.float64)
