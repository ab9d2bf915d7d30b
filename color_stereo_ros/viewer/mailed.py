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
"""Frames as one HTML file that can be sent by mail: scene and time bar, without clicks."""

from dataclasses import dataclass

import numpy as np

from .page import TITLE
from .scene import Scene
from ..pages.serving import ServedPage

MOST_EXACT = 240_000
"""Points of a frame that are kept as float32; chosen: the file has less than 6 MB then."""
MOST = 450_000
"""Points of a frame at all; chosen likewise."""
PICTURE_WIDTH = 640
"""px; chosen: the pictures are a tenth of the file."""
SECONDS = 1.0
"""s of a frame in the time bar."""


@dataclass(frozen=True)
class Mailed:
    """A file that can be sent by mail."""

    text: str
    """HTML."""
    precision: str
    """float32, or float16 where float32 would make the file too large."""
    step: int
    """Every step-th pixel of every step-th row is a point."""

    @property
    def megabytes(self):
        """Return the size of the file, MB."""
        return len(self.text.encode()) / 1e6


def mailed(frames):
    """
    Make a file of some frames.

    Parameters
    ----------
    frames : iterable of Frame
        At least one.

    Returns
    -------
    mailed : Mailed

    """
    frames = iter(frames)
    first = next(frames)
    count = np.count_nonzero(np.isfinite(first.result.depth))
    step = max(1, int(np.ceil(np.sqrt(count / MOST))))
    precision = 'float32' if count <= step * step * MOST_EXACT else 'float16'
    picture_step = max(1, round(first.size[0] / PICTURE_WIDTH))
    page = ServedPage('127.0.0.1', 0, TITLE, dark=True)
    try:
        scene = Scene(page.server, first, precision)
        scene.show(first, step, picture_step)
        serializer = page.server.get_scene_serializer()
        for frame in frames:
            serializer.insert_sleep(SECONDS)
            scene.show(frame, step, picture_step)
        serializer.insert_sleep(SECONDS)
        return Mailed(serializer.as_html(dark_mode=True), precision, step)
    finally:
        page.close()
