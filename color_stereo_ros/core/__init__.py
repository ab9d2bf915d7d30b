# SPDX-License-Identifier: Apache-2.0
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
