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
Settings, one frozen class per stage: the single source of every name, default, unit and range.

The ROS parameters, `config/*.yaml`, the command line and the documentation are all derived from
the fields below.

"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from .fields import explained, flat, Group, setting, updated
from ..methods import METHODS
from ..patterns.pattern import Repeats
from ..patterns.registry import PATTERNS, repeating
from ...errors import SettingsError


@dataclass(frozen=True)
class PatternSettings(Group):
    """What the projector shows."""

    prefix = 'pattern'

    type: str = setting(  # noqa: A003
        'hue_field', lambda: explained(PATTERNS, 'hue_field'), choices=PATTERNS)
    width: int = setting(
        1024, 'columns of the projector, those of its native resolution: a pattern that is scaled '
        'loses its smallest structures', unit='px', minimum=8, maximum=8192)
    height: int = setting(
        1024, 'rows of the projector, those of its native resolution', unit='px', minimum=8,
        maximum=8192)
    cycles: int = setting(
        1, lambda: f'repetitions over the width ({", ".join(repeating(Repeats.CYCLES))}); steeper '
        'colors are more precise, but the same ones may come again within the search',
        minimum=1, maximum=512)
    feature_size: float = setting(
        9.0, 'size of the smallest structure: correlation length of hue_field, shortest half wave '
        'of wave_field, width of a line or patch (lines, pseudo_noise), finest segment of '
        'walsh; should be 4 to 6 px wide in the images: smaller is more precise and asks more of '
        'projector and cameras', unit='px', minimum=1.0, maximum=256.0)
    seed: int = setting(
        1, 'of the random patterns hue_field, wave_field and pseudo_noise: another number is '
        'another pattern of the same kind; the projector and range_node need the same one',
        minimum=0, maximum=2**31 - 1)


def _aperiodic():
    """Return the types of pattern without repetition, as text."""
    *others, last = repeating(Repeats.NEVER)
    return f'{", ".join(others)} and {last}'


@dataclass(frozen=True)
class ColorSettings(Group):
    """Photometry: what happens to the colors before they are compared (paper, sec. 2.2)."""

    prefix = 'color'

    dark_level: float = setting(
        -1.0, 'signal of a camera that sees no light, subtracted first; -1 estimates it from '
        'each image; set what the images show with the lens caps on, where no part of a scene is '
        'dark', unit='DN', minimum=-1.0, maximum=128.0)
    saturation_level: int = setting(
        254, 'a channel at or above this is overexposed, of 8-bit values; set less where a camera '
        'ends below 255', unit='DN', minimum=1, maximum=256)
    min_signal: float = setting(
        4.0, 'paper method: smallest brightest channel above the dark level, below it a pixel '
        'counts as dark; surface method: sum of the channels below which a missing range is '
        'called DARK',
        unit='DN', minimum=0.0, maximum=255.0)
    equalize: bool = setting(
        True, 'equalize the channels of the cameras before anything else; the surface method '
        'removes half of the difference, since more would amplify the noise of a weak channel',
        off=False)
    equalize_cameras: str = setting(
        'automatic', lambda: 'separate: each camera has gains of its own; shared: two '
        'cameras of one type, the same gains for both (most precise); automatic: shared unless '
        f'they differ clearly (surface method: by 12 %, and only under {_aperiodic()}, of which '
        'both cameras see all hues; paper method: by 20 to 35 %)',
        choices=('automatic', 'shared', 'separate'))
    zero_weakest: bool = setting(
        True, 'paper method: set the weakest component to zero (right for sweep, bright_sweep '
        'and hue_field, where one component is always zero)', off=False, method='paper')
    scale: bool = setting(
        True, 'paper method: scale each color so that its components sum to 255', off=False,
        method='paper')
    calibration: str = setting(
        '', 'file of `color_stereo calibrate color`: raw images are corrected by it before '
        'anything else, and its dark level counts instead of color.dark_level; empty = none')
    smoothing: float = setting(
        1.0, 'paper method: standard deviation of the Gaussian smoothing of the corrected '
        'colors, 0 = none', unit='px', minimum=0.0, maximum=16.0, off=0.0, method='paper')


