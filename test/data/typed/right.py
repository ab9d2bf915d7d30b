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
"""A user's script, as mypy sees it: every call is right, and every type is known."""

from dataclasses import replace
from pathlib import Path

from color_stereo_ros import __version__
from color_stereo_ros.core import (
    CalibrationError, ColorStereo, make_pattern, RangeResult, Settings, Status, StereoCalibration)

import numpy as np
from numpy.typing import NDArray


def sensor(folder: Path) -> ColorStereo:
    """Return a sensor for a working range of .22 to .62 m."""
    settings = Settings()
    settings = replace(settings, range=replace(settings.range, min_depth=0.22, max_depth=0.62))
    settings = settings.updated({'matching.method': 'surface'})
    try:
        calibration = StereoCalibration.from_yaml(folder / 'left.yaml', folder / 'right.yaml')
    except CalibrationError:
        calibration = StereoCalibration.from_arrays(
            (640, 480), np.eye(3), None, np.eye(3), [], np.eye(3), [-0.1, 0, 0])
    return ColorStereo(calibration, settings)


def nearest(result: RangeResult) -> float:
    """Return the smallest depth, m."""
    depth: NDArray[np.float32] = result.depth
    known = result.status == Status.VALID
    return float(depth[known].min())


def measured(stereo: ColorStereo, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> str:
    """Return what a pair tells."""
    first = stereo.process(left, right)
    result = stereo.process(left, right, first.alignment, first.projector, first.health)
    points: NDArray[np.float32] = result.points()
    normals: NDArray[np.float32] = result.normals()
    focal: float = result.geometry.focal_x
    pattern: NDArray[np.uint8] = make_pattern(stereo.settings.pattern)
    rows = result.alignment.sentence() if result.alignment else Status.NO_MATCH.meaning
    return (f'{__version__} {nearest(result)} {points.shape} {normals.shape} {focal} '
            f'{pattern.shape} {rows} {result.disparity_limits[0]} {result.seconds.keys()}')
