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
"""The core library: calibrated color pairs in, range images out. It needs no ROS."""

from .compiled import threads  # noqa: F401, before any kernel starts numba's threads

from .cameras.calibration import CameraModel, StereoCalibration  # noqa: I100
from .cameras.geometry import RectifiedGeometry, RectifiedPair
from .patterns.making import make_pattern
from .pipeline import ColorStereo
from .results import RangeResult
from .rows.alignment import Alignment
from .settings import ColorSettings, MatchingSettings, PatternSettings, RangeSettings, Settings
from .status import Status
from ..errors import CalibrationError, ColorStereoError, ImageError, RecordingError, SettingsError

__all__ = [
    'Alignment', 'CalibrationError', 'CameraModel', 'ColorSettings', 'ColorStereo',
    'ColorStereoError', 'ImageError', 'MatchingSettings', 'PatternSettings', 'RangeResult',
    'RangeSettings', 'RecordingError', 'RectifiedGeometry', 'RectifiedPair', 'Settings',
    'SettingsError', 'Status', 'StereoCalibration', 'make_pattern']
