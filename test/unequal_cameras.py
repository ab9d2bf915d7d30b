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
"""Two cameras with unlike colors before a white card, without the simulator."""

from dataclasses import dataclass

from color_stereo_ros.core import PatternSettings
from color_stereo_ros.core.patterns.frames import make_frame
import cv2
import numpy as np

FRAMES = 'white', 'black', 'red', 'green', 'blue', 'mask', 'complement'


@dataclass(frozen=True)
class Eye:
    """A camera: from light of the projector, 0..1, to 8-bit numbers."""

    gains: tuple = (1.0, 1.0, 1.0)
    gamma: float = 1.0
    crosstalk: float = 0.0
    dark: float = 3.0
    shading: float = 0.0
    """By how much red is weaker in the corners."""
    zoom: float = 0.0
    """By how much red is magnified more than green."""

    def mix(self):
        """Return the crosstalk matrix, rows add up to 1."""
        return np.full((3, 3), self.crosstalk) + np.eye(3) * (1 - 3 * self.crosstalk)

    def see(self, light, rng, brightness=0.75, noise=1.0):
        """Return an image of light, uint8 (H, W, 3); noise in multiples of a usual camera's."""
        signal = brightness * (light @ self.mix().T) * self.gains
        y, x = (np.linspace(-1, 1, count) for count in light.shape[:2])
        signal[..., 0] *= 1 - self.shading * (np.square(y[:, None]) + np.square(x)) / 2
        if self.zoom:
            signal[..., 0] = magnified(signal[..., 0], 1 + self.zoom)
        deviation = noise * np.sqrt(1.0 + 0.1 * 255 * signal) / 255
        signal = np.clip(signal + deviation * rng.standard_normal(signal.shape), 0, None)
        level = self.dark / 255 + (1 - self.dark / 255) * signal ** (1 / self.gamma)
        return np.clip(np.rint(255 * level), 0, 255).astype(np.uint8)


def magnified(plane, factor):
    """Return an image magnified about its center."""
    height, width = plane.shape
    center = (width - 1) / 2, (height - 1) / 2
    move = np.array([[factor, 0, (1 - factor) * center[0]], [0, factor, (1 - factor) * center[1]]])
    return cv2.warpAffine(plane, move, (width, height), flags=cv2.INTER_CUBIC,
                          borderMode=cv2.BORDER_REPLICATE)


def card(name, width, height):
    """Return the light of a frame on a card, float64 (H, W, 3), brighter in the middle."""
    frame = make_frame(name, PatternSettings(width=2 * width, height=2 * height)) / 255.0
    light = cv2.resize(cv2.GaussianBlur(frame, (0, 0), 1.2), (width, height),
                       interpolation=cv2.INTER_AREA)
    y, x = (np.linspace(-1, 1, count) for count in (height, width))
    return (0.01 + 0.99 * light) * (1 - 0.2 * (y[:, None] ** 2 + x ** 2))[..., None]


def frames(eye, seed=0, width=320, height=240, names=FRAMES, noise=1.0):
    """Return what an Eye sees of the frames on a card, a dict."""
    rng = np.random.default_rng(seed)
    return {name: eye.see(card(name, width, height), rng, noise=noise) for name in names}
