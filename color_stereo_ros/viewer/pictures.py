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
"""The pictures of a frame."""

import cv2
import numpy as np

from ..core.false_color import false_color, status_picture, views_picture
from ..core.legends import with_scale_bar, with_status_legend, with_views_legend

LEFT, RIGHT = 'left', 'right'
NAMES = LEFT, RIGHT, 'colors', 'depth', 'confidence', 'status', 'std', 'views'
"""The pictures in the order of the wall: those with a wide legend come second in their row."""
LEGEND = 480
"""px, height of a legend; chosen: the meanings of all status codes have room."""
DARKEST = 24
"""DN; chosen: below it colors are noise."""
GAINS = (255.0 / np.maximum(np.arange(256), DARKEST)).astype(np.float32)


def pictures_of(frame, step=1):
    """
    Draw a frame.

    Parameters
    ----------
    frame : Frame
        The measured pair that is shown.
    step : int
        Every step-th pixel of every step-th row.

    Returns
    -------
    pictures : dict
        NAMES to (title, uint8 (h, w, 3) RGB); without LEFT and RIGHT where the raw images are not
        known.

    """
    result, most = frame.result, frame.largest_std
    depth, std, confidence, status, views, image = (thinned(each, step) for each in (
        result.depth, result.disparity_std, result.confidence, result.status, result.views,
        result.image))
    std = depth * depth * std / np.float32(result.geometry.focal_baseline)
    shown = {
        LEFT: ('left camera, raw', frame.left),
        RIGHT: ('right camera, raw', frame.right),
        'colors': ('colors of the pattern', pattern_colors(image)),
        'depth': ('depth', false_color(depth, *frame.depth_limits)),
        'confidence': ('confidence: white 1', gray(confidence)),
        'std': (f'std: yellow 0, violet {1e3 * most:.2g} mm',
                false_color(std, 0.0, most)),
        'status': ('status: why there is no range', status_picture(status)),
        'views': ('views: who saw it', views_picture(views)),
    }
    for side in (LEFT, RIGHT):
        title, raw = shown[side]
        shown[side] = title, None if raw is None else thinned(raw, step)
    return {name: each for name, each in shown.items() if each[1] is not None}


def thinned(values, step):
    """Return about every step-th pixel of every step-th row of an image, contiguous."""
    if step == 1:
        return np.ascontiguousarray(values)
    height, width = values.shape[:2]
    # several times faster than a slice of NumPy
    return cv2.resize(values, (-(-width // step), -(-height // step)),
                      interpolation=cv2.INTER_NEAREST)


def legends_of(frame):
    """Return the strips that explain pictures: name to uint8 (LEGEND, w, 3), RGB."""
    nothing = np.zeros((LEGEND, 0, 3), np.uint8)
    # rounded, so that the strip of a scene that hardly changes stays the same
    limits = [round(limit, 3) for limit in frame.depth_limits]
    return {'depth': with_scale_bar(nothing, *limits), 'status': with_status_legend(nothing),
            'views': with_views_legend(nothing)}


def gray(values):
    """Return values 0 .. 1 as a gray picture, uint8 (h, w, 3)."""
    return cv2.cvtColor((values * 255).astype(np.uint8), cv2.COLOR_GRAY2RGB)


def pattern_colors(image):
    """Return an image with its brightness divided out: what the pattern is, not the surface."""
    red, green, blue = cv2.split(np.ascontiguousarray(image))
    gain = cv2.LUT(cv2.max(cv2.max(red, green), blue), GAINS)
    return cv2.multiply(image, cv2.merge([gain] * 3), dtype=cv2.CV_8U)


def point_colors(frame, choice):
    """
    Return the color of each point.

    Parameters
    ----------
    frame : Frame
        The measured pair that is shown.
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
    'depth': lambda frame: false_color(frame.result.depth, *frame.depth_limits),
    'pattern': lambda frame: pattern_colors(frame.result.image),
    'confidence': lambda frame: gray(frame.result.confidence),
    'standard deviation': lambda frame: false_color(frame.result.depth_std, 0.0,
                                                    frame.largest_std),
    'views': lambda frame: views_picture(frame.result.views),
    'normals': _normals,
}
"""Choices of the colors of points to functions of a Frame."""
