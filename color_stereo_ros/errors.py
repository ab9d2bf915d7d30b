# SPDX-License-Identifier: Apache-2.0
"""The one exception family of this package."""


class ColorStereoError(ValueError):
    """Base of every error that this package raises on purpose; its text names value and range."""


class SettingsError(ColorStereoError):
    """A setting has a wrong type, lies outside its range, or contradicts another one."""


class CalibrationError(ColorStereoError):
    """A stereo calibration is missing, malformed or physically impossible."""


class ImageError(ColorStereoError):
    """An image has the wrong size, type or encoding."""


class RecordingError(ColorStereoError):
    """A recording or a result file cannot be read or written."""


class ForkError(ColorStereoError):
    """A process was forked after ColorStereo had been used, and cannot compute."""


class InstallationError(ColorStereoError, ImportError):
    """A package that this one needs is missing or does not fit; the text says what to install."""
