# SPDX-License-Identifier: Apache-2.0
"""The errors of the simulated rig."""

from color_stereo_ros.errors import ColorStereoError, SettingsError


class SceneError(SettingsError):
    """A scene description is malformed; the text names the field, its value and what is legal."""


class SimulatorMissingError(ColorStereoError):
    """The renderer is not installed; the text names the extra that installs it."""
