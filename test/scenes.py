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
"""Pairs with known truth for the tests: path-traced ones from files and tiny ones made here."""

from dataclasses import dataclass
from pathlib import Path

from color_stereo_ros.core import Settings, StereoCalibration
from color_stereo_ros.core.patterns.colors import constant_sum_colors
import cv2
import numpy as np

SCENES = Path(__file__).parent / 'data' / 'scenes'


@dataclass(frozen=True, eq=False)
class Scene:
    """A raw pair, its calibration and its truth."""

    calibration: StereoCalibration
    left: np.ndarray
    right: np.ndarray
    depth: np.ndarray
    """float32 (H, W), m, at the rectified left pixels."""
    visible: np.ndarray
    """bool (H, W): seen by both cameras and lit."""

    def share_correct(self, result, tolerance=0.01):
        """Return the share of the visible pixels whose depth is right within 1 %."""
        with np.errstate(invalid='ignore'):
            right = np.abs(result.depth - self.depth) <= tolerance * self.depth
        return np.count_nonzero(right & self.visible) / np.count_nonzero(self.visible)

    def mean_error(self, result):
        """Return the mean relative depth error of all visible pixels that have a range."""
        known = self.visible & np.isfinite(result.depth)
        return np.mean(np.abs(result.depth - self.depth)[known] / self.depth[known])


def load(name):
    """Return one of the path-traced scenes."""
    folder = SCENES / name
    images = [np.ascontiguousarray(cv2.imread(str(folder / f'{side}.png'))[..., ::-1])
              for side in ('left', 'right')]
    with np.load(folder / 'truth.npz') as truth:
        return Scene(StereoCalibration.from_yaml(folder / 'left.yaml', folder / 'right.yaml'),
                     *images, truth['depth'], truth['visible'])


def parallel_rig(width=64, height=24, focal=80.0, baseline=0.1):
    """Return the calibration of two ideal parallel cameras."""
    K = [[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]]
    return StereoCalibration.from_arrays((width, height), K, [], K, [], np.eye(3),
                                         [-baseline, 0, 0])


def hue_pair(disparity, width=64, height=24, period=40.0, brightness=200.0):
    """
    Return a noise-free pair of a plane at a given disparity under a constant-sum sweep.

    The right image is the left one moved by the disparity, exactly, before rounding to 8 bits.

    """
    columns = np.arange(width)
    pair = []
    for shift in (0.0, disparity):
        colors = constant_sum_colors(3.0 * (columns + shift) / period)
        row = np.rint(brightness * colors).astype(np.uint8)
        pair.append(np.ascontiguousarray(np.broadcast_to(row, (height, width, 3))))
    return pair


def paper_settings(**changes):
    """Return settings of the paper's method; changes name settings with __ for the dot."""
    values = {'matching.method': 'paper', 'pattern.type': 'sweep'}
    values.update({name.replace('__', '.'): value for name, value in changes.items()})
    return Settings().updated(values)
