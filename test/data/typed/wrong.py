# SPDX-License-Identifier: Apache-2.0
"""What mypy must find in a user's script: one mistake in each line that says so."""

from color_stereo_ros.core import ColorStereo, make_pattern, Settings, StereoCalibration


def mistakes(stereo: ColorStereo) -> None:
    """Make them."""
    ColorStereo('left.yaml')                     # mistake: no calibration
    StereoCalibration.from_yaml('left.yaml')     # mistake: one file
    stereo.process('left.png', 'right.png')      # mistake: no images
    stereo.settings.range.min_depht              # mistake: a name
    make_pattern(Settings())                     # mistake: all settings, not those of the pattern
    stereo.reset().depth                         # mistake: returns nothing
