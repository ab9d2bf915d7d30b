# SPDX-License-Identifier: Apache-2.0
"""
Settings, one frozen class per stage: the single source of every name, default, unit and range.

The ROS parameters, `config/*.yaml`, the command line and the documentation are all derived from
the fields below.

"""

from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
import math

from ...errors import SettingsError


def setting(default, description, *, unit='', minimum=None, maximum=None, choices=None, off=None,
            method=None):
    """
    Return a dataclass field that knows its description, unit and legal values.

    off: the value that switches a stage off; None: the setting is no switch. method: the method
    that the stage belongs to, 'surface' or 'paper'; None: to both.

    """
    return field(default=default, metadata={
        'description': description, 'unit': unit, 'minimum': minimum, 'maximum': maximum,
        'choices': choices, 'off': off, 'method': method})


class Group:
    """Base of a group of settings: checks every field when it is built."""

    def __post_init__(self):
        """Check type and range of every field; an integer is taken for a float."""
        for spec in fields(self):
            object.__setattr__(self, spec.name, _checked(self, spec, getattr(self, spec.name)))
        self.check_together()

    def check_together(self):
        """Raise SettingsError where two fields contradict each other."""


def _checked(group, spec, value):
    name = f'{group.prefix}.{spec.name}'
    kind = type(spec.default)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if hasattr(value, 'item') and isinstance(value.item(), kind):
        value = value.item()  # a numpy scalar
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise SettingsError(f'{name} = {value!r} is a {type(value).__name__}, '
                            f'expected {kind.__name__}')
    meta = spec.metadata
    if meta['choices'] is not None and value not in meta['choices']:
        raise SettingsError(f'{name} = {value!r} is not one of {", ".join(meta["choices"])}')
    if kind in (int, float):
        _check_range(name, value, meta)
    return value


def _check_range(name, value, meta):
    low, high = meta['minimum'], meta['maximum']
    below = low is not None and value < low
    above = high is not None and value > high
    if math.isnan(value) or below or above:
        unit = f' {meta["unit"]}' if meta['unit'] else ''
        raise SettingsError(f'{name} = {value}{unit} is outside {low} .. {high}{unit}')


PATTERN_TYPES = ('hue_field', 'sweep', 'bright_sweep', 'sine', 'walsh', 'lines', 'wave_field',
                 'pseudo_noise', 'unknown')


@dataclass(frozen=True)
class PatternSettings(Group):
    """What the projector shows."""

    prefix = 'pattern'

    type: str = setting(
        'hue_field', 'hue_field: aperiodic 2-D hue, uniform brightness (default); sweep, '
        'bright_sweep: paper fig. 2.2 right and left; sine: three phase-shifted sines; walsh; '
        'lines: high-contrast lines; wave_field: 2-D random color waves; pseudo_noise: colored '
        'patches; unknown: some other pattern', choices=PATTERN_TYPES)
    width: int = setting(1024, 'columns of the projector', unit='px', minimum=8, maximum=8192)
    height: int = setting(1024, 'rows of the projector', unit='px', minimum=8, maximum=8192)
    cycles: int = setting(
        1, 'repetitions over the width (sweep, bright_sweep, sine)', minimum=1, maximum=512)
    feature_size: float = setting(
        9.0, 'size of the smallest structure: correlation length of hue_field, shortest half wave '
        'of wave_field, width of a line or patch (lines, pseudo_noise); smaller is more precise '
        'and asks more of projector and cameras', unit='px', minimum=1.0, maximum=256.0)
    seed: int = setting(1, 'seed of the random patterns', minimum=0, maximum=2**31 - 1)


@dataclass(frozen=True)
class ColorSettings(Group):
    """Photometry: what happens to the colors before they are compared (paper, sec. 2.2)."""

    prefix = 'color'

    dark_level: float = setting(
        -1.0, 'signal of a camera that sees no light, subtracted first; -1 estimates it from '
        'each image', unit='DN', minimum=-1.0, maximum=128.0)
    saturation_level: int = setting(
        254, 'a channel at or above this is overexposed', unit='DN', minimum=1, maximum=256)
    min_signal: float = setting(
        4.0, 'smallest brightest channel above the dark level; below it a pixel counts as dark',
        unit='DN', minimum=0.0, maximum=255.0)
    equalize: bool = setting(
        True, 'equalize the channels of the cameras before anything else; the surface method '
        'removes half of the difference, since more would amplify the noise of a weak channel',
        off=False)
    equalize_cameras: str = setting(
        'automatic', 'separate: each camera has gains of its own; shared: two '
        'cameras of one type, the same gains for both (most precise); automatic: shared unless '
        'they differ clearly (surface method: by 12 %, and only under hue_field, wave_field and '
        'pseudo_noise, of which both cameras see all hues; paper method: by 20 to 35 %)',
        choices=('automatic', 'shared', 'separate'))
    zero_weakest: bool = setting(
        True, 'paper method: set the weakest component to zero (right for sweep, bright_sweep '
        'and hue_field, where one component is always zero)', off=False, method='paper')
    scale: bool = setting(
        True, 'paper method: scale each color so that its components sum to 255', off=False,
        method='paper')
    smoothing: float = setting(
        1.0, 'paper method: standard deviation of the Gaussian smoothing of the corrected '
        'colors, 0 = none', unit='px', minimum=0.0, maximum=16.0, off=0.0, method='paper')


