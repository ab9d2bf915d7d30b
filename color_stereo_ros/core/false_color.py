# SPDX-License-Identifier: Apache-2.0
"""Depth as a picture: false colors with a scale bar (paper, fig. 3.5)."""

from functools import lru_cache

import cv2
import numpy as np

from ..errors import SettingsError

_NEAR_HUE, _FAR_HUE = 285.0, 28.0  # degrees: purple .. orange
_BAR_WIDTH = 14
_LABEL_FONT = cv2.FONT_HERSHEY_SIMPLEX
_LABEL_SCALE = 0.38
_LABEL_HEIGHT = 12


def false_color(depth, near, far, *, scale_bar=True):
    """
    Draw depth: purple at `near`, orange at `far`, black where it is unknown.

    Parameters
    ----------
    depth : numpy.ndarray, float32, shape (H, W)
        m; NaN = unknown. Depths outside the limits get the color of the limit.
    near, far : float
        m; the color changes linearly with the depth between them.
    scale_bar : bool
        Put a bar with labels in m to the left of the picture, near at the bottom.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W + `scale_bar_width(H, near, far)`, 3)
        RGB.

    Raises
    ------
    SettingsError
        Unless near < far.

    """
    if not near < far:
        raise SettingsError(f'near = {near} m must be smaller than far = {far} m')
    picture = _colored(_color_index(depth, near, far))
    if not scale_bar:
        return picture
    return np.concatenate((_scale_bar(depth.shape[0], float(near), float(far)), picture), axis=1)


def scale_bar_width(height, near, far):
    """Return the columns that the scale bar of a picture takes, px."""
    return _scale_bar(height, float(near), float(far)).shape[1]


def _color_index(depth, near, far):
    """Return uint8: 0 = unknown, 1 = near .. 255 = far."""
    scaled = (depth - np.float32(near)) * np.float32(254.0 / (far - near)) + np.float32(1.5)
    np.clip(scaled, 1.0, 255.0, out=scaled)
    cv2.patchNaNs(scaled, 0.0)
    return scaled.astype(np.uint8)


def _colored(index):
    """Return the colors of an index image, uint8 (H, W, 3)."""
    return cv2.applyColorMap(index, _palette()[:, None])


@lru_cache(maxsize=1)
def _palette():
    """Return the RGB colors of the indices, uint8 (256, 3)."""
    hue = np.linspace(_NEAR_HUE, _FAR_HUE, 255, dtype=np.float32)
    hsv = np.stack((hue, np.full(255, 0.95, np.float32), np.ones(255, np.float32)), axis=1)
    rgb = cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0]
    return np.concatenate((np.zeros((1, 3)), np.rint(rgb * 255.0))).astype(np.uint8)


@lru_cache(maxsize=8)
def _scale_bar(height, near, far):
    """Return the bar with its labels, RGB, near at the bottom."""
    count = int(np.clip(height // 48 + 1, 2, 11))
    labels = np.linspace(near, far, count)
    digits = int(np.clip(np.ceil(1.0 - np.log10((far - near) / (count - 1))), 0, 4))
    texts = [f'{label:.{digits}f}' for label in labels]
    texts[-1] += ' m'
    text_width = max(cv2.getTextSize(text, _LABEL_FONT, _LABEL_SCALE, 1)[0][0] for text in texts)
    bar = np.zeros((height, _BAR_WIDTH + text_width + 10, 3), np.uint8)
    depth = np.linspace(far, near, height, dtype=np.float32)[:, None]
    bar[:, :_BAR_WIDTH] = _colored(_color_index(depth, near, far))
    for label, text in zip(labels, texts):
        row = round((height - 1) * (far - label) / (far - near))
        bar[row, :_BAR_WIDTH + 3] = 255
        baseline = int(np.clip(row + 4, _LABEL_HEIGHT - 3, max(height - 3, 1)))
        cv2.putText(bar, text, (_BAR_WIDTH + 6, baseline), _LABEL_FONT, _LABEL_SCALE,
                    (255, 255, 255), 1, cv2.LINE_AA)
    bar.setflags(write=False)
    return bar
