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
"""The one exception family of this package, and how its texts show what came from elsewhere."""

_SHOWN = 80
_BOUND = 1500


def brief(value):
    """
    Return a foreign value as Python writes it, at most about 80 characters of it.

    Parameters
    ----------
    value : object
        For example a frame_id of somebody else's message, which may have any length.

    Returns
    -------
    text : str
        In quotes if the value is a text; the middle of a long one is replaced by its length.

    """
    text = repr(value[:2 * _SHOWN] + value[-2 * _SHOWN:]
                if isinstance(value, str) and len(value) > 4 * _SHOWN else value)
    if len(text) <= _SHOWN:
        return text
    length = len(value) if isinstance(value, str) else len(text)
    return f'{text[:_SHOWN // 2]}... ({length} characters) ...{text[-_SHOWN // 4:]}'


def pip_install(extra):
    """
    Return the command that installs an extra of this package, for messages.

    It is right for a wheel and for an installation in place: pip takes the package that is there,
    and installs what the extra adds.

    """
    return f'pip install "color_stereo_ros[{extra}]"'


def bounded(text, limit=_BOUND):
    """Return a text for a log or for diagnostics; what exceeds the limit is cut off."""
    return text if len(text) <= limit else f'{text[:limit]}... ({len(text)} characters)'


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