@dataclass(frozen=True)
class MatchingSettings(Group):
    """How corresponding points are found."""

    prefix = 'matching'

    method: str = setting(
        'surface', 'surface: coarse to fine with slanted surfaces (default); paper: the '
        'exhaustive search of the paper, sec. 2.2', choices=('surface', 'paper'))
    min_confidence: float = setting(
        0.6, 'surface method: least probability of being right within 1 px; a larger value gives '
        'fewer and better ranges', minimum=0.0, maximum=1.0)
    smoothness: float = setting(
        1.0, 'surface method: how much the coarse search dislikes steps of the disparity, as a '
        'factor of what suits the pattern; 0 = each node for itself', minimum=0.0, maximum=10.0,
        off=0.0, method='surface')
    texture: float = setting(
        1.0, 'surface method: how much the brightness of the surface counts beside its color in '
        'the coarse search, as a factor of what suits the pattern', minimum=0.0, maximum=10.0)
    refinements: int = setting(
        2, 'surface method: rounds of least squares; 0 = coarse disparities only',
        minimum=0, maximum=10, off=0, method='surface')
    slanted: bool = setting(
        True, 'surface method: let the least-squares window lean with the surface',
        off=False, method='surface')
    foreshortening: bool = setting(
        True, 'surface method: blur the left view of a leaning surface as the right one is',
        off=False, method='surface')
    propagation: bool = setting(
        True, 'surface method: let nodes near depth edges try the planes of their neighbors',
        off=False, method='surface')
    color_matching: bool = setting(
        True, 'surface method: measure the color difference of the cameras from each pair',
        off=False, method='surface')
    occlusion_test: bool = setting(
        True, 'surface method: distrust places of the right image that two surfaces claim',
        off=False, method='surface')
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
        'share; 0 accepts all', minimum=0.0, maximum=10.0)
    left_right_tolerance: float = setting(
        1.0, 'paper method: largest difference between the matches left to right and right to '
        'left; 0 switches the test off', unit='px', minimum=0.0, maximum=64.0, off=0.0,
        method='paper')
    local_limit: float = setting(
        0.0, 'paper method: local disparity limit: a second search stays this close to the '
        'median disparity of the surroundings; 0 = global limits only',
        unit='px', minimum=0.0, maximum=256.0)

    def check_together(self):
        """Refuse even windows: they have no center."""
        for name in ('window_width', 'window_height'):
            if getattr(self, name) % 2 == 0:
                raise SettingsError(f'matching.{name} = {getattr(self, name)} px is even, '
                                    'expected an odd number 1 .. 63 px')


@dataclass(frozen=True)
class RangeSettings(Group):
    """The working range; disparity limits follow from it and the calibration."""

    prefix = 'range'

    min_depth: float = setting(0.2, 'nearest Z that is searched', unit='m',
                               minimum=0.001, maximum=1000.0)
    max_depth: float = setting(1.0, 'farthest Z that is searched', unit='m',
                               minimum=0.001, maximum=1000.0)

    def check_together(self):
        """Refuse an empty range."""
        if self.min_depth >= self.max_depth:
            raise SettingsError(f'range.min_depth = {self.min_depth} m must be smaller than '
                                f'range.max_depth = {self.max_depth} m')


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
    range: RangeSettings = RangeSettings()

    def __post_init__(self):
        """Refuse a group of the wrong class."""
        for spec in fields(self):
            value = getattr(self, spec.name)
            if not isinstance(value, type(spec.default)):
                raise SettingsError(f'{spec.name} = {value!r} is no {type(spec.default).__name__}')

    def updated(self, values):
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

    def flat(self):
        """Return a dict of flat names (`'range.min_depth'`) to values."""
        return flat(self)


def flat(settings):
    """Return a dict of flat names to values for any dataclass made of groups."""
    return {f'{group.name}.{spec.name}': getattr(getattr(settings, group.name), spec.name)
            for group in fields(settings) for spec in fields(getattr(settings, group.name))}


def updated(settings, values):
    """Return a copy of any dataclass made of groups with flat names replaced, checked as a set."""
    known = flat(settings)
    changes = {}
    for name, value in values.items():
        if name not in known:
            raise SettingsError(f'unknown setting {name!r}{suggestion(name, known)}')
        group, _, key = name.partition('.')
        changes.setdefault(group, {})[key] = value
    return replace(settings, **{group: replace(getattr(settings, group), **change)
                                for group, change in changes.items()})


def checked_value(settings, name, value):
    """
    Return the value of one setting as its field takes it, an integer as a float for instance.

    Parameters
    ----------
    settings : dataclass made of groups
    name : str
        A flat name that the settings have.
    value : object

    Raises
    ------
    SettingsError
        For a wrong type, or a value outside its range.

    """
    group, _, key = name.partition('.')
    owner = getattr(settings, group)
    return _checked(owner, next(spec for spec in fields(owner) if spec.name == key), value)


def suggestion(name, known):
    """Return `'; did you mean ...?'` for the known name nearest to a mistyped one, or ''."""
    near = get_close_matches(name, list(known), n=1)
    return f'; did you mean {near[0]!r}?' if near else ''


def described(settings):
    """Yield (flat name, default, metadata) for every field of any dataclass made of groups."""
    for group in fields(settings):
        for spec in fields(getattr(settings, group.name)):
            yield f'{group.name}.{spec.name}', spec.default, spec.metadata
