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
"""Pairs of images of a board: what both cameras see of it, and how sharp."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from .edge_width import edge_width
from .gray import gray_of
from .views import SIDES, View
from ..errors import CalibrationError

BLURRED = 2.0   # times the usual width of the edges; chosen: the lens alone changes less
BLUNT = 4.0     # px: edges that are sharper are never called blurred


@dataclass(frozen=True, eq=False)
class Shot:
    """What a pair of images shows of the board."""

    name: str
    sizes: tuple
    """(width, height) of the left and of the right image, px."""
    left: object
    """Detection, or None where the left image does not show the board."""
    right: object
    """As `left`."""
    widths: tuple = (np.nan, np.nan)
    """Widths of the edges in the left and in the right image, px; NaN = unknown."""
    skew: int = 0
    """Stamp of the right image minus that of the left one, ns."""
    problem: str = None
    """Why the shot is of no use, or None."""

    @property
    def detections(self):
        """Return what both cameras see."""
        return self.left, self.right

    @property
    def view(self):
        """Return what an adjustment takes, a View."""
        return View(self.name, self.left, self.right)


def detect_shot(board, pair):
    """
    Find the board in both images of a pair.

    Parameters
    ----------
    board : Board
        The calibration board.
    pair : ImagePair
        The images of both cameras.

    Returns
    -------
    shot : Shot
        Without a verdict on its sharpness, which needs the other shots.

    Raises
    ------
    ImageError, RecordingError
        If an image cannot be read.

    """
    grays = [gray_of(image) for image in pair.images()]
    found = [board.detect(gray) for gray in grays]
    widths = tuple(np.nan if each is None else edge_width(board, each, gray)
                   for each, gray in zip(found, grays))
    return Shot(pair.name, tuple(gray.shape[::-1] for gray in grays), *found, widths, pair.skew,
                None if any(found) else 'the board is found in neither image')


def check_sizes(shots):
    """
    Refuse shots of different resolutions.

    Parameters
    ----------
    shots : list of Shot
        The views of the board.

    Returns
    -------
    size : (int, int)
        Width and height of all images, px.

    Raises
    ------
    CalibrationError
        Names a shot of each size.

    """
    sizes = Counter(size for shot in shots for size in shot.sizes)
    if len(sizes) == 1:
        return next(iter(sizes))
    usual = [Counter(shot.sizes[side] for shot in shots).most_common(1)[0][0]
             for side in range(2)]
    if usual[0] != usual[1]:
        raise CalibrationError(f'left images have {_size(usual[0])}, right images '
                               f'{_size(usual[1])}: set both cameras to the same resolution')
    odd = next((shot, side) for shot in shots for side in range(2)
               if shot.sizes[side] != usual[0])
    raise CalibrationError(
        f'images of {len(sizes)} resolutions: the {SIDES[odd[1]]} image of {odd[0].name} has '
        f'{_size(odd[0].sizes[odd[1]])}, {sizes[usual[0]]} others have {_size(usual[0])}; '
        'calibrate at the one resolution that is used later')


def _size(size):
    return f'{size[0]} x {size[1]} px'


def without_blurred(shots):
    """
    Give the shots that are much less sharp than the others a problem.

    Parameters
    ----------
    shots : list of Shot
        The views of the board.

    Returns
    -------
    shots : list of Shot

    """
    widths = np.array([shot.widths for shot in shots], np.float64).reshape(-1, 2)
    known = np.isfinite(widths)
    usual = [np.median(widths[known[:, side], side]) if known[:, side].any() else np.inf
             for side in range(2)]
    judged = []
    for shot in shots:
        blurred = [(side, width) for side, width, limit in zip(SIDES, shot.widths, usual)
                   if width > max(BLUNT, BLURRED * limit)]
        if blurred and shot.problem is None:
            side, width = blurred[0]
            shot = replace(shot, problem=f'blurred: edges of the {side} image are {width:.1f} px '
                           f'wide, usually {usual[SIDES.index(side)]:.1f} px; hold the board '
                           'still')
        judged.append(shot)
    return judged
