# SPDX-License-Identifier: Apache-2.0
"""The pictures of a frame."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..core.false_color import (
    automatic_limits, false_color, status_picture, views_picture)
from ..core.legends import with_scale_bar, with_status_legend, with_views_legend

LEFT, RIGHT = 'left', 'right'
NAMES = LEFT, RIGHT, 'colors', 'depth', 'confidence', 'status', 'std', 'views'
"""The pictures in the order of the wall: those with a wide legend come second in their row."""
DARKEST = 24
"""DN; chosen: below it colors are noise."""
MOST = 95
"""Percentile; chosen: standard deviations beyond it have the last color."""


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture of the wall."""

    title: str
    image: np.ndarray
    """uint8 (h, w', 3), RGB; a legend may be to the right of the first w columns."""
    width: int
    """w, columns without the legend."""


def pictures_of(frame, step=1, near=None, far=None):
    """
    Draw a frame.

    Parameters
    ----------
    frame : Frame
    step : int
        Every step-th pixel of every step-th row.
    near, far : float, optional
        m, of the first and the last color of depth; default: as the frame asks for.

    Returns
    -------
    pictures : dict
        NAMES to Picture; without LEFT and RIGHT where the raw images are not known.

    """
    part, result = np.s_[::step, ::step], frame.result
    depth = result.depth[part]
    if near is None:
        near, far = depth_limits(frame)
    std, most = result.depth_std[part], largest_std(result)
    shown = {
        LEFT: ('left camera, raw', frame.left),
        RIGHT: ('right camera, raw', frame.right),
        'colors': ('colors of the pattern', pattern_colors(result.image[part])),
        'depth': ('depth', with_scale_bar(false_color(depth, near, far), near, far)),
        'confidence': ('confidence: black 0, white 1', gray(result.confidence[part])),
        'std': (f'standard deviation: yellow 0, violet {1e3 * most:.2g} mm',
                false_color(std, 0.0, most)),
        'status': ('status: why a pixel has no range',
                   with_status_legend(status_picture(np.ascontiguousarray(result.status[part])))),
        'views': ('views: who saw it beside the left camera',
                  with_views_legend(views_picture(np.ascontiguousarray(result.views[part])))),
    }
    for side in (LEFT, RIGHT):
        title, image = shown[side]
        shown[side] = title, None if image is None else image[part]
    return {name: Picture(title, np.ascontiguousarray(image), depth.shape[1])
            for name, (title, image) in shown.items() if image is not None}


def depth_limits(frame):
    """Return the depths of the first and the last color, m."""
    return automatic_limits(frame.result.depth) or (0.0, 1.0)


def largest_std(result):
    """Return the standard deviation of the depth that has the last color, m."""
    std = result.depth_std[::4, ::4]
    known = std[np.isfinite(std)]
    return float(np.percentile(known, MOST)) if known.size else 1e-3


def gray(values):
    """Return values 0 .. 1 as a gray picture, uint8 (h, w, 3)."""
    return cv2.cvtColor((values * 255).astype(np.uint8), cv2.COLOR_GRAY2RGB)


def pattern_colors(image):
    """Return an image with its brightness divided out: what the pattern is, not the surface."""
    brightest = np.maximum(image.max(axis=2, keepdims=True), DARKEST)
    return (image * (255.0 / brightest)).astype(np.uint8)


def point_colors(frame, choice):
    """
    Return the color of each point.

    Parameters
    ----------
    frame : Frame
    choice : str
        One of POINT_COLORS.

    Returns
    -------
    colors : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.

    """
    return POINT_COLORS[choice](frame)


def _normals(frame):
    normals = np.nan_to_num(frame.result.normals(), nan=-1.0)
    return np.clip(127.5 - 127.5 * normals, 0, 255).astype(np.uint8)


POINT_COLORS = {
    'camera': lambda frame: frame.result.image,
    'depth': lambda frame: false_color(frame.result.depth, *depth_limits(frame)),
    'pattern': lambda frame: pattern_colors(frame.result.image),
    'confidence': lambda frame: gray(frame.result.confidence),
    'standard deviation': lambda frame: false_color(frame.result.depth_std, 0.0,
                                                    largest_std(frame.result)),
    'views': lambda frame: views_picture(frame.result.views),
    'normals': _normals,
}
"""Choices of the colors of points to functions of a Frame."""
