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
"""Fields of settings: what they know of themselves, how they are checked, listed and replaced."""

from collections.abc import Callable, Mapping
from dataclasses import field, fields, replace
from itertools import groupby
import math
from typing import Any

from ..registry import suggestion
from ...errors import brief, SettingsError
from ...files.yaml import about_number

HUGE = 10 ** 300  # an integer beyond is infinite as a float


class Metadata(Mapping):
    """
    What a field knows, by name.

    A value that can be called is called each time it is read: a description that lists the
    entries of a registry is that of the moment.

    """

    def __init__(self, **values):
        """Keep the values."""
        self._values = values

    def __getitem__(self, name):
        """Return a value as it is now."""
        value = self._values[name]
        return value() if callable(value) else value

    def __iter__(self):
        """Iterate over the names."""
        return iter(self._values)

    def __len__(self):
        """Return the number of values."""
        return len(self._values)


OFF = 'off'


def setting(default: Any, description: str | Callable[[], str], *, unit='', minimum=None,
            maximum=None, choices=None, off=None, method=None) -> Any:
    """
    Return a dataclass field that knows its description, unit and legal values.

    Parameters
    ----------
    default : bool, int, float or str
        The value where nobody sets another one.
    description : str or callable
        A function without arguments returns the text of the moment.
    unit : str
        Of a number; empty = it counts, or is a ratio.
    minimum, maximum : int or float
        Of a number; both belong to the range.
    choices : sequence of str or Registry
        Of a text; the names of a registry are those of the moment.
    off : bool, int or float
        The value that switches a stage off; None: the setting is no switch.
    method : str
        The matching method that the stage belongs to; None: to all.

    Returns
    -------
    field : dataclasses.Field

    """
    return field(default=default, metadata=Metadata(
        description=description, unit=unit, minimum=minimum, maximum=maximum, choices=choices,
        off=off, method=method))


class Group:
    """Base of a group of settings: checks every field when it is built."""

    def __post_init__(self) -> None:
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
        value = float(value) if abs(value) < HUGE else math.inf if value > 0 else -math.inf
    if hasattr(value, 'item') and isinstance(value.item(), kind):
        value = value.item()  # a numpy scalar
    if value is False and OFF in (spec.metadata['choices'] or ()):
        value = OFF  # what YAML, and so ROS, makes of the bare word
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        hint = about_number(value) if kind in (int, float) else ''
        raise SettingsError(f'{name} = {brief(value)} is a {type(value).__name__}, '
                            f'expected {kind.__name__}{hint}')
    meta = spec.metadata
    if meta['choices'] is not None and value not in meta['choices']:
        raise SettingsError(f'{name} = {brief(value)} is not one of {", ".join(meta["choices"])}')
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
            raise SettingsError(f'unknown setting {brief(name)}{suggestion(name, known)}')
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
        For example Settings.
    name : str
        A flat name that the settings have.
    value : object
        What somebody has given.

    Raises
    ------
    SettingsError
        For a wrong type, or a value outside its range.

    """
    group, _, key = name.partition('.')
    owner = getattr(settings, group)
    return _checked(owner, next(spec for spec in fields(owner) if spec.name == key), value)


def described(settings):
    """Yield (flat name, default, metadata) for every field of any dataclass made of groups."""
    for group in fields(settings):
        for spec in fields(getattr(settings, group.name)):
            yield f'{group.name}.{spec.name}', spec.default, spec.metadata


def explained(registry, default):
    """
    Return `'name: summary; ...'` of every entry of a registry, the default marked.

    Neighbors with the same summary share it: `'sweep, bright_sweep: ...'`. An entry without one
    is named alone.

    Parameters
    ----------
    registry : Registry
        Of entries with a `summary`.
    default : str
        The name that is marked.

    """
    parts = []
    for summary, entries in groupby(registry.items(), key=lambda item: item[1].summary):
        names = [name for name, _ in entries]
        text = ', '.join(names) + (f': {summary}' if summary else '')
        parts.append(text + (' (default)' if default in names else ''))
    return '; '.join(parts)
