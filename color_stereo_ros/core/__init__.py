# SPDX-License-Identifier: Apache-2.0
"""The core library: calibrated color pairs in, range images out. It knows nothing of ROS."""

from . import _threads  # noqa: F401, before any kernel starts numba's threads
from .calibration import CameraModel, StereoCalibration
from .pattern import make_pattern
from .pipeline import ColorStereo
from .settings import (ColorSettings, MatchingSettings, PatternSettings, RangeSettings, Settings)
from .types import (CalibrationError, ColorStereoError, ImageError, RangeResult, RecordingError,
                    RectifiedGeometry, RectifiedPair, SettingsError, Status)

__all__ = [
    'CalibrationError', 'CameraModel', 'ColorSettings', 'ColorStereo', 'ColorStereoError',
    'ImageError', 'MatchingSettings', 'PatternSettings', 'RangeResult', 'RangeSettings',
    'RecordingError', 'RectifiedGeometry', 'RectifiedPair', 'Settings', 'SettingsError', 'Status',
    'StereoCalibration', 'make_pattern']