@dataclass(frozen=True)
class MatchingSettings(Group):
    """How corresponding points are found."""

    prefix = 'matching'

    method: str = setting(
        'surface', lambda: explained(METHODS, 'surface'), choices=METHODS)
    min_confidence: float = setting(
        0.6, 'surface method: least probability of being right within 1 px; a larger value gives '
        'fewer and better ranges', minimum=0.0, maximum=1.0)
    smoothness: float = setting(
        1.0, 'surface method: how much the coarse search dislikes steps of the disparity, as a '
        'factor of what suits the pattern; 0 = each node for itself, which loses ranges',
        minimum=0.0, maximum=10.0, off=0.0, method='surface')
    texture: float = setting(
        1.0, 'surface method: how much the brightness of the surface counts beside its color in '
        'the coarse search, as a factor of what suits the pattern; 0 = colors alone',
        minimum=0.0, maximum=10.0)
    refinements: int = setting(
        2, 'surface method: rounds of least squares; more are slower and hardly more precise; '
        '0 = coarse disparities only',
        minimum=0, maximum=10, off=0, method='surface')
    slanted: bool = setting(
        True, 'surface method: let the least-squares window lean with the surface; without, '
        'leaning surfaces have fewer and less precise ranges',
        off=False, method='surface')
    foreshortening: bool = setting(
        True, 'surface method: blur the left view of a leaning surface as the right one is',
        off=False, method='surface')
    propagation: bool = setting(
        True, 'surface method: let nodes near depth edges try the planes of their neighbors; '
        'without, a pair takes less time, and more ranges beside edges are wrong',
        off=False, method='surface')
    color_matching: bool = setting(
        True, 'surface method: measure the color difference of the cameras from each pair, also '
        'where it varies over the image',
        off=False, method='surface')
    blur_matching: bool = setting(
        True, 'surface method: measure by how much one view is blurred more than the other, and '
        'blur the sharper one alike', off=False, method='surface')
    occlusion_test: bool = setting(
        True, 'surface method: distrust places of the right image that two surfaces claim',
        off=False, method='surface')
    row_alignment: str = setting(
        'correct', 'surface method: what is done about rows of the two views that disagree, '
        'because a camera has moved or the calibration is not exact; off: nothing; measure: they '
        'are measured from each pair; correct: measured, and the rows of the right view are '
        'corrected', choices=('off', 'measure', 'correct'), off='off', method='surface')
    third_view: str = setting(
        'automatic', 'surface method: the projector as a third view, which measures where the '
        'right camera sees nothing and bears witness elsewhere; off: two cameras only, in about '
        'half of the time; automatic: once the projector is found, under a pattern that never '
        'repeats', choices=('off', 'automatic'), off='off', method='surface')
    min_segment: int = setting(
        120, 'surface method: smallest area of connected ranges; smaller islands are dropped, '
        'dark ones earlier', unit='px', minimum=0, maximum=1000000)
    window_width: int = setting(
        9, 'paper method: columns of the window, 2N+1', unit='px', minimum=1, maximum=63)
    window_height: int = setting(
        9, 'paper method: rows of the window, odd', unit='px', minimum=1, maximum=63)
    subpixel: str = setting(
        'parabola', 'paper method: parabola through three costs, the weighted neighbor of the '
        "paper's sec. 3, or none", choices=('parabola', 'weighted', 'none'))
    uniqueness_ratio: float = setting(
        0.0, 'paper method: the best cost elsewhere must be larger than the best cost by this '
        'share, 0.1 = by 10 %; 0 accepts all', minimum=0.0, maximum=10.0)
    left_right_tolerance: float = setting(
        1.0, 'paper method: largest difference between the matches left to right and right to '
        'left; 0 switches the test off', unit='px', minimum=0.0, maximum=64.0, off=0.0,
        method='paper')
    local_limit: float = setting(
        0.0, 'paper method: local disparity limit: a second search stays this close to the '
        'median disparity of the surroundings; 0 = global limits only',
        unit='px', minimum=0.0, maximum=256.0)

    def check_together(self) -> None:
        """Refuse even windows: they have no center."""
        for name in ('window_width', 'window_height'):
            if getattr(self, name) % 2 == 0:
                raise SettingsError(f'matching.{name} = {getattr(self, name)} px is even, '
                                    'expected an odd number 1 .. 63 px')


@dataclass(frozen=True)
class RangeSettings(Group):
    """The working range; disparity limits follow from it and the calibration."""

    prefix = 'range'

    min_depth: float = setting(
        0.2, 'nearest Z that is searched, along the optical axis of the rectified left camera; '
        'nothing nearer gets a range', unit='m', minimum=0.001, maximum=1000.0)
    max_depth: float = setting(
        1.0, 'farthest Z that is searched; set both as close to the scene as it allows: fewer '
        'places can be confused', unit='m', minimum=0.001, maximum=1000.0)

    def check_together(self) -> None:
        """Refuse an empty range."""
        if self.min_depth >= self.max_depth:
            raise SettingsError(f'range.min_depth = {self.min_depth} m must be smaller than '
                                f'range.max_depth = {self.max_depth} m')


@dataclass(frozen=True)
class HealthSettings(Group):
    """What is done where the cameras have moved since they were calibrated."""

    prefix = 'health'

    correct: str = setting(
        'off', 'surface method: drift between the cameras, which the rows of the pairs show; off: '
        'it is told; suggest: told, with the calibration that would fit; apply: pairs are '
        'measured with that calibration, up to 1 degree and 1 % of the focal length; files and '
        'camera_info stay as they are', choices=('off', 'suggest', 'apply'))


@dataclass(frozen=True)
class Settings:
    """
    All settings of the core.

    Change one with `dataclasses.replace(s, range=dataclasses.replace(s.range, min_depth=0.3))`
    or `s.updated({'range.min_depth': 0.3})`.

    """

    pattern: PatternSettings = PatternSettings()
    color: ColorSettings = ColorSettings()
    matching: MatchingSettings = MatchingSettings()
    range: RangeSettings = RangeSettings()  # noqa: A003
    health: HealthSettings = HealthSettings()

    def __post_init__(self):
        """Refuse a group of the wrong class."""
        for spec in fields(self):
            value = getattr(self, spec.name)
            if not isinstance(value, type(spec.default)):
                raise SettingsError(f'{spec.name} = {value!r} is no {type(spec.default).__name__}')

    def updated(self, values: Mapping[str, Any]) -> 'Settings':
        """
        Return settings with some values replaced, all groups checked as a set.

        Parameters
        ----------
        values : dict
            Flat names to values, for example `{'range.min_depth': 0.3}`.

        Returns
        -------
        settings : Settings

        Raises
        ------
        SettingsError
            For an unknown name (the nearest known one is suggested), a wrong type or range.

        """
        return updated(self, values)

    def flat(self) -> dict[str, Any]:
        """Return a dict of flat names (`'range.min_depth'`) to values."""
        return flat(self)
