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
"""The colors of pictures for people: depth and status, one color for each value of a pixel."""

from functools import lru_cache

import cv2
import numpy as np

from .status import Status
from ..errors import SettingsError

RANGE_COLORS = ('viridis', 'paper')
"""Names of the maps of depth; the first is the default."""
RANGE_LIMITS = ('fixed', 'automatic')
"""Where the colors of depth begin and end; the first is the default."""

_LEVELS = 255  # of known depths; index 0 is unknown
_DARKEST = 36  # of viridis' 256 colors: the darker ones look like unknown
_NEAR_HUE, _FAR_HUE = 285.0, 28.0  # degrees, of the paper's map: purple .. orange
_PERCENTILES = 0.5, 99.5
_PERCENTILE_STEP = 4  # px: every fourth pixel of every fourth row shows where the depths lie
_LEAST_EXTENT = 1.001  # far / near of automatic limits, so that the colors of a plane are defined

STATUS_COLORS = {
    Status.VALID: (235, 235, 235),
    Status.OUTSIDE_IMAGE: (0, 0, 0),
    Status.DARK: (0, 114, 178),
    Status.SATURATED: (240, 228, 66),
    Status.NO_MATCH: (213, 94, 0),
    Status.AMBIGUOUS: (230, 159, 0),
    Status.INCONSISTENT: (204, 121, 167),
    Status.OUT_OF_RANGE: (86, 180, 233),
    Status.IMPLAUSIBLE: (0, 158, 115),
    Status.MOVED: (115, 115, 115),
}
"""
RGB of each status: the colors of Okabe and Ito (Color Universal Design, 2008), and two grays.

They differ for people with any kind of color blindness. Light gray is a pixel with a range.

"""


def false_color(depth, near, far, colors=RANGE_COLORS[0]):
    """
    Draw depth in false colors, black where it is unknown.

    `viridis` is perceptually uniform: equal steps of depth look equally large. Its lightness
    falls from near (yellow) to far (violet). Therefore people with color blindness see the same
    order, as does everybody in a gray print. Turbo and the hues of `paper` are not uniform;
    cividis has fewer colors that can be told apart. `paper` is the map of the paper's fig. 3.5:
    near purple, far orange.

    Parameters
    ----------
    depth : numpy.ndarray, float32, shape (H, W)
        m; NaN = unknown. Depths outside the limits get the color of the limit.
    near, far : float
        m; the color changes linearly with the depth between them.
    colors : str
        One of `RANGE_COLORS`.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    Raises
    ------
    SettingsError
        Unless near < far, or if there are no such colors.

    """
    if not near < far:
        raise SettingsError(f'near = {near} m must be smaller than far = {far} m')
    if colors not in RANGE_COLORS:
        raise SettingsError(f'colors = {colors!r} is not one of {", ".join(RANGE_COLORS)}')
    return cv2.applyColorMap(_color_index(depth, near, far), _palette(colors)[:, None])


def automatic_limits(depth):
    """
    Return the depths between which 99 % of the known pixels lie.

    Parameters
    ----------
    depth : numpy.ndarray, float32, shape (H, W)
        m; NaN = unknown. Every fourth pixel of every fourth row counts.

    Returns
    -------
    limits : (float, float) or None
        m, near < far: the percentiles 0.5 and 99.5. None where nothing is known.

    """
    seen = depth[::_PERCENTILE_STEP, ::_PERCENTILE_STEP]
    known = seen[np.isfinite(seen)]
    if not known.size:
        return None
    near, far = (float(limit) for limit in np.percentile(known, _PERCENTILES))
    return near, max(far, near * _LEAST_EXTENT)


def range_limits(depth, fixed, choice):
    """
    Return where the colors of a depth image begin and end.

    Parameters
    ----------
    depth : numpy.ndarray, float32, shape (H, W)
        m; NaN = unknown.
    fixed : RangeSettings
        The working range; it also serves where nothing is known.
    choice : str
        One of `RANGE_LIMITS`.

    Returns
    -------
    near, far : float
        m.

    """
    found = automatic_limits(depth) if choice == 'automatic' else None
    return found or (fixed.min_depth, fixed.max_depth)


def status_picture(status):
    """
    Draw the status of each pixel in the colors of `STATUS_COLORS`.

    Parameters
    ----------
    status : numpy.ndarray, uint8, shape (H, W)
        Codes of `Status`.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    """
    return cv2.applyColorMap(status, _status_palette()[:, None])


VIEW_COLORS = {3: ('right camera and projector', (215, 215, 215)),
               1: ('right camera', (86, 180, 233)),
               2: ('projector alone', (230, 159, 0)),
               0: ('no range', (0, 0, 0))}
"""Name and color, RGB, of who saw a pixel beside the left camera; see `Measurement.views`."""


def views_picture(views):
    """
    Draw who saw each pixel in the colors of `VIEW_COLORS`.

    Parameters
    ----------
    views : numpy.ndarray, uint8, shape (H, W)
        Bits: 1 right camera, 2 projector.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    """
    palette = np.array([VIEW_COLORS[bits][1] for bits in sorted(VIEW_COLORS)], np.uint8)
    return palette[views & 3]


def _color_index(depth, near, far):
    """Return uint8: 0 = unknown, 1 = near .. 255 = far."""
    scaled = (depth - np.float32(near)) * np.float32((_LEVELS - 1) / (far - near))
    scaled += np.float32(1.5)
    np.clip(scaled, 1.0, _LEVELS, out=scaled)
    cv2.patchNaNs(scaled, 0.0)
    return scaled.astype(np.uint8)


@lru_cache(maxsize=len(RANGE_COLORS))
def _palette(colors):
    """Return the RGB colors of the indices, uint8 (256, 3)."""
    known = _viridis() if colors == 'viridis' else _paper()
    return np.concatenate((np.zeros((1, 3), np.uint8), known))


def _viridis():
    """Return OpenCV's viridis from yellow to violet, uint8 (255, 3)."""
    steps = np.rint(np.linspace(255, _DARKEST, _LEVELS)).astype(np.uint8)
    return cv2.applyColorMap(steps[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1]


def _paper():
    """Return the paper's purple .. orange, uint8 (255, 3)."""
    hue = np.linspace(_NEAR_HUE, _FAR_HUE, _LEVELS, dtype=np.float32)
    strong = np.full(_LEVELS, 0.95, np.float32)
    hsv = np.stack((hue, strong, np.ones_like(hue)), axis=1)
    return np.rint(cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0] * 255.0).astype(np.uint8)


@lru_cache(maxsize=1)
def _status_palette():
    """Return the RGB colors of all codes, uint8 (256, 3); codes without a meaning are black."""
    palette = np.zeros((256, 3), np.uint8)
    for code, color in STATUS_COLORS.items():
        palette[code] = color
    return palette
