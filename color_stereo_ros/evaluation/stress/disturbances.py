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
"""The registry of disturbances: what real rigs do to a pair, one at a time, in steps."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from .mounting import Mounting
from .rig import StressRig
from ...core.registry import Registry

BUMP_AT = 4
"""Pair of a sequence in which the rows jump."""

LEFT_GAINS, RIGHT_GAINS = np.array([1.15, 1.2, 1.27]), np.array([0.9, 0.86, 0.8])
"""Gains of R, G and B at the borders of a lens whose color varies, as measured on a real pair."""


@dataclass(frozen=True)
class Disturbance:
    """One way in which a rig differs from its calibration and from the clean simulation."""

    group: str
    """Which part of the rig it belongs to; also a name for `--only`."""
    title: str
    unit: str
    levels: tuple
    """Severities, in the order of a curve."""
    apply: object
    """Function (rig, level) that changes a StressRig."""
    per_pair: object = None
    """Function (number of the pair, level) -> `rows` (px), `gains` (3 floats); None: at rest."""

    @property
    def hardest(self):
        """
        Return the levels that `--quick` takes: the last one.

        Of a pattern all: on a bare surface colors must tell, on a printed one brightness does.

        """
        return self.levels if self.group == 'pattern' else self.levels[-1:]

    def rig(self, level):
        """Return the disturbed StressRig of a level."""
        rig = StressRig()
        self.apply(rig, level)
        return rig


DISTURBANCES = Registry('disturbance', Disturbance)


def disturbance(name, group, title, unit='', *levels):
    """Return a decorator that registers a function (rig, level)."""
    def keep(function):
        DISTURBANCES.register(name, Disturbance(group, title, unit, levels or (1,), function))
        return function
    return keep


def chosen(names=()):
    """Return the (name, Disturbance) of names and groups, all without any."""
    groups = {entry.group for _, entry in DISTURBANCES.items()}
    for name in names:
        if name not in groups:
            DISTURBANCES[name]
    return [(name, entry) for name, entry in DISTURBANCES.items()
            if not names or name in names or entry.group in names]


def _mounted(name, title, unit, field, factor, *levels):
    def apply(rig, level):
        rig.mounting = replace(rig.mounting, **{field: factor * level})
    disturbance(name, 'geometry', title, unit, *levels)(apply)


def _viewed(name, group, title, unit, sides, field, *levels, of=lambda level: level):
    """Register a change of a field of one view or both."""
    def apply(rig, level):
        for side in sides:
            setattr(getattr(rig, side), field, of(level))
    disturbance(name, group, title, unit, *levels)(apply)


def _wired(name, title, unit, sides, field, *levels, of=lambda level: level, group='electronics'):
    """Register a change of a field of the simulated camera, of one or both."""
    def apply(rig, level):
        for side in sides:
            getattr(rig, side).camera[field] = of(level)
    disturbance(name, group, title, unit, *levels)(apply)


BOTH, LEFT, RIGHT = ('left', 'right'), ('left',), ('right',)

disturbance('none', 'none', 'as calibrated')(lambda rig, level: None)

_mounted('rows', 'right view lower', 'px', 'rows', 1.0, 0.1, 0.25, 0.5, 1, 2, 5, 20)
_mounted('roll', 'right camera rolled', 'deg', 'roll', 1.0, 0.1, 0.25, 0.5)
_mounted('pitch', 'right camera pitched', 'deg', 'pitch', 1.0, 0.05, 0.1)
_mounted('yaw', 'right camera yawed: columns and meters', 'deg', 'yaw', 1.0, 0.05, 0.1)
_mounted('focal', 'focal length of the right', '%', 'focal', 0.01, 0.1, 0.3, 1)
_mounted('k1', 'first radial coefficient of the right, added', '', 'k1', 1.0, 0.01, 0.03)


@disturbance('mixed_rows', 'geometry', 'rows, roll, pitch, focal length and k1 together',
             'x 1 px, -.2 deg, .03 deg, .3 %, .01', 0.5, 1)
def _mixed_rows(rig, level):
    rig.mounting = Mounting(rows=level, roll=-0.2 * level, pitch=0.03 * level,
                            focal=0.003 * level, k1=0.01 * level)


_viewed('blur_right', 'optics', 'right view out of focus, sigma', 'px', RIGHT, 'blur', 1, 2, 3)
_viewed('blur_left', 'optics', 'left view out of focus, sigma', 'px', LEFT, 'blur', 2, 3)
_viewed('blur_both', 'optics', 'both views out of focus, sigma', 'px', BOTH, 'blur', 1, 2, 3)
_viewed('blur_ramp', 'optics', 'right view out of focus towards one border, sigma there', 'px',
        RIGHT, 'uneven_blur', 2, 3, of=lambda level: lambda y, x: level * (1 + x) / 2)
_viewed('blur_corners', 'optics', 'right view out of focus towards the corners, sigma there', 'px',
        RIGHT, 'uneven_blur', 2, 3.5,
        of=lambda level: lambda y, x: level * np.hypot(y, x) / np.sqrt(2))
_viewed('motion_right', 'optics', 'right view moves along the rows', 'px', RIGHT, 'motion', 5, 9,
        of=lambda level: (level, 0))
_viewed('motion_rows', 'optics', 'right view moves across the rows', 'px', RIGHT, 'motion', 5, 9,
        of=lambda level: (0, level))
_viewed('motion_both', 'optics', 'both views move along the rows', 'px', BOTH, 'motion', 9,
        of=lambda level: (level, 0))
_viewed('chromatic', 'optics', 'chromatic aberration of both', 'px', BOTH, 'chromatic', 0.5, 1, 2)
_viewed('chromatic_one', 'optics', 'chromatic aberration of the right', 'px', RIGHT, 'chromatic',
        1)
_wired('vignetting', 'natural vignetting of both, share', '', BOTH, 'vignetting', 1,
       group='optics')


@disturbance('vignetting_one', 'optics', 'light in the corners of the right', 'x', 0.7, 0.5)
def _vignetting_one(rig, level):
    rig.right.gains.append(lambda y, x: 1 - (1 - level) * (x * x + y * y) / 2)


_viewed('jpeg', 'electronics', 'JPEG 4:2:0 of both, quality', '', BOTH, 'jpeg', 95, 85, 60, 40)
_viewed('hot', 'electronics', 'hot pixels', '%', BOTH, 'hot', 0.1, 1,
        of=lambda level: level / 100)
_wired('gamma_both', 'gamma of both', '', BOTH, 'response', 2.2)
_wired('gamma_one', 'gamma of the right', '', RIGHT, 'response', 1.4, 2.2)
_wired('crosstalk_both', 'share of each other color in each channel of both', '', BOTH,
       'crosstalk', 0.1, 0.15, 0.3)
_wired('crosstalk_one', 'share of each other color in each channel of the right', '', RIGHT,
       'crosstalk', 0.1, 0.15, 0.3)
_wired('full_well', 'full well', 'electrons', BOTH, 'full_well', 4000, 1000)
_wired('speckle', 'relative noise of each pixel', '', BOTH, 'speckle', 0.03, 0.0625)
_wired('black_level', 'dark level of both', 'DN', BOTH, 'dark_level', 16)
_wired('black_one', 'dark level of the right', 'DN', RIGHT, 'dark_level', 16)
_wired('no_mosaic', 'cameras of three chips', '', BOTH, 'bayer', 1, of=lambda level: 'none')
_viewed('edge_aware', 'electronics', 'edge-aware demosaicing', '', BOTH, 'demosaicing', 1,
        of=lambda level: 'edge_aware')
_viewed('vng', 'electronics', 'VNG demosaicing', '', BOTH, 'demosaicing', 1,
        of=lambda level: 'vng')
_viewed('unsharp', 'electronics', 'unsharp mask of both, strength', '', BOTH, 'unsharp', 1, 2)
_viewed('unsharp_one', 'electronics', 'unsharp mask of the right, strength', '', RIGHT, 'unsharp',
        1.5)
_viewed('exposure', 'electronics', 'exposure of both', 'x', BOTH, 'exposure', 0.3, 0.1, 0.05)
_viewed('overexposure', 'electronics', 'exposure of both: saturated', 'x', BOTH, 'exposure', 1.5,
        2.5)
_viewed('exposure_one', 'electronics', 'exposure of the right', 'x', RIGHT, 'exposure', 0.7, 0.5)


def _sensitivity(channel):
    def of(level):
        values = [1.0, 1.0, 0.5]
        values[channel] *= level
        return tuple(values)
    return of


_wired('red_gain', 'red of the right', 'x', RIGHT, 'sensitivity', 0.9, 0.75, 0.6, 0.5,
       of=_sensitivity(0), group='color')
_wired('blue_gain', 'blue of the right', 'x', RIGHT, 'sensitivity', 0.6, 1.5,
       of=_sensitivity(2), group='color')
_wired('white_balance', 'blue of both', 'x', BOTH, 'sensitivity', 2, 0.5, of=_sensitivity(2),
       group='color')


@disturbance('shading', 'color', 'color of the right varies from border to border, 1.27 .. .8',
             'share', 0.5, 1)
def _shading(rig, level):
    def gains(y, x):
        place = (1 + x + 0.3 * (1 - x * x) + 0.2 * y) / 2
        return np.exp(level * (place * np.log(RIGHT_GAINS) + (1 - place) * np.log(LEFT_GAINS)))
    rig.right.gains.append(gains)


@disturbance('shading_radial', 'color', 'color of the right varies from middle to corner',
             'x 18 %', 1)
def _shading_radial(rig, level):
    rig.right.gains.append(
        lambda y, x: 1 + level * np.array([0.18, 0.0, -0.18]) * (x * x + y * y - 0.7))


@disturbance('bands', 'color', 'color bands of a one-chip projector, by rows', '+-', 0.1, 0.2)
def _bands(rig, level):
    def gains(phase):
        return lambda y, x: 1 + level * np.sin(
            2 * np.pi * (2.2 * y + np.arange(3) / 3) + phase)
    rig.left.gains.append(gains(0.0))
    rig.right.gains.append(gains(1.9))


@disturbance('ambient', 'light', 'white light of the surroundings', '%', 10, 30, 100, 300)
def _ambient(rig, level):
    rig.ambient = (level / 100,) * 3


@disturbance('tungsten', 'light', 'warm light of the surroundings', '%', 100)
def _tungsten(rig, level):
    rig.ambient = (0.015 * level, 0.01 * level, 0.005 * level)


@disturbance('contrast', 'light', 'contrast of the projector', ': 1', 20, 5)
def _contrast(rig, level):
    rig.black = 1 / level


@disturbance('imbalance', 'light', 'green and blue of the projector x .7, x .5')
def _imbalance(rig, level):
    rig.projector_gains = (1.0, 0.7, 0.5)


def _projected(name, title, unit, level, group='light'):
    def apply(rig, level):
        rig.pattern = name.removeprefix('projector_')
    disturbance(name, group, title, unit, level)(apply)


_projected('projector_gamma', 'gamma of the projector', '', 2.2)
_projected('defocus', 'projector out of focus, sigma', 'px of the pattern', 3)
_projected('low_resolution', 'projector of 640 columns', '', 1)
_projected('fine', 'projector of 1920 columns, feature_size unchanged', '', 1)


@disturbance('red_object', 'surface', 'saturated red object, albedo .6 .05 .05')
def _red_object(rig, level):
    rig.object_color = (0.73, 0.061, 0.061)


@disturbance('blue_object', 'surface', 'saturated blue object')
def _blue_object(rig, level):
    rig.object_color = (0.06, 0.1, 0.7)


@disturbance('dark_object', 'surface', 'black object, albedo', 'x', 0.1, 0.03)
def _dark_object(rig, level):
    rig.object_color = (level,) * 3


@disturbance('print', 'surface', 'print on all surfaces, contrast', '', 0.5, 0.9)
def _print(rig, level):
    rig.printed = level


@disturbance('gloss', 'surface', 'light of which the right sees more, 45 px wide', '+-', 0.15, 0.3)
def _gloss(rig, level):
    def gains(y, x):
        noise = np.random.default_rng(3).standard_normal((y.shape[0], x.shape[1]))
        smooth = cv2.GaussianBlur(noise, (0, 0), 45)
        return np.exp(level * smooth / smooth.std())[..., None]
    rig.right.gains.append(gains)


def _colorless(rig):
    rig.left.gray = rig.right.gray = True


@disturbance('gray', 'mono', 'mono cameras under the default pattern')
def _gray(rig, level):
    _colorless(rig)


@disturbance('gray_print', 'mono', 'the same with print, contrast', '', 0.8)
def _gray_print(rig, level):
    _colorless(rig)
    rig.printed = level


def _patterned(name, key, title, kind, *levels, **settings):
    """Register a foreign pattern, by the name the user gives it; levels are contrasts of print."""
    def apply(rig, level):
        rig.pattern, rig.printed = key, level
        rig.settings.update({'pattern.type': kind, **settings})
    disturbance(name, 'pattern', f'{title} named {kind}, contrast of print', '', *levels)(apply)


for _key, _kind, _cycles in (('sine_1', 'sine', 1), ('sine_16', 'sine', 16),
                             ('sine_32', 'sine', 32), ('sweep', 'sweep', 1)):
    _title = f'{_cycles} {_kind}{"s" if _cycles > 1 else ""}'
    _levels = (0, 0.6) if _cycles < 32 else (0,)
    _patterned(_key, _key, _title, _kind, *_levels, **{'pattern.cycles': _cycles})
    _patterned(f'{_key}_unknown', _key, _title, 'unknown', *_levels)
_patterned('patches', 'patches', 'patches that repeat', 'unknown', 0, 0.6)
_patterned('patches_misnamed', 'patches', 'patches that repeat', 'hue_field', 0)
_patterned('speckle_pattern', 'speckle', 'gray speckle', 'unknown', 0, 0.6)
_patterned('dots', 'dots', 'white dots', 'unknown', 0)
_patterned('passive', 'white', 'white light', 'unknown', 0.5, 0.9)
_patterned('unknown', 'default', 'default pattern', 'unknown', 0)


@disturbance('sine_shading', 'together', '16 sines, print, and color that varies', 'share', 1)
def _sine_shading(rig, level):
    DISTURBANCES['sine_16'].apply(rig, 0.5)
    _shading(rig, level)


@disturbance('sine_red', 'together', '16 sines, print, and red of the right', 'x', 0.9, 0.6)
def _sine_red(rig, level):
    DISTURBANCES['sine_16'].apply(rig, 0.5)
    DISTURBANCES['red_gain'].apply(rig, level)


@disturbance('sine_rows', 'together', '16 sines, print, and right view lower', 'px', 1)
def _sine_rows(rig, level):
    DISTURBANCES['sine_16'].apply(rig, 0.5)
    DISTURBANCES['rows'].apply(rig, level)


@disturbance('gray_rows', 'together', 'mono cameras, speckle, print, right view lower', 'px', 1)
def _gray_rows(rig, level):
    DISTURBANCES['speckle_pattern'].apply(rig, 0.3)
    DISTURBANCES['rows'].apply(rig, level)
    _colorless(rig)


@disturbance('worn', 'together', 'rows, roll, focus, color, JPEG 85 and ambient light')
def _worn(rig, level):
    rig.mounting = Mounting(rows=0.6, roll=0.1)
    rig.right.blur = 1.2
    _shading(rig, 0.5)
    rig.left.jpeg = rig.right.jpeg = 85
    rig.ambient = (0.3, 0.3, 0.3)


_mounted('rows_100', 'right view lower, far beyond repair', 'px', 'rows', 1.0, 100)


@disturbance('upside_down', 'refusal', 'right camera upside down')
def _upside_down(rig, level):
    rig.swap = lambda left, right, other: (left, np.ascontiguousarray(right[::-1, ::-1]))


@disturbance('identical', 'refusal', 'the left image twice')
def _identical(rig, level):
    rig.swap = lambda left, right, other: (left, left.copy())


@disturbance('two_scenes', 'refusal', 'the right view of another scene')
def _two_scenes(rig, level):
    rig.swap = lambda left, right, other: (left, other)


def _bump(number, level):
    return {'rows': level if number >= BUMP_AT else 0.0}


def _flicker(number, level):
    noise = np.random.default_rng([5, number]).standard_normal(3)
    return {'gains': tuple(np.exp(level * noise))}


DISTURBANCES.register('bump', Disturbance(
    'sequence', f'right view jumps down in pair {BUMP_AT}', 'px', (1, 3),
    lambda rig, level: None, _bump))
DISTURBANCES.register('flicker', Disturbance(
    'sequence', 'colors of the right flicker from pair to pair, sigma', '', (0.1,),
    lambda rig, level: None, _flicker))
