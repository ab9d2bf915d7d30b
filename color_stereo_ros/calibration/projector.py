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
"""
The response of a projector, measured through a camera of known colors.

The projector shows even gray of known levels on a white card. In linear light above black

    light(level) / light(white) = (level / 255)^gamma

for each channel. Patterns are linear light, so that a projector must be given 255 (v / 255)^(1 /
gamma) for a value v.

"""

from dataclasses import dataclass
import re

import numpy as np

from ..core.color_calibration import ColorCalibration, ColorCorrection, PEDESTAL, SATURATED
from ..errors import CalibrationError
from ..files.atomic import write_text
from ..files.yaml import load_yaml, UnreadableError, yaml_text

FULL_SCALE = 255
GAMMAS = 0.2, 5.0
_LEAST_LIGHT = 30.0
"""DN of white above black of a pixel that counts."""
_LEAST_PIXELS = 200
_LEAST_SHARE = 0.01
"""Light below this share of white is mostly noise."""


@dataclass(frozen=True)
class ProjectorResponse:
    """Gamma of the three channels of a projector; the file of `calibrate projector`."""

    gamma: tuple
    """Of red, green and blue."""

    def __post_init__(self):
        """Refuse what is no gamma."""
        values = tuple(self.gamma) if isinstance(self.gamma, (list, tuple)) else ()
        if len(values) != 3 or not all(
                isinstance(value, (int, float)) and GAMMAS[0] <= value <= GAMMAS[1]
                for value in values):
            raise CalibrationError(f'gamma = {self.gamma!r}, expected three numbers in '
                                   f'{GAMMAS[0]} .. {GAMMAS[1]}')
        object.__setattr__(self, 'gamma', tuple(float(value) for value in values))

    @classmethod
    def read(cls, path):
        """Read a file; raise CalibrationError, which names file and value."""
        try:
            content = load_yaml(path)
            if not isinstance(content, dict) or 'projector_gamma' not in content:
                raise CalibrationError('is no response of a projector; `color_stereo calibrate '
                                       'projector` makes one')
            return cls(content['projector_gamma'])
        except (UnreadableError, CalibrationError) as error:
            raise CalibrationError(f'{path}: {error}') from error

    def write(self, path, **options):
        """Write a YAML file, whole or not at all; options are those of `files.atomic`."""
        values = [round(value, 4) for value in self.gamma]
        write_text(path, yaml_text({'projector_gamma': values}), **options)

    def corrected(self, image):
        """
        Return what the projector must be given to show an image in linear light.

        Parameters
        ----------
        image : numpy.ndarray, uint8, shape (H, W, 3)
            RGB, linear light.

        Returns
        -------
        image : numpy.ndarray, uint8, shape (H, W, 3)
            The same array where gamma is 1.

        """
        if self.gamma == (1.0, 1.0, 1.0):
            return image
        levels = np.arange(FULL_SCALE + 1) / FULL_SCALE
        tables = [np.rint(FULL_SCALE * levels ** (1 / gamma)).astype(np.uint8)
                  for gamma in self.gamma]
        return np.stack([table[image[..., channel]] for channel, table in enumerate(tables)],
                        axis=-1)


@dataclass(frozen=True, eq=False)
class ProjectorFindings:
    """A response and how well it explains the images."""

    response: ProjectorResponse
    levels: tuple
    """Gray levels that were shown, beside black and white."""
    error: float
    """Root mean square of the differences of light, share of white."""


def calibrate_projector(images, colors, side='left'):
    """
    Return the ProjectorFindings of images of gray light.

    Parameters
    ----------
    images : dict
        `white`, `black` and `level_N` for one or several N in 1 .. 254, RGB in DN, uint8 or float
        (H, W, 3): what a camera sees of a white card under even gray of this level.
    colors : ColorCalibration
        Of the colors of both cameras.
    side : str
        Of the camera, 'left' or 'right'.

    Raises
    ------
    CalibrationError
        If a frame is missing, the camera is another one, or the light does not grow with the
        level.

    """
    levels = checked_levels(images)
    light = {name: linear_light(image, colors, side) for name, image in images.items()}
    white = light['white'] - light['black']
    usable = (white.min(axis=-1) > _LEAST_LIGHT) & (light['white'].max(axis=-1) < SATURATED)
    if np.count_nonzero(usable) < _LEAST_PIXELS:
        raise CalibrationError('white is too dark or overexposed: fewer than '
                               f'{_LEAST_PIXELS} pixels are {_LEAST_LIGHT:.0f} DN brighter than '
                               'black and below full scale')
    shares = np.array([np.median((light[f'level_{level}'] - light['black'])[usable]
                                 / white[usable], axis=0) for level in levels])
    if (np.diff(shares, axis=0) <= 0).any() or shares.max() >= 1:
        raise CalibrationError(f'the light does not grow with the levels {levels}: shares of '
                               f'white {np.round(shares.mean(axis=1), 3).tolist()}')
    values = np.array(levels) / FULL_SCALE
    gamma = [_gamma(values, share) for share in shares.T]
    error = np.sqrt(np.mean((values[:, None] ** np.array(gamma) - shares) ** 2))
    return ProjectorFindings(ProjectorResponse(tuple(gamma)), tuple(levels), float(error))


def checked_levels(images):
    """Return the gray levels of the images, ascending, or raise CalibrationError."""
    for name in ('white', 'black'):
        if name not in images:
            raise CalibrationError(f'the frame {name!r} is missing; needed are white, black and '
                                   'level_N with N in 1 .. 254')
    levels = sorted(int(found[1]) for found in map(re.compile(r'level_(\d+)').fullmatch, images)
                    if found)
    if not levels or levels[0] < 1 or levels[-1] >= FULL_SCALE:
        raise CalibrationError(f'gray levels {levels}: expected at least one in 1 .. 254')
    return levels


def linear_light(image, colors, side):
    """Return an image in linear light, float32 (H, W, 3), DN above `PEDESTAL`."""
    size = getattr(colors, side).size
    if image.shape != (size[1], size[0], 3):
        raise CalibrationError(f'the image has {image.shape[1]} x {image.shape[0]} px, but the '
                               f'color calibration is of {size[0]} x {size[1]} px')
    raw = np.clip(np.rint(image), 0, FULL_SCALE).astype(np.uint8)
    corrected = ColorCorrection(ColorCalibration(*2 * [getattr(colors, side)])).apply(raw, raw)[0]
    return corrected.astype(np.float32) - np.float32(PEDESTAL)


def _gamma(values, shares):
    """Return the exponent for which values ** gamma is nearest to the shares, by Gauss-Newton."""
    bright = shares > _LEAST_SHARE
    if not bright.any():
        raise CalibrationError(f'all levels are darker than {_LEAST_SHARE:.0%} of white: show '
                               'brighter ones')
    values, shares = values[bright], shares[bright]
    gamma = float(np.median(np.log(shares) / np.log(values)))
    for _ in range(20):
        model = values ** gamma
        slope = model * np.log(values)
        gamma += float(slope @ (shares - model) / (slope @ slope))
    return min(max(gamma, GAMMAS[0]), GAMMAS[1])
