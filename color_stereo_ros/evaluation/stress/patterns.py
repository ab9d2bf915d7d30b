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
"""What the projector of the stress test shows: own patterns, foreign ones, and worn projectors."""

from dataclasses import dataclass, field

import cv2
import numpy as np

from ...core import make_pattern, PatternSettings

SIZE = (1024, 1024)  # px, of the foreign patterns; as the default one: they light the same


@dataclass(frozen=True, eq=False)
class Shown:
    """A pattern and what the projector makes of it."""

    key: str
    image: np.ndarray
    """uint8 (H, W, 3), RGB."""
    projector: dict = field(default_factory=dict)
    """Fields of `sim.rig.Projector` that differ from the rig's."""


def shown():
    """Return every pattern under which a scene is rendered, a list of Shown."""
    own = make_pattern(PatternSettings())
    height, width = own.shape[:2]
    wide = PatternSettings(width=1920, height=round(1920 * height / width))
    return [
        Shown('default', own), Shown('white', np.full_like(own, 255)),
        *(Shown(f'sine_{cycles}', make_pattern(PatternSettings(type='sine', cycles=cycles)))
          for cycles in (1, 16, 32)),
        Shown('sweep', make_pattern(PatternSettings(type='sweep'))),
        Shown('patches', patches()), Shown('speckle', speckle()), Shown('dots', dots()),
        Shown('gamma', own, {'gamma': 2.2}), Shown('defocus', own, {'blur': 3.0}),
        Shown('low_resolution', coarse(own, 640)), Shown('fine', make_pattern(wide))]


def patches(period=40):
    """Return colored patches that repeat in rows and columns, uint8 (H, W, 3)."""
    row, column = np.indices(SIZE[::-1]) / period
    waves = (1 / (1 + np.exp(-12 * np.sin(2 * np.pi * phase)))
             for phase in (column, row, column / 2))
    return np.uint8(np.round(255 * (0.15 + 0.85 * np.stack(list(waves), axis=-1))))


def speckle(sigma=2.2, seed=5):
    """Return gray blobs at random, uint8 (H, W, 3)."""
    noise = np.random.default_rng(seed).standard_normal(SIZE[::-1]).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), sigma)
    return gray(np.uint8(255 * np.clip(0.5 + smooth / (3 * smooth.std()), 0, 1)))


def dots(count=8700, seed=6):
    """Return white dots at random places, uint8 (H, W, 3)."""
    generator = np.random.default_rng(seed)
    image = np.zeros(SIZE[::-1], np.uint8)
    for column, row in zip(*(generator.integers(0, size, count).tolist() for size in SIZE)):
        cv2.circle(image, (column, row), 2, 255, -1, cv2.LINE_AA)
    return gray(image)


def gray(image):
    """Return an image of one channel with three equal ones."""
    return np.repeat(image[..., None], 3, axis=2)


def coarse(image, width):
    """Return a pattern as a projector of fewer columns shows it: in squares."""
    height = round(width * image.shape[0] / image.shape[1])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return np.repeat(np.repeat(small, 2, axis=0), 2, axis=1)
